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

from sim.errors import PlantDiverged, UserError
from sim.interface import COORDINATES, FEET, JOINTS, AppliedForce, Observation, PlantState, Vector
from sim.plant.build import BODIES, INTEGRATORS, build_spec
from sim.plant.kinematics import LEGS, LegGeometry
from sim.plant.terrain import Terrain
from sim.scenario import PlantSettings

DETECTED_LINKS = ("torso", "left_femur", "right_femur")
"""Links sensed to touch the ground; a femur reaches to the knee, so it answers for the tibia's upper end."""

FOOTHOLD_DEPTH = 1e-6  # [m], half the depth at rest: at reset the stance foot is sensed as touching
WHOLE_TOLERANCE = 1e-9  # relative, for "the control period is a whole number of substeps"

__all__ = ["BODIES", "INTEGRATORS", "MujocoPlant", "build_spec"]

logger = logging.getLogger(__name__)


def _quiet(text: str) -> None:
    """Take MuJoCo's warnings to the log: by default it prints them and writes MUJOCO_LOG.TXT."""
    logger.debug("MuJoCo: %s", text)


class MujocoPlant:
    """Five-link walker with point feet on compliant frictional ground. Implements `sim.interface.Plant`.

    Attributes:
        com: Centre of mass (x, z) of each link in its own frame in [m], by link name.
        torque_limits: Actuator limits in [N.m], (4,), ordered as `JOINTS`; infinite without saturation.
        sources: Files the plant was read from.
        legs: Lengths of the legs.
    """

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
        self._period = control_period  # [s]
        self._substeps = whole_substeps(control_period, settings.timestep)
        self.sources = (Path(model_path),)
        self._terrain = Terrain(settings.ground, seed=seed, length=walk_length)
        spec = build_spec(settings, Path(model_path), self._terrain)
        self._model = model = spec.compile()
        self._data = data = mujoco.MjData(model)
        self._spec = spec

        def qpos_address(joint: str) -> int:
            return int(model.jnt_qposadr[model.joint(joint).id])

        self._hip_index = np.array([qpos_address("hip_x"), qpos_address("hip_z")])
        self._q_index = np.array([qpos_address(name) for name in COORDINATES])
        self._u_index = np.array([model.actuator(name).id for name in JOINTS])
        self._body_id = {name: model.body(name).id for name in BODIES}

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

        ipos = model.body_ipos
        self.com = {name: (float(ipos[i][0]), float(ipos[i][2])) for name, i in self._body_id.items()}
        limits: Vector = np.where(model.actuator_forcelimited, model.actuator_forcerange[:, 1], np.inf)
        self.torque_limits = limits[self._u_index]
        self.legs = LegGeometry.of(model)
        self._radius = float(model.geom("left_foot").size[0])  # [m]
        self._state_size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
        self._begin()

    @property
    def mjcf_text(self) -> str:
        """The model as compiled, modelling errors applied, as MJCF."""
        return str(self._spec.to_xml())

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model, for viewers and tests."""
        return self._model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's live data, for viewers and tests; only `hold` and `reset` may change it."""
        return self._data

    def integration_state(self) -> Vector:
        """All that the next step depends on (mjSTATE_INTEGRATION), a copy in SI units, (model's size,)."""
        state = np.empty(self._state_size)
        mujoco.mj_getState(self._model, self._data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
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
        if stance not in LEGS:
            raise UserError(f'stance = {stance!r}: must be "left" or "right"')
        for name, vector, unit in (("q", q, "rad"), ("dq", dq, "rad/s")):
            if np.shape(vector) != (5,) or not np.isfinite(vector).all():
                order = ", ".join(COORDINATES)
                raise UserError(f"{name} = {vector} [{unit}]: must be 5 finite numbers, ordered as {order}")
        mujoco.mj_resetData(self._model, self._data)
        self._qpos[self._q_index], self._qvel[self._q_index] = q, dq
        leg = LEGS.index(stance)
        x, z = self._feet(q.tolist())[leg]
        dx, dz = self._feet_velocity(q.tolist(), dq.tolist())[leg]
        ground = self._terrain.under(0.0)
        above = (self._radius - FOOTHOLD_DEPTH) / math.cos(ground.angle)  # [m], of the sphere's centre
        self._qpos[self._hip_index] = -x, above + self._terrain.height(0.0) - z
        self._qvel[self._hip_index] = -dx, -dz
        mujoco.mj_forward(self._model, self._data)
        self._begin()

    def observe(self) -> Observation:
        """What ideal sensors read now."""
        return Observation(
            t=self._ticks * self._period,
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
        for (x, z), (fx, fz) in zip(self._feet(q.tolist()), (self._force_total / self._substeps).tolist(), strict=True):
            x, z = hip_x + x, hip_z + z
            ground = self._terrain.under(x)
            cos, sin = math.cos(ground.angle), math.sin(ground.angle)
            feet += (x, z)
            clearances.append(z - (x * sin + self._radius) / cos - ground.intercept)
            contact_forces += (fx * cos + fz * sin, fz * cos - fx * sin)
        numbers = np.array((*feet, *contact_forces, *clearances, *self._push))
        return PlantState(
            t=self._ticks * self._period,
            q=q,
            dq=self._qvel[self._q_index],
            hip=hip,
            dhip=self._qvel[self._hip_index],
            foot=numbers[0:4].reshape(2, 2),
            clearance=numbers[8:10],
            torque=self._actuator_force[self._u_index],
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
        if len(u) != len(JOINTS) or not math.isfinite(sum(u.tolist())):
            raise ValueError(f"u = {u} [N.m]: must be {len(JOINTS)} finite torques, ordered as {JOINTS}")
        self._ctrl[self._u_index] = u
        if forces or self._pushed:
            self._apply(forces)
        total = self._force_total
        total.fill(0.0)
        model, data, foot_forces = self._model, self._data, self._foot_forces
        for _ in range(self._substeps):
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

    def _absolute_angles(self, q: Sequence[float]) -> tuple[float, ...]:
        """Absolute angles of the links in [rad], ordered as `BODIES`, from `q` in [rad]; rates from rates."""
        left_hip, right_hip, left_knee, right_knee, torso = q
        left, right = torso + left_hip, torso + right_hip
        return torso, left, left + left_knee, right, right + right_knee

    def _feet(self, q: Sequence[float]) -> tuple[tuple[float, float], tuple[float, float]]:
        """Tips of the left and right tibia (x, z) relative to the hip in [m], from `q` in [rad], (5,)."""
        _, a, b, c, d = self._absolute_angles(q)
        (femur, tibia), (other_femur, other_tibia) = self.legs.lengths
        sin, cos = math.sin, math.cos  # written out: a generator costs as much again
        return (
            (-femur * sin(a) - tibia * sin(b), femur * cos(a) + tibia * cos(b)),
            (-other_femur * sin(c) - other_tibia * sin(d), other_femur * cos(c) + other_tibia * cos(d)),
        )

    def _feet_velocity(self, q: Sequence[float], dq: Sequence[float]) -> tuple[tuple[float, float], ...]:
        """Velocities of the tips relative to the hip in [m/s], from `q` [rad] and `dq` [rad/s], (5,)."""
        _, *legs = self._absolute_angles(q)
        _, *rates = self._absolute_angles(dq)
        return tuple(
            (
                -femur * da * math.cos(a) - tibia * db * math.cos(b),
                -femur * da * math.sin(a) - tibia * db * math.sin(b),
            )
            for (a, b), (da, db), (femur, tibia) in zip(
                (legs[:2], legs[2:]), (rates[:2], rates[2:]), self.legs.lengths, strict=True
            )
        )

    def _apply(self, forces: Sequence[AppliedForce]) -> None:
        """Write the forces as MuJoCo takes them: at the link's centre of mass, with the torque about it."""
        self._xfrc.fill(0.0)
        angles = dict(zip(BODIES, self._absolute_angles(self._qpos[self._q_index].tolist()), strict=True))
        push_x = push_z = 0.0
        for applied in forces:
            if applied.body not in self._body_id:
                raise UserError(f'force on body = "{applied.body}": must be one of {", ".join(BODIES)}')
            sin, cos = math.sin(angles[applied.body]), math.cos(angles[applied.body])
            com_x, com_z = self.com[applied.body]
            x, z = applied.point[0] - com_x, applied.point[1] - com_z  # [m], in the link's frame
            arm_x, arm_z = x * cos - z * sin, x * sin + z * cos  # [m], in the world frame
            fx, fz = applied.force
            self._xfrc[self._body_id[applied.body]] += (fx, 0.0, fz, 0.0, arm_z * fx - arm_x * fz, 0.0)
            push_x, push_z = push_x + fx, push_z + fz
        self._push, self._pushed, self._applied = (push_x, push_z), bool(forces), tuple(forces)

    def _diagnosis(self) -> str:
        number, info = self._warnings.tolist(), self._data.warning.lastinfo.tolist()
        warnings = [mujoco.mju_warningText(kind, info[kind]) for kind, count in enumerate(number) if count]
        detail = "; ".join(warnings) or f"qpos = {self._qpos.tolist()}, qvel = {self._qvel.tolist()}"
        return f"the plant diverged in the hold up to t = {self._ticks * self._period:.3f} s: {detail}"


def whole_substeps(control_period: float, timestep: float) -> int:
    """Number of physics steps in a hold; both in [s]."""
    if not (math.isfinite(timestep) and timestep > 0):
        raise UserError(f"plant.timestep = {timestep} s: must be positive")
    ratio = control_period / timestep
    substeps = max(1, round(ratio))
    if abs(ratio - substeps) > WHOLE_TOLERANCE * substeps:
        legal = control_period / math.ceil(ratio)
        raise UserError(
            f"plant.timestep = {timestep} s: must divide the control period of {control_period} s a whole "
            f"number of times; the next smaller legal value is {legal:.6g} s"
        )
    return substeps
