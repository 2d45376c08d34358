"""Look, decide, hold, judge: one run from its start to its outcome."""

from sim.loop.course import Course
from sim.loop.judge import FallCriteria, Judge
from sim.loop.loop import Loop
from sim.loop.outcome import FallReason, Outcome, RunSummary
from sim.loop.tape import NoTape, Progress, Stop, Tape, Tapes

__all__ = [
    "Course",
    "FallCriteria",
    "FallReason",
    "Judge",
    "Loop",
    "NoTape",
    "Outcome",
    "Progress",
    "RunSummary",
    "Stop",
    "Tape",
    "Tapes",
]
