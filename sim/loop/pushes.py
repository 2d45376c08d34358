"""From the pushes of a scenario to the forces of one hold. Pure functions; the plant applies the result."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from controller.common.compiled import compiled
from sim.interface import AppliedForce
from sim.scenario import Push

CentresOfMass = Mapping[str, tuple[float, float]]
"""Centre of mass (x, z) of each link in its own frame in [m], by link name; a plant offers it as `com`."""


PERIOD = 1e-3  # [s], the usual control period
ROUNDING = 1e-9  # [s], so that a window that begins "at tick 57" does, whatever 57 * 0.001 rounds to


WINDOW = np.dtype(
    [("step", np.int64), ("start", float), ("end", float), ("duration", float), ("impulse", np.int8)], align=True
)
"""When a push acts: in a step, -1 for any, from and to a time in [s], NaN for no limit; an impulse for a while."""


@compiled
def act(windows: Any, t: float, step: int, step_began: float, acting: Any) -> bool:
    """Note which pushes act in the hold that starts now; whether any does.

    Without step and times a push acts throughout the run. A step and a time window together mean both.

    Args:
        windows: When each acts.
        t: Time since the start of the run in [s]; a window is start <= t < end.
        step: Number of the current step; the first is 1.
        step_began: Time at which it began in [s].
        acting: Filled.
    """
    found = False
    for number in range(windows.shape[0]):
        push = windows[number]
        start, end = push.start, push.end
        if push.impulse != 0:
            start = step_began if math.isnan(start) else start
            end = start + push.duration
        acting[number] = (
            (push.step < 0 or step == push.step)
            and not t < start - ROUNDING
            and (math.isnan(end) or t < end - ROUNDING)
        )
        found = found or acting[number]
    return found


class Pushes:
    """The pushes of a run.

    Attributes:
        forces: What each exerts while it acts; without a point it attacks the link's centre of mass.
        acting: Which act in the hold that starts now.
        windows: When each does, rows of `WINDOW`.
    """

    def __init__(self, pushes: Sequence[Push], com: CentresOfMass, period: float = PERIOD) -> None:
        """Work out what does not change.

        Args:
            pushes: Of the scenario.
            com: Centre of mass of each link in its own frame in [m].
            period: Control period in [s], for impulses.
        """
        self.forces = tuple(applied_force(push, com, period) for push in pushes)
        self.acting = np.zeros(len(pushes), dtype=bool)
        nan = math.nan
        self.windows = np.array(
            [
                (
                    -1 if p.step is None else p.step,
                    nan if p.start is None else p.start,
                    nan if p.end is None else p.end,
                    p.duration,
                    p.impulse is not None,
                )
                for p in pushes
            ],
            dtype=WINDOW,
        )

    def look(self, t: float, step: int, step_began: float) -> bool:
        """Find out which act in the hold that starts at t [s], in step number `step` since `step_began` in [s]."""
        found: bool = act(self.windows, t, step, step_began, self.acting)
        return found

    @property
    def applied(self) -> tuple[AppliedForce, ...]:
        """The forces of those that act."""
        return tuple(force for force, acts in zip(self.forces, self.acting, strict=True) if acts)


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
