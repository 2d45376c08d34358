"""From the pushes of a scenario to the forces of one hold. Pure functions; the plant applies the result."""

import math
from collections.abc import Mapping, Sequence

from sim.interface import AppliedForce
from sim.scenario import Push

CentresOfMass = Mapping[str, tuple[float, float]]
"""Centre of mass (x, z) of each link in its own frame in [m], by link name; a plant offers it as `com`."""


PERIOD = 1e-3  # [s], the usual control period
ROUNDING = 1e-9  # [s], so that a window that begins "at tick 57" does, whatever 57 * 0.001 rounds to


def is_active(push: Push, t: float, step: int, step_began: float = 0.0) -> bool:
    """Whether a push acts in the hold that starts now.

    Without step and times a push acts throughout the run. A step and a time window together mean both.

    Args:
        push: The push.
        t: Time since the start of the run in [s]; the window is start <= t < end.
        step: Number of the current step; the first is 1.
        step_began: Time at which it began in [s].
    """
    if push.step is not None and step != push.step:
        return False
    start, end = push.start, push.end
    if push.impulse is not None:
        start = push.start if push.start is not None else step_began
        end = start + push.duration
    if start is not None and t < start - ROUNDING:
        return False
    return end is None or t < end - ROUNDING


def magnitude(push: Push, period: float) -> float:
    """Force of a push in [N] while it acts.

    Args:
        push: The push.
        period: Control period in [s]; an impulse acts for a whole number of them, and is delivered whole.
    """
    if push.impulse is None:
        return push.force or 0.0
    ticks = max(1, math.ceil((push.duration - ROUNDING) / period))
    return push.impulse / (ticks * period)


def applied_force(push: Push, com: CentresOfMass, period: float = PERIOD) -> AppliedForce:
    """The force a push exerts while it acts; without a point it attacks the link's centre of mass."""
    force = magnitude(push, period)
    return AppliedForce(
        body=push.body,
        point=com[push.body] if push.point is None else push.point,
        force=(force * math.cos(push.direction), force * math.sin(push.direction)),  # [N]
    )


def active_forces(
    pushes: Sequence[Push],
    t: float,
    step: int,
    com: CentresOfMass,
    *,
    step_began: float = 0.0,
    period: float = PERIOD,
) -> tuple[AppliedForce, ...]:
    """Forces that act in the hold that starts now.

    Args:
        pushes: Pushes of the scenario.
        t: Time since the start of the run in [s].
        step: Number of the current step; the first is 1.
        com: Centre of mass of each link in its own frame in [m].
        step_began: Time at which the current step began in [s], for impulses by step.
        period: Control period in [s], for impulses.
    """
    return tuple(applied_force(push, com, period) for push in pushes if is_active(push, t, step, step_began))
