"""What the plant's MJCF says about its own mechanics, as numbers to hold against the controller's belief."""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from sim.interface import COORDINATES, JOINTS, LINKS, Vector
from sim.plant.build import build_spec
from sim.plant.mjcf import compile_spec, read_spec
from sim.scenario import PlantSettings


def inertia_across(model: mujoco.MjModel, body: int) -> float:
    """Moment of inertia of a body about the axis across the plane, through its centre of mass, in [kg m^2]."""
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    return float(turn.reshape(3, 3)[1] ** 2 @ model.body_inertia[body])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlantMechanics:
    """The plant at one state, base coordinates (hip x, hip z, torso), then left hip, left knee, right hip, right knee.

    Attributes:
        inertia: Mass matrix, (7, 7).
        bias: Coriolis, centrifugal and gravity terms in [N], [N.m], (7,).
        feet: Tips of the left and right tibia (x, z) in [m], (2, 2).
    """

    inertia: Vector
    bias: Vector
    feet: Vector


FREE = 6.28
"""[rad] A bound this far from the zero pose stops nothing."""

ORDER = ("hip_x", "hip_z", "torso", "left_hip", "left_knee", "right_hip", "right_knee")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlantJoints:
    """What acts in the plant's joints, in the order of `JOINTS`, (4,) each.

    Attributes:
        damping: In [N.m.s/rad].
        rotor: Rotor inertia in [kg m^2].
        friction: Dry friction in [N.m].
        stiffness: Of springs in [N.m/rad].
        rest: Where they are slack in [rad].
        low, high: Stops in [rad]; infinite where there is none.
        gear: Of the motors.
        torque_limits: Of the motors in [N.m].
    """

    damping: Vector
    rotor: Vector
    friction: Vector
    stiffness: Vector
    rest: Vector
    low: Vector
    high: Vector
    gear: Vector
    torque_limits: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantLink:
    """A link of the plant: mass in [kg], centre of mass along and across in [m], inertia in [kg m^2], joint in [m]."""

    mass: float
    com: float
    com_across: float
    inertia: float
    joint: tuple[float, float]


class Mechanics:
    """A compiled MJCF without its contact.

    Attributes:
        joints: What acts in its joints.
        links: Its links by their name.
        timestep: Of the file itself in [s].
        base: Damping, friction, rotor inertia and stiffness of the base's joints, those that are not zero.
    """

    def __init__(self, mjcf: Path) -> None:
        """Args: mjcf: the plant's model.

        Raises:
            UserError: unreadable, or a part of the walker is missing.
        """
        self.timestep = float(read_spec(mjcf).option.timestep)
        spec = build_spec(PlantSettings(), mjcf)
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self._model = model = compile_spec(spec, mjcf)
        self._data = mujoco.MjData(model)
        assert set(COORDINATES) < set(ORDER)
        self._address = np.array([model.jnt_dofadr[model.joint(name).id] for name in ORDER])
        motors = [model.actuator(name).id for name in JOINTS]
        joints = np.array([model.joint(name).id for name in JOINTS])
        dofs, addresses = model.jnt_dofadr[joints], model.jnt_qposadr[joints]
        limited = model.jnt_limited[joints].astype(bool)
        low, high = np.where(limited[:, None], model.jnt_range[joints], [-np.inf, np.inf]).T
        self.joints = PlantJoints(
            damping=model.dof_damping[dofs].copy(),
            rotor=model.dof_armature[dofs].copy(),
            friction=model.dof_frictionloss[dofs].copy(),
            stiffness=model.jnt_stiffness[joints].copy(),
            rest=model.qpos_spring[addresses].copy(),
            low=np.where(low > -FREE, low, -np.inf),
            high=np.where(high < FREE, high, np.inf),
            gear=model.actuator_gear[motors, 0].copy(),
            torque_limits=np.where(model.actuator_forcelimited, model.actuator_forcerange[:, 1], np.inf)[motors],
        )
        self.links = {name: self._link(name) for name in LINKS}
        base = [model.joint(name).id for name in ORDER[:3]]
        self.base = {
            f"{what} of {model.joint(j).name}": float(value)
            for j in base
            for what, value in (
                ("damping", model.dof_damping[model.jnt_dofadr[j]]),
                ("frictionloss", model.dof_frictionloss[model.jnt_dofadr[j]]),
                ("armature", model.dof_armature[model.jnt_dofadr[j]]),
                ("stiffness", model.jnt_stiffness[j]),
            )
            if value
        }

    def _link(self, name: str) -> PlantLink:
        model, body = self._model, self._model.body(name).id
        return PlantLink(
            mass=float(model.body_mass[body]),
            com=float(model.body_ipos[body, 2]),
            com_across=float(model.body_ipos[body, 0]),
            inertia=inertia_across(model, body),
            joint=(float(model.body_pos[body, 0]), float(model.body_pos[body, 2])),
        )

    def at(self, q: Vector, dq: Vector) -> PlantMechanics:
        """Mass matrix, bias and feet at a state in the order of `ORDER`, (7,) each."""
        model, data = self._model, self._data
        data.qpos[self._address], data.qvel[self._address] = q, dq
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        feet = np.array([data.site(f"{side}_foot").xpos[[0, 2]] for side in ("left", "right")])
        return PlantMechanics(
            inertia=full[np.ix_(self._address, self._address)], bias=data.qfrc_bias[self._address], feet=feet
        )
