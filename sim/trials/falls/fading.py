"""Whether a walk that has not fallen loses energy step by step, so that it would stop if it went on."""

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise

from sim.interface import Rows, Vector
from sim.plant import Energy

FADES = 3  # steps in a row that lose energy


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Step:
    """A step: where it was slowest and just before it landed, rows of `STATE`, and its stance foot's height in [m]."""

    slowest: Rows
    last: Rows
    height: float


class Steps:
    """The last steps of a run."""

    def __init__(self) -> None:
        """Start empty."""
        self._steps: deque[_Step] = deque(maxlen=FADES + 1)
        self._last: Rows | None = None
        self._slowest: Rows | None = None
        self.least_speed = math.inf
        """Least forward speed of the hip so far in [m/s]; a walker about to stop, or to fall back, nears 0."""

    def take(self, state: Rows) -> None:
        """Take in states of the step that is under way, rows of `STATE`."""
        self._last = state[-1:].copy()
        slowest = int(state["dhip"][:, 0].argmin())
        self.least_speed = min(self.least_speed, float(state["dhip"][slowest, 0]))
        if self._slowest is None or state["dhip"][slowest, 0] < self._slowest["dhip"][0, 0]:
            self._slowest = state[slowest : slowest + 1].copy()

    def land(self, stance: int) -> None:
        """The step is over; `stance`: row of the foot that stood."""
        if self._last is not None and self._slowest is not None:
            height = float(self._last["foot"][0, stance, 1])
            self._steps.append(_Step(slowest=self._slowest, last=self._last, height=height))
            self._slowest = None

    def fading(self, energy: Energy) -> bool:
        """Whether the walk loses energy step by step, so that it would stop if it went on.

        The energy before each landing, heights counted from the stance foot, is lower than before the landing before;
        and what is left of the motion where a step is slowest, followed on as a geometric series, runs out.

        Args:
            energy: By the plant's model.
        """
        if len(self._steps) <= FADES:
            return False
        before = [energy.about(*_state(step.last), step.height) for step in self._steps]
        left = [energy.kinetic(*_state(step.slowest)) for step in list(self._steps)[-3:]]
        return all(b < a for a, b in pairwise(before)) and _limit(*left) <= 0.0


def _state(row: Rows) -> tuple[Vector, Vector, Vector, Vector]:
    return row["q"][0], row["dq"][0], row["hip"][0], row["dhip"][0]


def _limit(a: float, b: float, c: float) -> float:
    """Where a series goes of which these are three consecutive values, if it is a geometric one (Aitken)."""
    if a == b:
        return c
    ratio = (c - b) / (b - a)
    return math.copysign(math.inf, c - b) if ratio >= 1.0 else c + (c - b) * ratio / (1.0 - ratio)
