"""The ground believed in, and when the swing foot lands on it.

A foot measured in the air below the believed ground has not landed: the ground is lower than believed. What a law makes
of that is its own choice, and both choices are here. `crosses` predicts no impact at all: one predicted for the next
stage, tick after tick, would have the MPC lift the foot again. `under_the_foot` lowers the ground until the foot is
just above it, for a law whose horizon is of no use without the impact.
"""

from typing import NamedTuple

from controller.belief.kernels import N_Q, Stage, Walker, swing_foot
from controller.common.compiled import inlined

BELOW = 2e-3  # [m] the ground lies under a foot that should have landed and has not


class Ground(NamedTuple):
    """The ground believed in: a line through height `level` at the stance foot.

    Attributes:
        tangent: Of its slope, uphill positive.
        level: In [m].
    """

    tangent: float
    level: float


LEVEL = Ground(0.0, 0.0)


@inlined
def clearance(walker: Walker, ground: Ground, stage: Stage) -> tuple[float, float, float]:
    """How far ahead the swing foot is in [m], its height above the ground in [m] and the rate of that in [m/s]."""
    ahead, height, rate = swing_foot(walker, stage)
    for i in range(N_Q):
        rate += ground.tangent * walker.reach[i] * stage.cos[i] * stage.dphi[i]
    return ahead, height - ground.tangent * ahead - ground.level, rate


@inlined
def lands(ahead: float, height: float, rate: float) -> bool:
    """Whether x is on S, Eq. (4): the foot is ahead of the stance foot, at or below the ground, and goes down."""
    return ahead > 0.0 and height <= 0.0 and rate < 0.0


@inlined
def crosses(ahead: float, before: float, height: float, rate: float) -> bool:
    """Whether x reaches S from a height `before` above the ground; a foot that was below it does not land."""
    return before > 0.0 and lands(ahead, height, rate)


def under_the_foot(ground: Ground, ahead: float, height: float) -> Ground:
    """The ground, lowered where the swing foot is below it and feels nothing.

    Args:
        ground: As believed.
        ahead: Of the stance foot in [m].
        height: Above the stance foot in [m].
    """
    below = height - ground.tangent * ahead - BELOW
    return Ground(ground.tangent, below if ahead > 0.0 and below < 0.0 else 0.0)
