"""What a film tells of a run beside its picture: time, step, push, what is near its limit, the fall and its cause."""

from dataclasses import dataclass

import numpy as np

from sim.errors import UserError
from sim.interface import JOINTS
from sim.log.read import Log
from sim.log.read.frames import Run, run_of
from sim.log.tools.text import printable
from sim.loop import Outcome
from sim.review.facts import headline, limit_of_torque, scenario_of
from sim.review.signals import Signals, signals_of
from sim.trials.falls.recorded import recorded_verdict

MOST_BARS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """A moment of a run in words and figures.

    Attributes:
        t: When, in [s]; never after the run's end.
        step: Number of the step, from 1.
        push: External force in [N].
        shares: Name -> how much of its limit is used, 0 to 1 and beyond.
        fall: What broke, from when on it breaks; empty before.
        end: How it ended, from when on it has; empty before.
    """

    t: float
    step: int
    push: float
    shares: dict[str, float]
    fall: str
    end: str


def last_moment(end: float | None, longest: float) -> float:
    """Where a picture of a run ends in [s].

    Args:
        end: Where it was asked to, in [s]; None for the end of the run.
        longest: Where the run ends in [s].

    Raises:
        UserError: it is no time of 0 or above.
    """
    if end is not None and not end >= 0.0:
        raise UserError(f"--end {end:g} s: must be a time of 0 s or above")
    return longest if end is None else min(longest, end)


class Story:
    """One run to be filmed.

    Attributes:
        log: Its log.
        signals: Its signals.
        title: Scenario and controller.
        began: When it began to fall in [s], None where it did not.
    """

    def __init__(self, log: Log) -> None:
        """Args: log: a run, whole or not."""
        run = run_of(log)
        self.log, self.signals = log, signals_of(run)
        about = headline(run)
        self.title = f"{about['name']}, {about['controller']}"
        found = recorded_verdict(run)
        self.began = found[1].began_s if found else None
        self._cause = printable(found[0].value) if found else ""
        fell = run.result.get("outcome") == Outcome.FELL.value
        self._end = "fell" if fell else printable(str(run.result.get("outcome", "the log ends")), 40)
        self._impacts = [event.t for event in run.events if event.name == "impact"]
        self._shares = _shares(run, self.signals)

    @property
    def end(self) -> float:
        """Its last moment in [s]."""
        return float(self.signals.t[-1])

    def at(self, t: float) -> Moment:
        """What there is to tell at a time in [s]."""
        columns, row = self.signals.columns, int(np.clip(np.searchsorted(self.signals.t, t + 1e-9) - 1, 0, None))
        row = min(row, len(self.signals.t) - 1)
        push = np.nan_to_num(np.hypot(columns["push.x"][row], columns["push.z"][row]))
        shares = {name: float(np.nan_to_num(values[row])) for name, values in self._shares.items()}
        return Moment(
            t=min(t, self.end),
            step=1 + sum(impact <= t for impact in self._impacts),
            push=float(push),
            shares=shares,
            fall=self._cause if self.began is not None and t >= self.began else "",
            end=self._end if t > self.end else "",
        )


def _shares(run: Run, signals: Signals) -> dict[str, np.ndarray]:
    """Name -> share of its limit at every tick, (n,)."""
    limits, scenario = limit_of_torque(run), scenario_of(run)
    found = {
        joint.replace("_", " "): np.abs(signals.columns[f"torque.{joint}"]) / limits[joint]
        for joint in JOINTS
        if limits.get(joint)
    }
    if scenario and scenario.plant.ground.friction > 0.0:
        found["friction"] = signals.columns["ratio"] / scenario.plant.ground.friction
    return dict(list(found.items())[:MOST_BARS])
