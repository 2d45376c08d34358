"""From an MCAP file to arrays, sound or damaged."""

from sim.log.read.reader import Log, read_log, salvage

__all__ = [
    "Log",
    "read_log",
    "salvage",
]
