"""Look, decide, hold, judge: one run from its start to its outcome."""

from sim.loop.course import Course
from sim.loop.judge import FallCriteria, Judge
from sim.loop.loop import Loop
from sim.loop.outcome import FallReason, Outcome, RunSummary
from sim.loop.tape import EachTick, NoTape, Patient, Progress, Stop, Tape, Tapes
from sim.loop.ticks import Ticks

__all__ = [
    "Course",
    "EachTick",
    "FallCriteria",
    "FallReason",
    "Judge",
    "Loop",
    "NoTape",
    "Outcome",
    "Patient",
    "Progress",
    "RunSummary",
    "Stop",
    "Tape",
    "Tapes",
    "Ticks",
]
