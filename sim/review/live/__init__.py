"""A run while it goes on, in other programs: another process reads the growing log, the loop never waits."""

from sim.review.live.beside import VIEWERS, live

__all__ = ["VIEWERS", "live"]
