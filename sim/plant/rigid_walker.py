"""The walker pinned at one foot: MuJoCo's inertia matrix and bias, a fixed-step RK4, and the rigid impact."""

from collections.abc import Sequence

import mujoco
import numpy as np

from sim.interface import COORDINATES, JOINTS, AppliedForce, Vector
from sim.plant import rigid_kernels as kernels
from sim.plant.build import BODIES
from sim.plant.kinematics import LegGeometry


class PinnedWalker:
    """Equations of motion of a walker whose stance foot is a hinge on the ground.

    Attributes:
        foothold: Where the pinned foot is, (x, z) in [m], (2,).
        legs: Lengths of the legs.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, legs: LegGeometry) -> None:
        """Args: model: the compiled walker; data: MuJoCo's, which is written; legs: their lengths."""
        self._model, self._data = model, data
        self._qpos, self._qvel = data.qpos, data.qvel  # live views, written only
        self.legs = legs
        self._work = work = np.zeros(1, kernels.WORK)
        # Views into the record, which compiled code reads and writes.
        self._leg, self.foothold, self._y = work["leg"], work["foothold"][0], work["y"][0]
        self._M, self._bias, self._applied = work["M"][0], work["bias"][0], work["applied"][0]

        def dof(joint: str) -> int:
            return int(model.jnt_dofadr[model.joint(joint).id])

        work["hip"], work["q"] = [dof("hip_x"), dof("hip_z")], [dof(name) for name in COORDINATES]
        work["damping"], work["lengths"] = model.dof_damping, self.legs.lengths
        self._hip = work["hip"][0]
        self._joints = work["q"][0, : len(JOINTS)]
        self._body_id = {name: model.body(name).id for name in BODIES}
        self.load(np.zeros(len(JOINTS)), ())

    @property
    def leg(self) -> int:
        """The pinned foot, 0 left, 1 right."""
        return int(self._leg[0])

    @leg.setter
    def leg(self, leg: int) -> None:
        self._leg[0] = leg

    def load(self, torque: Vector, forces: Sequence[AppliedForce]) -> None:
        """Hold joint torques in [N.m], (4,), and forces at points of the moving links from now on."""
        self._torque, self._forces = torque, forces
        self._applied[:] = 0.0
        self._applied[self._joints] = torque

    def place(self, q: Vector, dq: Vector) -> tuple[Vector, Vector]:
        """Put MuJoCo's walker there; its hip (x, z) in [m] and the hip's velocity in [m/s], (2,) each."""
        kernels.place(self._work, q, dq, self._qpos, self._qvel)
        return self._qpos[self._hip], self._qvel[self._hip]

    def swing_foot(self, q: Vector, dq: Vector) -> tuple[float, float, float, float]:
        """Swing foot from the pinned foot: x, z in [m] and their rates in [m/s]."""
        found: tuple[float, float, float, float] = kernels.swing_foot(self._work, q, dq)
        return found

    def after(self, q: Vector, dq: Vector, h: float) -> Vector:
        """Angles and rates h [s] later under the load, and the ground's impulse over h in [N.s], (12,)."""
        kernels.begin(self._work, q, dq, self._qpos, self._qvel)
        for stage in range(kernels.STAGES):
            self._weigh()
            mujoco.mj_comVel(self._model, self._data)
            mujoco.mj_rne(self._model, self._data, 0, self._bias)
            if self._forces:
                self._apply()
            kernels.stage(self._work, stage, h, self._qpos, self._qvel)
        return self._y.copy()

    def strike(self, q: Vector, dq: Vector) -> tuple[Vector, Vector, Vector]:
        """Impact of the swing foot, which is the pinned one afterwards.

        Args:
            q: Angles in [rad], (5,).
            dq: Rates before the impact in [rad/s], (5,).

        Returns:
            Rates after it in [rad/s], (5,), the ground's impulse on the landing foot in [N.s], (2,), and the velocity
            with which the other foot leaves the ground in [m/s], (2,).
        """
        hip, _ = self.place(q, dq)
        self._weigh()
        after, impulse, old_foot = np.empty(5), np.empty(2), np.empty(2)
        kernels.strike(self._work, q, dq, after, impulse, old_foot)
        self.leg = 1 - self.leg
        self.foothold[:] = hip + self.legs.foot(q, self.leg)
        return after, impulse, old_foot

    def _weigh(self) -> None:
        """Inertia matrix where the walker has been placed."""
        model, data = self._model, self._data
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_fullM(model, data, self._M)

    def _apply(self) -> None:
        """Generalised forces of motors and pushes where the walker has been placed."""
        data, applied = self._data, self._applied
        applied[:] = 0.0
        applied[self._joints] = self._torque
        for push in self._forces:
            body = self._body_id[push.body]
            frame = data.xmat[body].reshape(3, 3)
            point = data.xpos[body] + frame @ np.array([push.point[0], 0.0, push.point[1]])
            force = np.array([push.force[0], 0.0, push.force[1]])
            mujoco.mj_applyFT(self._model, data, force, np.zeros(3), point, body, applied)
