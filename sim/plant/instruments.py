"""A plant seen through sensors and moved by motors that err: a `Plant` around a `Plant`."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.common.entry import Bound, bind
from controller.common.held import Held
from sim.interface import AppliedForce, Plant, Rows, Vector
from sim.plant import instrument_kernels as kernels
from sim.plant.actuation import Actuation
from sim.plant.sensors import Sensors


class InstrumentedPlant:
    """Implements `sim.interface.Plant`: the truth stays the plant's, what is seen and what is done err.

    The log has both sides: commanded and applied torque, observed and true state.
    """

    def __init__(self, plant: Plant, sensors: Sensors, actuation: Actuation) -> None:
        """Put new sensors and motors on a plant.

        Args:
            plant: The truth.
            sensors: Between it and the controller's eyes.
            actuation: Between the controller's command and its joints.
        """
        self._plant, self._sensors, self._actuation = plant, sensors, actuation
        self.com, self.torque_limits = plant.com, plant.torque_limits

    def reset(self, q: Vector, dq: Vector, stance: str) -> None:
        """Put the walker on its stance foot; see `Plant.reset`. Sensors and motors must be new."""
        self._plant.reset(q, dq, stance)

    def load(self, forces: Sequence[AppliedForce]) -> None:
        """Name the external forces that may act; see `Plant.load`."""
        self._plant.load(forces)

    @property
    def forces(self) -> Rows:
        """The forces loaded, of a plant whose ticks are compiled."""
        plant: Any = self._plant
        rows: Rows = plant.forces
        return rows

    def look(self, state: Rows, seen: Rows, i: int) -> None:
        """The truth now, and what the sensors tell of it; to be called once a tick."""
        self._plant.look(state, seen, i)
        self._sensors.read(seen, i)

    def move(self, step: Rows, i: int, acting: NDArray[np.bool_]) -> None:
        """Hold what the motors make of the torque commanded in row `i`; see `Plant.move`."""
        self._actuation.apply(step, i)
        self._plant.move(self._actuation.torque, 0, acting)

    def heed(self, end: int, step: Rows, i: int) -> None:
        """Take note of a hold; see `sim.loop.ride`."""
        plant: Any = self._plant
        plant.heed(end, self._actuation.torque, 0)

    def bound(self, state: Rows, seen: Rows, step: Rows, acting: NDArray[np.bool_]) -> tuple[Bound, Bound] | None:
        """The kernels of `look` and `move` for `sim.loop.ride`, if the plant inside has its own."""
        inside = getattr(self._plant, "bound", None)
        ways = inside(state, seen, self._actuation.torque, acting) if inside else None
        if ways is None:
            return None
        sensing, driving = self._sensors.held(len(seen)), self._actuation.held(len(step))
        look, move = (
            Held(kernels.Around(plant=way, instrument=instrument))
            for way, instrument in zip(ways, (sensing, driving), strict=True)
        )
        own = bind(kernels.look, (look,), (state, seen, 0))
        return own, bind(kernels.move, (move,), (step, 0, self.forces, acting))
