"""From the commanded torque to the one the joints feel: latency, quantisation, motor constant, lag, noise."""

import math
from collections import deque

import numpy as np

from sim.interface import Vector
from sim.scenario import ActuationSettings
from sim.scenario import per_link as tables
from sim.scenario.randomness import Purpose, stream


class Actuation:
    """One set of motors through one run; `apply` is called once a tick."""

    def __init__(self, settings: ActuationSettings, period: float, seed: int) -> None:
        """Before the first command the motors are taken to have held what it asks for.

        Args:
            settings: Their errors.
            period: Control period in [s].
            seed: The scenario's seed.
        """
        self._settings = settings
        self._factor = np.array(tables.values(settings.motor_constant_factor))
        self._noise = stream(seed, Purpose.TORQUE_NOISE)
        self._blend = 1.0 - math.exp(-period / settings.lag) if settings.lag else 1.0
        self._commands: deque[Vector] = deque(maxlen=settings.latency + 1)
        self._torque: Vector | None = None

    def apply(self, command: Vector) -> Vector:
        """The torque to hold, before the plant saturates it.

        Args:
            command: Commanded torque in [N.m], (4,), ordered as `sim.interface.JOINTS`.

        Returns:
            Torque in [N.m], (4,): with a lag, the motors' torque at the end of the tick.
        """
        s = self._settings
        self._commands.append(command.copy())
        u = self._commands[0]
        if s.resolution:
            u = np.round(u / s.resolution) * s.resolution
        u = u * self._factor
        self._torque = u if self._torque is None else self._torque + self._blend * (u - self._torque)
        if s.noise:
            return self._torque + self._noise.normal(0.0, s.noise, 4)
        return self._torque
