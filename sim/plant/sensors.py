"""From the truth to what the controller is told: biases, noise, quantisation, differences, delays."""

import math

import numpy as np

from controller.common.held import Held
from sim.interface import OBSERVATION, Rows
from sim.plant.instrument_kernels import SENSING, Sensing, sense
from sim.scenario import SensorSettings
from sim.scenario import per_link as tables
from sim.scenario.randomness import Purpose, stream

_ANGLES, _TORSO, _RATES, _TORSO_RATE = slice(0, 4), slice(4, 5), slice(5, 9), slice(9, 10)
"""Columns of the noise."""


class Sensors:
    """One set of sensors through one run, whose blocks have all the same number of rows."""

    def __init__(self, settings: SensorSettings, period: float, seed: int) -> None:
        """Warm nothing up: before the first tick the sensors are taken to have read what they read at it.

        Args:
            settings: Their errors.
            period: Control period in [s].
            seed: The scenario's seed.
        """
        s = self._settings = settings
        self._work = work = np.zeros(1, SENSING)
        work["angle_bias"] = [*tables.values(s.angle_bias), s.torso_bias]
        work["rate_bias"] = [*tables.values(s.rate_bias), s.torso_rate_bias]
        work["drift"], work["resolution"], work["dropout"] = s.torso_drift, s.angle_resolution, s.contact_dropout
        work["differentiated"], work["period"] = s.rates == "differentiated", period
        work["blend"] = 1.0 - math.exp(-2.0 * math.pi * s.rate_cutoff * period) if s.rate_cutoff else 1.0
        self._noises = [
            (columns, deviation, stream(seed, purpose))
            for columns, deviation, purpose in (
                (_ANGLES, s.angle_noise, Purpose.ANGLE_NOISE),
                (_TORSO, s.torso_noise, Purpose.TORSO_NOISE),
                (_RATES, s.rate_noise, Purpose.RATE_NOISE),
                (_TORSO_RATE, s.torso_rate_noise, Purpose.TORSO_RATE_NOISE),
            )
            if deviation
        ]
        self._dropout = stream(seed, Purpose.CONTACT_DROPOUT)
        self._held: Held | None = None

    def held(self, rows: int) -> Held:
        """What `instrument_kernels.sense` works on.

        Args:
            rows: Of a block.
        """
        if self._held is None:
            noisy = np.zeros(10, dtype=np.bool_)
            for columns, _, _ in self._noises:
                noisy[columns] = True
            self._held = Held(
                Sensing(
                    work=self._work,
                    noise=np.zeros((rows, 10)),
                    noisy=noisy,
                    chances=np.zeros((rows if self._settings.contact_dropout else 0, 2)),
                    flags=np.zeros((self._settings.contact_delay + 1, 2), dtype=np.int8),
                    readings=np.zeros(self._settings.latency + 1, OBSERVATION),
                )
            )
            self._draw()
        return self._held

    def read(self, seen: Rows, i: int) -> None:
        """Make of what ideal sensors read what the controller is told; the rows of a block come in turn.

        Args:
            seen: A block of `OBSERVATION`.
            i: The row.
        """
        sense(self.held(len(seen)), seen, i)
        if i == len(seen) - 1:
            self._draw()

    def _draw(self) -> None:
        """Draw what is random in the block to come."""
        parts: Sensing = self._held.value  # type: ignore[union-attr]
        for columns, deviation, numbers in self._noises:
            room = parts.noise[:, columns]
            room[:] = numbers.normal(0.0, deviation, room.shape)
        parts.chances[:] = self._dropout.random(parts.chances.shape)
