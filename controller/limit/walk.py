"""A walk at the points of its phases, its structure, and what it must keep."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from controller.common.records import Vector

N_P = 19  # numbers of a point: angles, rates, accelerations, torques
P, W, A, U = slice(0, 5), slice(5, 10), slice(10, 15), slice(15, 19)
Kind = Literal["push", "slope", "ledge", "load", "friction"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bounds:
    """What a walk must keep.

    Attributes:
        torque: Limits in [N.m], (4,).
        friction: Coefficient of friction between foot and ground.
        normal_min: Least normal force of the stance foot in [N].
        clearance: Of the swing foot in the middle of a step in [m], a parabola over the step's time.
        torso: Largest angle of the torso from the vertical in [rad].
        hip: Least height of the hip above the stance foot in [m].
        length: Shortest and longest step in [m].
        time: Shortest and longest step in [s].
        knee: Sign of a bent knee's angle.
    """

    torque: Vector
    friction: float = 0.8
    normal_min: float = 10.0
    clearance: float = 0.01
    torso: float = 1.0
    hip: float = 0.5
    length: tuple[float, float] = (0.1, 0.7)
    time: tuple[float, float] = (0.15, 1.0)
    knee: float = -1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A stretch of the walk.

    Attributes:
        intervals: Of the collocation.
        pushed: Whether the push acts in it.
        lands: Whether it ends with a landing; it goes on into the next phase otherwise.
    """

    intervals: int
    pushed: bool = False
    lands: bool = True

    @property
    def points(self) -> int:
        """Ends and middles of its intervals."""
        return 2 * self.intervals + 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """A walk at the points of its phases; the guess of a program, or its answer.

    Attributes:
        points: Of each phase, (19, points): link angles, rates, accelerations, joint torques.
        times: Duration of each phase in [s].
        disturbance: What is maximised, in its own unit.
        edge: Where the ledge is in [m] from the first foothold.
    """

    points: tuple[Vector, ...]
    times: tuple[float, ...]
    disturbance: float = 0.0
    edge: float = 0.2

    def vector(self) -> Vector:
        """As the program has it."""
        flat = [np.append(z.ravel(order="F"), t) for z, t in zip(self.points, self.times, strict=True)]
        return np.concatenate((*flat, [self.disturbance, self.edge]))

    @classmethod
    def of(cls, x: Vector, phases: tuple[Phase, ...]) -> "Motion":
        """From the program's variables."""
        points, times, at = [], [], 0
        for phase in phases:
            n = N_P * phase.points
            points.append(x[at : at + n].reshape(N_P, phase.points, order="F").copy())
            times.append(float(x[at + n]))
            at += n + 1
        return cls(points=tuple(points), times=tuple(times), disturbance=float(x[at]), edge=float(x[at + 1]))


def state_at(motion: Motion, phases: tuple[Phase, ...], t: float) -> tuple[Vector, Vector, Vector, int]:
    """The walk at a time in [s], by the collocation's own polynomials; its last state beyond its end.

    Returns:
        Link angles in [rad] and rates in [rad/s], (5,), joint torques in [N.m], (4,), stance order; steps done.
    """
    steps, began = 0, 0.0
    for z, phase, duration in zip(motion.points, phases, motion.times, strict=True):
        last = z is motion.points[-1]
        if t < began + duration or last:
            share = min(max((t - began) / duration, 0.0), 1.0)
            k = min(int(share * phase.intervals), phase.intervals - 1)
            tau = share * phase.intervals - k
            three = z[:, 2 * k : 2 * k + 3]
            weights = np.array([(1 - tau) * (1 - 2 * tau), 4 * tau * (1 - tau), tau * (2 * tau - 1)])
            u = three[15:] @ weights
            h = duration / phase.intervals
            w = three[5:10, 0] + h * tau * (three[10:15] @ _integral(tau))
            p = three[:5, 0] + h * tau * (three[5:10] @ _integral(tau))
            return p, w, u, steps
        began += duration
        steps += phase.lands
    raise AssertionError("unreachable")


def _integral(tau: float) -> Vector:
    """Weights of the mean of a parabola from 0 to tau, by its values at 0, 1/2 and 1."""
    return np.array([1 - 1.5 * tau + 2 * tau * tau / 3, 2 * tau - 4 * tau * tau / 3, -0.5 * tau + 2 * tau * tau / 3])
