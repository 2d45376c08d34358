"""Everything random in a run comes from the scenario's seed, one independent stream for each purpose.

A stream is found by key, not by order of drawing, so switching one source of noise on leaves the others as
they were.
"""

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """Spawn keys of the streams. Numbers are part of what a seed means: append, never reorder."""

    TERRAIN = 0
    ANGLE_NOISE = 1
    RATE_NOISE = 2
    TORSO_NOISE = 3
    TORSO_RATE_NOISE = 4
    CONTACT_DROPOUT = 5
    TORQUE_NOISE = 6


def stream(seed: int, purpose: Purpose) -> np.random.Generator:
    """The generator of one purpose.

    Args:
        seed: The scenario's seed.
        purpose: What the numbers are for.
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(int(purpose),)))
