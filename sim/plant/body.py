"""The compiled walker and all that is read from it once, whichever plant moves it."""

import functools
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.errors import UserError
from sim.interface import (
    COORDINATES,
    JOINTS,
    LEGS,
    LINKS,
    OBSERVATION,
    STATE,
    STEP,
    AppliedForce,
    NoTorque,
    Observation,
    Plant,
    PlantState,
    Rows,
    Vector,
    observation_of,
)
from sim.plant.build import compiled_model
from sim.plant.kinematics import LegGeometry
from sim.plant.rows import FORCE
from sim.plant.terrain import Terrain
from sim.scenario import PlantSettings
from sim.scenario.plant import whole_substeps

DETECTED_LINKS = ("torso", "left_femur", "right_femur")
"""Links sensed to touch the ground; a femur reaches to the knee, so it answers for the tibia's upper end."""


class Walker(Plant, Protocol):
    """A plant that is a walker of this project: what a run, its log and its viewer need to know of it besides."""

    model: mujoco.MjModel
    legs: LegGeometry

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's live data."""

    def observe(self) -> Observation:
        """What ideal sensors read now."""


class Body(ABC):
    """A walker's MJCF with modelling errors applied, compiled, on its ground; the base of every plant.

    Attributes:
        model: The compiled model, for viewers and tests.
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
        pictures: bool = False,
    ) -> None:
        """Read, modify and compile the model.

        Args:
            settings: Integration, ground and modelling errors.
            model_path: MJCF file of the walker.
            control_period: Duration of one hold in [s].
            seed: The scenario's seed, for rough ground.
            walk_length: How far rough ground has to reach in [m].
            pictures: Whether the model has its textures, for a viewer.

        Raises:
            UserError: the file is missing or unreadable, or a setting is not legal.
        """
        self._refuse(settings)
        self.period = control_period
        self.substeps = whole_substeps(settings.timestep, control_period)
        self.sources = (Path(model_path),)
        self.terrain = Terrain(settings.ground, seed=seed, length=walk_length)
        self.model = model = compiled_model(
            settings, Path(model_path), self.terrain, seed=seed, length=walk_length, pictures=pictures
        )
        self.legs = LegGeometry.of(model)
        self._body_ids = [model.body(name).id for name in LINKS]
        ipos = model.body_ipos
        self.com = {name: (float(ipos[i][0]), float(ipos[i][2])) for name, i in zip(LINKS, self._body_ids, strict=True)}
        self._actuators = np.array([model.actuator(name).id for name in JOINTS])
        limits: Vector = np.where(model.actuator_forcelimited, model.actuator_forcerange[:, 1], np.inf)
        self.torque_limits = limits[self._actuators]
        self._ground = self.terrain.table()
        self._state, self._seen, self._step = np.zeros(1, STATE), np.zeros(1, OBSERVATION), np.zeros(1, STEP)
        self._applied: tuple[AppliedForce, ...] = ()
        self.load(())
        self._prepare()

    @abstractmethod
    def _refuse(self, settings: PlantSettings) -> None:
        """Raises `UserError` where the settings ask for what this plant has not; before a file is read."""

    @abstractmethod
    def _prepare(self) -> None:
        """What this plant needs besides, of the compiled model at rest and with no force named.

        Raises:
            UserError: the model has what this plant has not.
        """

    @functools.cached_property
    def data(self) -> mujoco.MjData:
        """MuJoCo's live data, for viewers and tests; only the plant may change it."""
        return mujoco.MjData(self.model)

    def load(self, forces: Sequence[AppliedForce]) -> None:
        """Name the external forces that may act in the holds to come.

        Raises:
            UserError: a force is put on no link.
        """
        for applied in forces:
            if applied.body not in LINKS:
                raise UserError(f'force on body = "{applied.body}": must be one of {", ".join(LINKS)}')
        self._named = tuple(forces)
        self._forces = np.array([(LINKS.index(f.body), f.point, f.force) for f in forces], dtype=FORCE)

    @property
    def forces(self) -> Rows:
        """The forces loaded, rows of `FORCE`."""
        return self._forces

    @abstractmethod
    def look(self, state: Rows, seen: Rows, i: int) -> None:
        """Fill row `i` of `state` with the truth now and of `seen` with what ideal sensors read; see `Plant`."""

    @abstractmethod
    def move(self, step: Rows, i: int, acting: NDArray[np.bool_]) -> None:
        """Hold what row `i` commands; see `Plant`."""

    def state(self) -> PlantState:
        """The truth now; contact forces are zero before the first hold."""
        self.look(self._state, self._seen, 0)
        return PlantState.of(self._state[0], self._applied)

    def observe(self) -> Observation:
        """What ideal sensors read now."""
        self.look(self._state, self._seen, 0)
        return observation_of(self._seen[0])

    def hold(self, u: Vector, forces: Sequence[AppliedForce] = ()) -> None:
        """Hold a commanded torque and external forces for one control period.

        Args:
            u: Commanded joint torque in [N.m], (4,), ordered as `JOINTS`; the plant saturates it.
            forces: External forces throughout the hold.

        Raises:
            ValueError: `u` is not finite or not four numbers: a defect of the controller.
            PlantDiverged: the state is not finite any more.
        """
        if len(u) != len(JOINTS):
            raise no_torque(u)
        self.load(forces)
        self._step["u_total"][0] = u
        self.move(self._step, 0, np.ones(len(forces), dtype=bool))
        self._applied = self._named


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


def no_torque(u: Vector) -> NoTorque:
    """What is wrong where a command in [N.m] is not finite: a defect of the controller."""
    return NoTorque(f"u = {u} [N.m]: must be {len(JOINTS)} finite torques, ordered as {JOINTS}")
