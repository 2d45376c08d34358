"""The compiled walker and all that is read from it once, whichever plant moves it."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import mujoco
import numpy as np

from sim.errors import UserError
from sim.interface import COORDINATES, JOINTS, LEGS, AppliedForce, Plant, Vector
from sim.plant.build import BODIES, build_spec
from sim.plant.kinematics import LegGeometry
from sim.plant.terrain import Terrain
from sim.scenario import PlantSettings
from sim.scenario.plant import whole_substeps

DETECTED_LINKS = ("torso", "left_femur", "right_femur")
"""Links sensed to touch the ground; a femur reaches to the knee, so it answers for the tibia's upper end."""


class Walker(Plant, Protocol):
    """A plant that is a walker of this project: what a run, its log and its viewer need to know of it besides."""

    model: mujoco.MjModel
    data: mujoco.MjData
    legs: LegGeometry


class Body:
    """A walker's MJCF with modelling errors applied, compiled, on its ground; the base of every plant.

    Attributes:
        model: The compiled model, for viewers and tests.
        data: MuJoCo's live data, for viewers and tests; only the plant may change it.
        com: Centre of mass (x, z) of each link in its own frame in [m], by link name.
        torque_limits: Actuator limits in [N.m], (4,), ordered as `JOINTS`; infinite without saturation.
        legs: Lengths of the legs.
        period: Duration of one hold in [s].
        substeps: Physics steps in it.
        terrain: The ground.
        sources: Files the plant was read from.
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
        self.period = control_period
        self.substeps = whole_substeps(settings.timestep, control_period)
        self.sources = (Path(model_path),)
        self.terrain = Terrain(settings.ground, seed=seed, length=walk_length)
        self._spec = build_spec(settings, Path(model_path), self.terrain)
        self.model = model = self._spec.compile()
        self.data = mujoco.MjData(model)
        self.legs = LegGeometry.of(model)
        self._body_id = {name: model.body(name).id for name in BODIES}
        ipos = model.body_ipos
        self.com = {name: (float(ipos[i][0]), float(ipos[i][2])) for name, i in self._body_id.items()}
        self._actuators = np.array([model.actuator(name).id for name in JOINTS])
        limits: Vector = np.where(model.actuator_forcelimited, model.actuator_forcerange[:, 1], np.inf)
        self.torque_limits = limits[self._actuators]

    @property
    def mjcf_text(self) -> str:
        """The model as compiled, modelling errors applied, as MJCF."""
        return str(self._spec.to_xml())

    def _check_forces(self, forces: Sequence[AppliedForce]) -> None:
        """Raises `UserError` where a force is put on no link."""
        for applied in forces:
            if applied.body not in self._body_id:
                raise UserError(f'force on body = "{applied.body}": must be one of {", ".join(BODIES)}')


def check_start(q: Vector, dq: Vector, stance: str) -> int:
    """Row of the stance foot, `stance` being "left" or "right".

    Args:
        q: Joint angles and torso angle in [rad], (5,), ordered as `COORDINATES`.
        dq: Their rates in [rad/s], (5,).
        stance: The foot that stands.

    Raises:
        UserError: `stance` is not a leg, or an angle or a rate is not finite.
    """
    if stance not in LEGS:
        raise UserError(f'stance = {stance!r}: must be "left" or "right"')
    for name, vector, unit in (("q", q, "rad"), ("dq", dq, "rad/s")):
        if np.shape(vector) != (5,) or not np.isfinite(vector).all():
            order = ", ".join(COORDINATES)
            raise UserError(f"{name} = {vector} [{unit}]: must be 5 finite numbers, ordered as {order}")
    return LEGS.index(stance)


def check_torque(u: Vector) -> None:
    """Raises `ValueError` where a command in [N.m] is not finite or not four numbers: a defect of the controller."""
    if len(u) != len(JOINTS) or not math.isfinite(sum(u.tolist())):
        raise ValueError(f"u = {u} [N.m]: must be {len(JOINTS)} finite torques, ordered as {JOINTS}")
