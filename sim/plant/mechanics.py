"""What the plant's MJCF says about its own mechanics, as numbers to hold against the controller's belief."""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from sim.interface import COORDINATES, JOINTS, Vector
from sim.plant.build import build_spec
from sim.scenario import PlantSettings


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


ORDER = ("hip_x", "hip_z", "torso", "left_hip", "left_knee", "right_hip", "right_knee")


class Mechanics:
    """A compiled MJCF without its contact."""

    def __init__(self, mjcf: Path) -> None:
        """Args: mjcf: the plant's model.

        Raises:
            UserError: unreadable, or a part of the walker is missing.
        """
        spec = build_spec(PlantSettings(), mjcf)
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        assert set(COORDINATES) < set(ORDER)
        self._address = np.array([self._model.jnt_dofadr[self._model.joint(name).id] for name in ORDER])
        motors = [self._model.actuator(name).id for name in JOINTS]
        self.torque_limits: Vector = self._model.actuator_forcerange[motors, 1].copy()
        joints = [self._model.jnt_dofadr[self._model.joint(name).id] for name in JOINTS]
        self.damping: Vector = np.asarray(self._model.dof_damping, dtype=float).reshape(-1)[joints]

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
