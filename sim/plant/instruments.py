"""A plant seen through sensors and moved by motors that err: a `Plant` around a `Plant`."""

from collections.abc import Sequence

from sim.interface import AppliedForce, Observation, Plant, PlantState, Vector
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

    def observe(self) -> Observation:
        """What the sensors tell now; to be called once a tick."""
        return self._sensors.read(self._plant.observe())

    def state(self) -> PlantState:
        """The truth now."""
        return self._plant.state()

    def hold(self, u: Vector, forces: Sequence[AppliedForce] = ()) -> None:
        """Hold what the motors make of a commanded torque in [N.m], (4,); see `Plant.hold`."""
        self._plant.hold(self._actuation.apply(u), forces)
