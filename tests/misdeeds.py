"""A controller from outside that misbehaves in some trials, by the number it is given: for the proofs of campaigns.

`PLAN` walks the same trials with it as a clean campaign and as one that has to cope.
"""

import ctypes
import os
import signal
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.belief import StanceEstimator

TICK = 50  # of the misdeed


PLAN = """
seed = 1
controllers = ["{file}:make"]
wall_limit = {limit}
[scenario]
steps = 2
controller.settings.misbehaves = {misbehaves}
[[grid]]
[[grid.axes]]
name = "number"
paths = ["controller.settings.number"]
low = 0
high = {last}
count = {count}
"""


def plan(count: int, misbehaves: bool, limit: float) -> str:
    """A plan of `count` trials, as TOML, with a wall limit in [s]."""
    return PLAN.format(
        file=Path(__file__).resolve(), count=count, last=count - 1, misbehaves=str(misbehaves).lower(), limit=limit
    )


@dataclass(frozen=True)
class Settings:
    """Settings.

    Attributes:
        number: Of the trial.
        misbehaves: Whether it does.
    """

    number: int = 0
    misbehaves: bool = False


def misdeed(number: int) -> str:
    """What the controller does in a trial: of 200, 10 abort, 5 hang, 5 raise, 5 return NaN."""
    if number % 20 == 7:
        return "abort"
    return {11: "hang", 13: "raise", 17: "nan"}.get(number % 40, "")


def check(rows, clean) -> None:
    """Hold the results of a campaign that had to cope against those of a clean one."""
    assert [row.trial for row in rows] == [row.trial for row in clean] == list(range(len(clean)))
    for row, other in zip(rows, clean, strict=True):
        deed = misdeed(row.trial)
        if not deed:
            assert row == other and row.outcome in ("completed", "fell")
        else:
            assert row.outcome == ("gave up" if deed == "hang" else "error") and not row.survived
            words = {"abort": "3 times, the last time by SIGABRT", "hang": "killed after", "raise": "ArithmeticError"}
            assert words.get(deed, "nan") in row.message, row.message


class Odd:
    """PD on the gait's outputs; its stiffness depends on the number, so that no two trials are alike."""

    def __init__(self, model, gait, settings: Settings):
        self.gait, self.stance, self.number = gait, StanceEstimator(model), settings.number
        self.misdeed = misdeed(settings.number) if settings.misbehaves else ""
        self.ticks = 0

    def reset(self, stance):
        self.stance.reset(stance)
        self.ticks = 0

    def step(self, observation):
        self.ticks += 1
        if self.ticks > TICK:
            self._misbehave()
        state = self.stance.update(observation)
        h, slope, _ = self.gait.desired(self.gait.clock @ state.q)
        y, dy = state.q[:4] - h, state.dq[:4] - slope * (self.gait.clock @ state.dq)
        u = -(300.0 + self.number) * y - 20.0 * dy
        return state.leg.from_body(u * np.nan if self.misdeed == "nan" and self.ticks > TICK else u)

    def _misbehave(self):
        if self.misdeed == "abort":
            os.abort()
        if self.misdeed == "raise":
            raise ArithmeticError(f"number {self.number}")
        if self.misdeed == "hang":
            signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
            ctypes.PyDLL(None).pause()  # no other thread of the process, and no handler, ever runs again


make = Odd
