"""From the commanded torque to the one the joints feel: latency, quantisation, motor constant, lag, noise."""

import math

import numpy as np

from controller.common.held import Held
from sim.interface import STEP, Rows
from sim.plant.instrument_kernels import DRIVING, JOINTS, Driving, drive
from sim.scenario import ActuationSettings
from sim.scenario import per_link as tables
from sim.scenario.randomness import Purpose, stream


class Actuation:
    """One set of motors through one run, whose blocks have all the same number of rows.

    Attributes:
        torque: What they make of the last command, for the plant to saturate and hold; one row of `STEP`.
    """

    def __init__(self, settings: ActuationSettings, period: float, seed: int) -> None:
        """Before the first command the motors are taken to have held what it asks for.

        Args:
            settings: Their errors.
            period: Control period in [s].
            seed: The scenario's seed.
        """
        s = self._settings = settings
        self._work = work = np.zeros(1, DRIVING)
        work["factor"], work["resolution"] = tables.values(s.motor_constant_factor), s.resolution
        work["blend"] = 1.0 - math.exp(-period / s.lag) if s.lag else 1.0
        self._noise = stream(seed, Purpose.TORQUE_NOISE)
        self.torque = np.zeros(1, STEP)
        self._held: Held | None = None

    def held(self, rows: int) -> Held:
        """What `instrument_kernels.drive` works on.

        Args:
            rows: Of a block.
        """
        if self._held is None:
            self._held = Held(
                Driving(
                    work=self._work,
                    noise=np.zeros((rows if self._settings.noise else 0, JOINTS)),
                    waiting=np.zeros((self._settings.latency + 1, JOINTS)),
                    torque=self.torque,
                )
            )
            self._draw()
        return self._held

    def apply(self, step: Rows, i: int) -> None:
        """Make a torque of a command; the rows of a block come in turn.

        Args:
            step: A block of `STEP`.
            i: The row.
        """
        drive(self.held(len(step)), step, i)
        if i == len(step) - 1:
            self._draw()

    def _draw(self) -> None:
        """Draw what is random in the block to come."""
        parts: Driving = self._held.value  # type: ignore[union-attr]
        if self._settings.noise:
            parts.noise[:] = self._noise.normal(0.0, self._settings.noise, parts.noise.shape)
