"""MuJoCo walker: the truth. Named access is resolved once; a tick reads and writes plain arrays.

What MuJoCo reports after a step belongs to the start of that step, except `qpos` and `qvel`. Positions of
hip and feet are therefore computed here from `qpos` in closed form; contact flags are one substep old.
"""

import logging
import math
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.lib.stride_tricks import as_strided

from sim.errors import PlantDiverged
from sim.interface import COORDINATES, FEET, AppliedForce, Observation, PlantState, Vector
from sim.plant.body import DETECTED_LINKS, Body, check_start, check_torque
from sim.plant.build import BODIES
from sim.plant.kinematics import absolute_angles
from sim.scenario import PlantSettings

FOOTHOLD_DEPTH = 1e-6  # [m], half the depth at rest: at reset the stance foot is sensed as touching

logger = logging.getLogger(__name__)


def _quiet(text: str) -> None:
    """Take MuJoCo's warnings to the log: by default it prints them and writes MUJOCO_LOG.TXT."""
    logger.debug("MuJoCo: %s", text)


class MujocoPlant(Body):
    """Five-link walker with point feet on compliant frictional ground. Implements `sim.interface.Plant`."""

    def __init__(
        self,
        settings: PlantSettings,
        model_path: Path,
        control_period: float,
        *,
        seed: int = 0,
        walk_length: float = 20.0,
    ) -> None:
        """Read, modify and compile the model.

        Args:
            settings: Integration, ground and modelling errors.
            model_path: MJCF file of the walker.
            control_period: Duration of one hold in [s].
            seed: The scenario's seed, for rough ground.
            walk_length: How far rough ground has to reach in [m].

        Raises:
            UserError: the file is missing or unreadable, or a setting is not legal.
        """
        mujoco.set_mju_user_warning(_quiet)
        super().__init__(settings, model_path, control_period, seed=seed, walk_length=walk_length)
        model, data = self.model, self.data

        def qpos_address(joint: str) -> int:
            return int(model.jnt_qposadr[model.joint(joint).id])

        self._hip_index = np.array([qpos_address("hip_x"), qpos_address("hip_z")])
        self._q_index = np.array([qpos_address(name) for name in COORDINATES])

        def sensor_address(sensor: str) -> int:
            return int(model.sensor_adr[model.sensor(sensor).id])

        self._feet_address = [sensor_address(name) for name in FEET]
        self._link_address = np.array([sensor_address(name) for name in DETECTED_LINKS])

        # Live views into MuJoCo's memory: read and copied within a call, never handed out.
        self._qpos, self._qvel, self._ctrl = data.qpos, data.qvel, data.ctrl
        self._sensors, self._actuator_force = data.sensordata, data.actuator_force
        self._xfrc, self._warnings = data.xfrc_applied, data.warning.number
        # A foot's sensor reads "found", then the net force on it in the world frame: its x and z, a row a foot.
        left, right = self._feet_address
        item = self._sensors.itemsize
        self._foot_forces = as_strided(self._sensors[left + 1 :], (2, 2), ((right - left) * item, 2 * item))

        self._radius = float(model.geom("left_foot").size[0])  # [m]
        self._state_size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
        self._begin()

    def integration_state(self) -> Vector:
        """All that the next step depends on (mjSTATE_INTEGRATION), a copy in SI units, (model's size,)."""
        state = np.empty(self._state_size)
        mujoco.mj_getState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        return state

    def reset(self, q: Vector, dq: Vector, stance: str) -> None:
        """Put the walker on its stance foot.

        The tip of the stance tibia is put at x = 0, at rest, the foot's sphere in the ground by a micrometre.
        The other foot is where `q` puts it, even if that is below the ground.

        Args:
            q: Joint angles and torso angle in [rad], (5,), ordered as `COORDINATES`.
            dq: Their rates in [rad/s], (5,).
            stance: "left" or "right".

        Raises:
            UserError: `stance` is not a leg, or an angle or a rate is not finite.
        """
        leg = check_start(q, dq, stance)
        mujoco.mj_resetData(self.model, self.data)
        self._qpos[self._q_index], self._qvel[self._q_index] = q, dq
        x, z = self.legs.feet(q.tolist())[leg]
        dx, dz = self.legs.feet_velocity(q.tolist(), dq.tolist())[leg]
        ground = self.terrain.under(0.0)
        above = (self._radius - FOOTHOLD_DEPTH) / math.cos(ground.angle)  # [m], of the sphere's centre
        self._qpos[self._hip_index] = -x, above + self.terrain.height(0.0) - z
        self._qvel[self._hip_index] = -dx, -dz
        mujoco.mj_forward(self.model, self.data)
        self._begin()

    def observe(self) -> Observation:
        """What ideal sensors read now."""
        return Observation(
            t=self._ticks * self.period,
            q=self._qpos[self._q_index],  # an index array copies
            dq=self._qvel[self._q_index],
            contact=self._contact(),
        )

    def state(self) -> PlantState:
        """The truth now; contact forces are zero before the first hold."""
        q = self._qpos[self._q_index]
        hip = self._qpos[self._hip_index]
        hip_x, hip_z = hip.tolist()
        feet: list[float] = []
        contact_forces: list[float] = []
        clearances: list[float] = []
        force = (self._force_total / self.substeps).tolist()  # [N] (x, z), a row a foot
        for (x, z), (fx, fz) in zip(self.legs.feet(q.tolist()), force, strict=True):
            x, z = hip_x + x, hip_z + z
            ground = self.terrain.under(x)
            cos, sin = math.cos(ground.angle), math.sin(ground.angle)
            feet += (x, z)
            clearances.append(z - (x * sin + self._radius) / cos - ground.intercept)
            contact_forces += (fx * cos + fz * sin, fz * cos - fx * sin)
        numbers = np.array((*feet, *contact_forces, *clearances, *self._push))
        return PlantState(
            t=self._ticks * self.period,
            q=q,
            dq=self._qvel[self._q_index],
            hip=hip,
            dhip=self._qvel[self._hip_index],
            foot=numbers[0:4].reshape(2, 2),
            clearance=numbers[8:10],
            torque=self._actuator_force[self._actuators],
            contact=self._contact(),
            contact_force=numbers[4:8].reshape(2, 2),
            push=numbers[10:12],
            penetrating=self._links_on_ground(),
            applied=self._applied,
        )

    def hold(self, u: Vector, forces: Sequence[AppliedForce] = ()) -> None:
        """Hold a commanded torque and external forces for one control period.

        Args:
            u: Commanded joint torque in [N.m], (4,), ordered as `JOINTS`; the actuators saturate it.
            forces: External forces throughout the hold, each at its point's position when the hold starts.

        Raises:
            ValueError: `u` is not finite or not four numbers: a defect of the controller.
            PlantDiverged: the state is not finite any more, or MuJoCo warned.
        """
        check_torque(u)
        self._ctrl[self._actuators] = u
        if forces or self._pushed:
            self._apply(forces)
        total = self._force_total
        total.fill(0.0)
        model, data, foot_forces = self.model, self.data, self._foot_forces
        for _ in range(self.substeps):
            mujoco.mj_step(model, data)
            total += foot_forces
        self._ticks += 1
        finite = math.isfinite(sum(self._qpos.tolist()) + sum(self._qvel.tolist()))
        if not finite or any(self._warnings.tolist()):
            raise PlantDiverged(self._diagnosis())

    def _begin(self) -> None:
        self._ticks = 0
        self._force_total = np.zeros((2, 2))  # [N] (x, z), a row a foot: sum over the substeps
        self._push = (0.0, 0.0)  # [N]
        self._pushed = False
        self._applied: tuple[AppliedForce, ...] = ()

    def _contact(self) -> tuple[bool, bool]:
        left, right = self._feet_address
        return bool(self._sensors[left] > 0), bool(self._sensors[right] > 0)

    def _links_on_ground(self) -> tuple[str, ...]:
        found = self._sensors[self._link_address].tolist()
        if not any(found):
            return ()
        return tuple(name for name, is_found in zip(DETECTED_LINKS, found, strict=True) if is_found)

    def _apply(self, forces: Sequence[AppliedForce]) -> None:
        """Write the forces as MuJoCo takes them: at the link's centre of mass, with the torque about it."""
        self._xfrc.fill(0.0)
        self._check_forces(forces)
        angles = dict(zip(BODIES, absolute_angles(self._qpos[self._q_index].tolist()), strict=True))
        push_x = push_z = 0.0
        for applied in forces:
            sin, cos = math.sin(angles[applied.body]), math.cos(angles[applied.body])
            com_x, com_z = self.com[applied.body]
            x, z = applied.point[0] - com_x, applied.point[1] - com_z  # [m], in the link's frame
            arm_x, arm_z = x * cos - z * sin, x * sin + z * cos  # [m], in the world frame
            fx, fz = applied.force
            self._xfrc[self._body_id[applied.body]] += (fx, 0.0, fz, 0.0, arm_z * fx - arm_x * fz, 0.0)
            push_x, push_z = push_x + fx, push_z + fz
        self._push, self._pushed, self._applied = (push_x, push_z), bool(forces), tuple(forces)

    def _diagnosis(self) -> str:
        number, info = self._warnings.tolist(), self.data.warning.lastinfo.tolist()
        warnings = [mujoco.mju_warningText(kind, info[kind]) for kind, count in enumerate(number) if count]
        detail = "; ".join(warnings) or f"qpos = {self._qpos.tolist()}, qvel = {self._qvel.tolist()}"
        return f"the plant diverged in the hold up to t = {self._ticks * self.period:.3f} s: {detail}"
