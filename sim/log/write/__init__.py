"""MCAP recorder: one log a run, readable by the viewers people have, whatever ended the run."""

from sim.log.write.header import RunHeader
from sim.log.write.recorder import Recorder

__all__ = ["Recorder", "RunHeader"]
