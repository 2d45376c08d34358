"""A plant seen through sensors and moved by motors that err: a `Plant` around a `Plant`."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.interface import STEP, AppliedForce, Plant, Rows, Vector, observation_of
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
        self._held = np.zeros(1, STEP)
        self.com, self.torque_limits = plant.com, plant.torque_limits

    def reset(self, q: Vector, dq: Vector, stance: str) -> None:
        """Put the walker on its stance foot; see `Plant.reset`. Sensors and motors must be new."""
        self._plant.reset(q, dq, stance)

    def load(self, forces: Sequence[AppliedForce]) -> None:
        """Name the external forces that may act; see `Plant.load`."""
        self._plant.load(forces)

    def look(self, state: Rows, seen: Rows, i: int) -> None:
        """The truth now, and what the sensors tell of it; to be called once a tick."""
        self._plant.look(state, seen, i)
        row = seen[i]
        told = self._sensors.read(observation_of(row))
        row["q"], row["dq"], row["contact"] = told.q, told.dq, told.contact

    def move(self, step: Rows, i: int, acting: NDArray[np.bool_]) -> None:
        """Hold what the motors make of the torque commanded in row `i`; see `Plant.move`."""
        self._held["u_total"][0] = self._actuation.apply(step["u_total"][i])
        self._plant.move(self._held, 0, acting)
