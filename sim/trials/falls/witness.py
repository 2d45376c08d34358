"""A witness of a run: remembers its end, and says what broke in it and how near it came to a stop."""

import math
from collections.abc import Mapping

import numpy as np

from sim.interface import JOINTS, Vector
from sim.loop import NoTape, Ticks
from sim.plant import Energy
from sim.trials.falls.cause import Cause, Evidence, sentence
from sim.trials.falls.fading import Steps
from sim.trials.falls.verdict import SUNK, WIDTH, verdict

KEPT = 4.0  # [s] of a run that are looked at, from its end back; longer than the time after which a run is stalled
FORESEEN = 0.012  # [s] ahead, from where on a predicted landing counts as a promise


class Witness(NoTape):
    """Remembers the end of a run, and says what broke in it."""

    def __init__(self, period: float) -> None:
        """Args: period: of the ticks in [s]."""
        self._period = period
        self._ring = np.empty((round(KEPT / period), WIDTH))  # states themselves would keep all their arrays alive
        self._ticks = 0
        self._stance = 0  # row of the foot that stands, as the judge of the run sees it
        self._landed = 0.0  # [s]
        self._due = math.inf  # [s], when the swing foot should land
        self._t = 0.0  # [s]
        self._s = self._landed_s = 1.0
        self._sunk = 0.0  # [m]
        self._steps = Steps()

    def ticks(self, ticks: Ticks) -> None:
        """Remember some."""
        state, step, n = ticks.state, ticks.step, len(ticks)
        if ticks.first == 0:
            self._sunk = -float(state["clearance"][0].min())
        t, ahead = state["t"], step["impact_in"] * self._period
        due = np.full(n, self._due)
        if self._due == math.inf and len(foreseen := np.flatnonzero((ahead >= 0.0) & (ahead <= FORESEEN))):
            self._due = due[foreseen[0] :] = t[foreseen[0]] + ahead[foreseen[0]]
        touches = (state["contact"] != 0) | (state["clearance"] < -SUNK)  # rigid ground feels its stance foot alone
        rows = np.empty((n, WIDTH))  # columns as `verdict` takes them
        rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3] = t, self._stance, self._landed, due
        rows[:, 4], rows[:, 5], rows[:, 6] = step["s"], step["dtheta"], step["fallback"]
        rows[:, 7:9], rows[:, 9] = touches, state["foot"][:, self._stance, 0]
        rows[:, 10:14], rows[:, 14:18], rows[:, 18:22] = state["torque"], step["y"], step["u_total"]
        rows[:, 22:27], rows[:, 27:32] = state["dq"], ticks.seen["q"] - state["q"]
        rows[:, 32] = self._landed_s
        self._ring[(self._ticks + np.arange(n)) % len(self._ring)] = rows
        self._ticks += n
        self._t, self._s = float(t[-1]), float(step["s"][-1])
        self._steps.take(state)

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Follow the stance foot from landing to landing."""
        if name == "impact":
            self._steps.land(self._stance)
            self._stance = 1 - self._stance
            self._landed, self._due, self._landed_s = self._t + self._period, math.inf, self._s

    def fading(self, energy: Energy) -> bool:
        """Whether the walk loses energy step by step and would stop (`Steps.fading`)."""
        return self._steps.fading(energy)

    @property
    def least_speed(self) -> float:
        """Least forward speed of the hip in [m/s], infinite before the first tick: how near the walk came to a stop."""
        return self._steps.least_speed

    def verdict(self, limits: Vector) -> tuple[Cause, Evidence]:
        """What broke, in a run that fell.

        Args:
            limits: Largest torques of the joints in [N.m], (4,), ordered as `JOINTS`; infinite where there are none.
        """
        first = self._ticks % len(self._ring) if self._ticks > len(self._ring) else 0
        rows = np.roll(self._ring[: self._ticks], -first, axis=0)
        return verdict(rows, self._sunk, self._period, limits)

    def story(self, limits: Mapping[str, float]) -> str:
        """The verdict in a sentence.

        Args:
            limits: Largest torque in [N.m] by joint.
        """
        return sentence(*self.verdict(np.array([limits.get(joint, math.inf) for joint in JOINTS])))
