"""The walker pinned at one foot: MuJoCo's inertia matrix and bias, a fixed-step RK4, and the rigid impact."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.interface import COORDINATES, Vector
from sim.plant import rigid_equations as equations
from sim.plant import rigid_kernels as kernels
from sim.plant.engine import address
from sim.plant.kinematics import LegGeometry

NOTHING = np.zeros(0, dtype=bool)


class PinnedWalker:
    """Equations of motion of a walker whose stance foot is a hinge on the ground.

    Attributes:
        work: One record of `rigid_equations.WORK`, which compiled code reads and writes.
        foothold: Where the pinned foot is, (x, z) in [m], (2,).
        q: Its angles now in [rad], (5,).
        dq: Their rates in [rad/s], (5,).
        torque: Held at its joints in [N.m], (4,).
        legs: Lengths of the legs.
        forces: External forces that may act, rows of `rows.FORCE`.
        acting: Which of them do.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, legs: LegGeometry, forces: NDArray[np.void]) -> None:
        """Args: model: the compiled walker; data: MuJoCo's, which is written; legs: their lengths; forces: none yet."""
        self.legs, self.forces, self.acting = legs, forces, NOTHING
        self.work = work = np.zeros(1, equations.WORK)
        self._leg, self.foothold, self._y = work["leg"], work["foothold"][0], work["y"][0]
        self.q, self.dq, self.torque = work["now"][0, :5], work["now"][0, 5:], work["torque"][0]

        def dof(joint: str) -> int:
            return int(model.jnt_dofadr[model.joint(joint).id])

        work["model"], work["data"] = model._address, data._address
        work["qpos"], work["qvel"] = address(data.qpos), address(data.qvel)
        work["xpos"], work["xmat"], work["nbody"] = address(data.xpos), address(data.xmat), model.nbody
        work["M_at"], work["bias_at"] = address(work["M"]), address(work["bias"])
        work["applied_at"] = address(work["applied"])
        work["pushing_at"] = [address(row) for row in work["pushing"][0]]
        work["hip"], work["q"] = [dof("hip_x"), dof("hip_z")], [dof(name) for name in COORDINATES]
        work["damping"], work["lengths"] = model.dof_damping, self.legs.lengths
        self._qpos, self._hip = data.qpos, work["hip"][0]

    @property
    def leg(self) -> int:
        """The pinned foot, 0 left, 1 right."""
        return int(self._leg[0])

    @leg.setter
    def leg(self, leg: int) -> None:
        self._leg[0] = leg

    def after(self, q: Vector, dq: Vector, h: float) -> Vector:
        """Angles and rates h [s] later under the load, and the ground's impulse over h in [N.s], (12,)."""
        kernels.after(self.work, self.forces, self.acting, q, dq, h)
        return self._y.copy()

    def strike(self) -> tuple[Vector, Vector, Vector]:
        """Impact of the swing foot, which is the pinned one afterwards.

        Returns:
            Rates after it in [rad/s], (5,), the ground's impulse on the landing foot in [N.s], (2,), and the velocity
            with which the other foot leaves the ground in [m/s], (2,).
        """
        equations.place(self.work, self.q, self.dq)
        hip = self._qpos[self._hip]
        kernels.weigh(self.work)
        after, impulse, old_foot = np.empty(5), np.empty(2), np.empty(2)
        equations.strike(self.work, self.q, self.dq, after, impulse, old_foot)
        self.leg = 1 - self.leg
        self.foothold[:] = hip + self.legs.foot(self.q, self.leg)
        self.dq[:] = after
        return after, impulse, old_foot
