"""From a log to pictures and pages, and back to a run."""

from sim.log.read.frames import Event, Frame, Run, load

__all__ = ["Event", "Frame", "Run", "load"]
