"""From the truth to what the controller is told: biases, noise, quantisation, differences, delays."""

import math
from collections import deque

import numpy as np

from sim.interface import COORDINATES, Observation, Vector
from sim.scenario import SensorSettings
from sim.scenario import per_link as tables
from sim.scenario.randomness import Purpose, stream

_JOINTS = slice(0, 4)
_TORSO = COORDINATES.index("torso")


class Sensors:
    """One set of sensors through one run; `read` is called once a tick."""

    def __init__(self, settings: SensorSettings, period: float, seed: int) -> None:
        """Warm nothing up: before the first tick the sensors are taken to have read what they read at it.

        Args:
            settings: Their errors.
            period: Control period in [s].
            seed: The scenario's seed.
        """
        s = self._settings = settings
        self._period = period
        self._angle_bias = np.array([*tables.values(s.angle_bias), s.torso_bias])  # [rad]
        self._rate_bias = np.array([*tables.values(s.rate_bias), s.torso_rate_bias])  # [rad/s]
        self._angle_noise = stream(seed, Purpose.ANGLE_NOISE)
        self._rate_noise = stream(seed, Purpose.RATE_NOISE)
        self._torso_noise = stream(seed, Purpose.TORSO_NOISE)
        self._torso_rate_noise = stream(seed, Purpose.TORSO_RATE_NOISE)
        self._dropout = stream(seed, Purpose.CONTACT_DROPOUT)
        cutoff = s.rate_cutoff
        self._blend = 1.0 - math.exp(-2.0 * math.pi * cutoff * period) if cutoff else 1.0
        self._past_q: Vector | None = None
        self._past_dq: Vector | None = None
        self._contacts: deque[tuple[bool, bool]] = deque(maxlen=s.contact_delay + 1)
        self._readings: deque[Observation] = deque(maxlen=s.latency + 1)

    def read(self, truth: Observation) -> Observation:
        """What the controller is told at a tick; the time stamp is the tick's, whatever the latency.

        Args:
            truth: What ideal sensors read at it.
        """
        q = self._angles(truth)
        self._readings.append(Observation(t=truth.t, q=q, dq=self._rates(q, truth), contact=self._contact(truth)))
        late = self._readings[0]
        return Observation(t=truth.t, q=late.q, dq=late.dq, contact=late.contact)

    def _angles(self, truth: Observation) -> Vector:
        s = self._settings
        q: Vector = truth.q + self._angle_bias
        q[_TORSO] += s.torso_drift * truth.t
        if s.angle_noise:
            q[_JOINTS] += self._angle_noise.normal(0.0, s.angle_noise, 4)
        if s.torso_noise:
            q[_TORSO] += self._torso_noise.normal(0.0, s.torso_noise)
        if s.angle_resolution:
            q[_JOINTS] = np.round(q[_JOINTS] / s.angle_resolution) * s.angle_resolution
        return q

    def _rates(self, q: Vector, truth: Observation) -> Vector:
        s = self._settings
        if s.rates == "differentiated":
            return self._differences(q, truth)
        dq: Vector = truth.dq + self._rate_bias
        if s.rate_noise:
            dq[_JOINTS] += self._rate_noise.normal(0.0, s.rate_noise, 4)
        if s.torso_rate_noise:
            dq[_TORSO] += self._torso_rate_noise.normal(0.0, s.torso_rate_noise)
        return dq

    def _differences(self, q: Vector, truth: Observation) -> Vector:
        """Filtered backward differences; at the first tick, which has no past, the true rates."""
        if self._past_q is None or self._past_dq is None:
            dq = truth.dq
        else:
            raw = (q - self._past_q) / self._period
            dq = self._past_dq + self._blend * (raw - self._past_dq)
        self._past_q, self._past_dq = q, dq
        return dq

    def _contact(self, truth: Observation) -> tuple[bool, bool]:
        self._contacts.append(truth.contact)
        left, right = self._contacts[0]
        if self._settings.contact_dropout:
            lost = self._dropout.random(2) < self._settings.contact_dropout
            left, right = left and not lost[0], right and not lost[1]
        return bool(left), bool(right)
