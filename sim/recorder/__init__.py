"""MCAP recorder: one log a run, readable by the viewers people have, whatever ended the run."""

from sim.recorder.header import RunHeader
from sim.recorder.recorder import Recorder

__all__ = ["Recorder", "RunHeader"]
