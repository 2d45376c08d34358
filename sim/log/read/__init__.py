"""From an MCAP file to arrays, sound or damaged."""

from sim.log.read.frames import Event, Frame, Run, load, run_of
from sim.log.read.log import Log
from sim.log.read.reader import read_log, salvage

__all__ = [
    "Event",
    "Frame",
    "Log",
    "Run",
    "load",
    "read_log",
    "run_of",
    "salvage",
]
