"""From the pushes of a scenario to the forces of one hold. Pure functions; the plant applies the result."""

import math
from collections.abc import Mapping, Sequence

from sim.interface import AppliedForce
from sim.scenario import Push

CentresOfMass = Mapping[str, tuple[float, float]]
"""Centre of mass (x, z) of each link in its own frame in [m], by link name; a plant offers it as `com`."""


ROUNDING = 1e-9  # [s], so that a window that begins "at tick 57" does, whatever 57 * 0.001 rounds to


def is_active(push: Push, t: float, step: int) -> bool:
    """Whether a push acts in the hold that starts now.

    Without step and times a push acts throughout the run. A step and a time window together mean both.

    Args:
        push: The push.
        t: Time since the start of the run in [s]; the window is start <= t < end.
        step: Number of the current step; the first is 1.
    """
    if push.step is not None and step != push.step:
        return False
    if push.start is not None and t < push.start - ROUNDING:
        return False
    return push.end is None or t < push.end - ROUNDING


def applied_force(push: Push, com: CentresOfMass) -> AppliedForce:
    """The force a push exerts while it acts; without a point it attacks the link's centre of mass."""
    return AppliedForce(
        body=push.body,
        point=com[push.body] if push.point is None else push.point,
        force=(push.force * math.cos(push.direction), push.force * math.sin(push.direction)),  # [N]
    )


def active_forces(pushes: Sequence[Push], t: float, step: int, com: CentresOfMass) -> tuple[AppliedForce, ...]:
    """Forces that act in the hold that starts now.

    Args:
        pushes: Pushes of the scenario.
        t: Time since the start of the run in [s].
        step: Number of the current step; the first is 1.
        com: Centre of mass of each link in its own frame in [m].
    """
    return tuple(applied_force(push, com) for push in pushes if is_active(push, t, step))
