"""How steadily the ground carries a walker: its stance force from tick to tick, and torques after landings."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.loop import NoTape, Ticks


@dataclass(frozen=True, slots=True, kw_only=True)
class Steadiness:
    """Figures of a run.

    Attributes:
        alternation: Mean magnitude of the second difference of the stance foot's normal force from tick to tick in
            [N], impacts left out; 0 for a force that is straight in time, NaN where there is nothing to take it of.
        alternation_rms: Its root mean square in [N].
        landing_torque: Largest torque of any joint soon after a landing in [N.m], NaN without one.
    """

    alternation: float
    alternation_rms: float
    landing_torque: float

    def rows(self, settling: float) -> tuple[tuple[str, str], ...]:
        """The figures in words, name and value; `settling`: time after a landing in [s] that counts as the impact."""
        force = f"{self.alternation:.3f} N mean, {self.alternation_rms:.3f} N RMS"
        torque = f"{self.landing_torque:.1f} N.m within {1e3 * settling:.0f} ms"
        return (
            ("stance force, second difference", force if math.isfinite(self.alternation) else "-"),
            ("peak torque after landings", torque if math.isfinite(self.landing_torque) else "-"),
        )


class Steady(NoTape):
    """Listens to a run."""

    def __init__(self, settling: int) -> None:
        """Args: settling: ticks after a landing whose forces are those of the impact."""
        self._settling = settling
        self._stance = 0  # row of the foot that stands; runs start on the left
        self._parts: list[NDArray[np.float64]] = []  # force in [N], stance, torque in [N.m]
        self._landings = [0]  # ticks; the start counts as one, but for its torque

    def ticks(self, ticks: Ticks) -> None:
        """Take in some."""
        state = ticks.state
        force, torque = state["contact_force"][:, self._stance, 1], np.abs(state["torque"]).max(axis=1)
        self._parts.append(np.column_stack((force, np.full(len(force), self._stance), torque)))

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Note a landing."""
        if name == "impact":
            self._stance = 1 - self._stance
            self._landings.append(k)

    def found(self) -> Steadiness:
        """The figures so far."""
        rows = np.concatenate(self._parts) if self._parts else np.empty((0, 3))
        force, stance, torque = rows.T
        k = np.arange(len(rows))
        last = np.array(self._landings)[np.searchsorted(self._landings, k, side="right") - 1]
        settled = k - last > self._settling
        calm = settled[:-2] & settled[2:] & (stance[:-2] == stance[2:])
        bends = np.diff(force, 2)[calm]
        after = torque[~settled & (last > 0)]
        return Steadiness(
            alternation=float(np.abs(bends).mean()) if len(bends) else float("nan"),
            alternation_rms=float(np.sqrt(np.square(bends).mean())) if len(bends) else float("nan"),
            landing_torque=float(after.max()) if len(after) else float("nan"),
        )
