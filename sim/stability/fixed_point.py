"""The periodic state of a gait: a fixed point of its step map, or the mean of a walk that stays beside one."""

from dataclasses import dataclass

import numpy as np

from sim.interface import Vector
from sim.stability.sections import Surface
from sim.stability.step_map import (
    Fell,
    StepMap,
    distance,
    expand,
    jacobian,
    reduce,
    scaled,
)

SETTLED = 1e-6  # [rad] change of a step at which Newton takes over
TOLERANCE = 1e-10  # [rad] residual that Newton is to reach
PERTURBED = 1e-3  # [rad] by Newton's Jacobian
PATIENCE = 10  # steps without a smaller change after which walking brings nothing more
SHARP = 1e-4  # [rad] largest residual of a fixed point proper
BOUNDED = 3e-2
"""[rad] Scatter about their mean within which states of a walk count as one periodic state: the largest perturbation
of the step-size study. A map that jumps has no fixed point to more digits than its jumps, and walking on it hops
about for ever; the noise floor of the study says what the eigenvalues are then worth."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FixedPoint:
    """What the search for a periodic state found.

    Attributes:
        x: The last state, (10,), in stance order.
        residual: Norm of P(x) - x, angles in [rad] and rates in [rad/s] / `RATE_SCALE`.
        scatter: RMS distance of the last steps of walking from their mean, same norm; NaN if it fell.
        iterations: Steps of settling, then of Newton.
        converged: Whether the residual is below `SHARP`, or the walk stays bounded and `x` is its mean.
        message: Why it did not converge, empty otherwise.
    """

    x: Vector
    residual: float
    scatter: float
    iterations: tuple[int, int]
    converged: bool
    message: str


def find_fixed_point(
    P: StepMap,
    surface: Surface,
    start: Vector,
    *,
    settling: int = 40,
    newton: int = 8,
) -> FixedPoint:
    """A periodic state: walk until it changes little, then Newton's method on P(x) - x.

    Newton also finds unstable periodic states, from which walking leads away.

    Args:
        P: The step map.
        surface: S.
        start: First guess, (10,); it is projected onto S.
        settling: Most steps to walk.
        newton: Most Newton steps.
    """
    x = surface.project(start)
    walked, since, steps, message = 0, 0, 0, ""
    best, least = x, np.inf
    visited: list[Vector] = []
    try:
        for walked in range(1, settling + 1):
            following = P(x)
            residual = distance(following, x)
            if residual < least:
                best, least, since = x, residual, walked
            x = surface.project(following)
            visited.append(x)
            if residual < SETTLED or walked - since >= PATIENCE:
                break
    except Fell as fall:
        message, visited = f"falls in step {walked}: {fall}", []
    last = np.array(visited[-PATIENCE:]).reshape(-1, 10)
    x, before = best, np.inf
    try:
        for steps in range(newton + 1):
            following = P(x)
            residual = distance(following, x)
            if residual < least or steps == 0:
                best, least = x, residual
            if residual < TOLERANCE or residual > 0.5 * before or steps == newton:
                break  # found, or as good as the map's jumps allow
            before = residual
            V = surface.basis(x)
            A: Vector = jacobian(P, surface, x, PERTURBED) - np.eye(9)
            move = -np.asarray(np.linalg.solve(A, reduce(V, following - x)), dtype=np.float64)
            x = surface.project(x + expand(V, move))
    except (Fell, np.linalg.LinAlgError) as error:
        message = message or f"Newton's method leaves the walkable states: {error}"
    scatter = float(np.linalg.norm(scaled(last).std(axis=0))) if len(last) else float("nan")
    sharp = least < SHARP
    if not sharp and scatter < BOUNDED:
        best = surface.project(last.mean(axis=0))
        least = distance(P(best), best)
    converged = sharp or scatter < BOUNDED
    if not converged and not message:
        message = f"residual {least:.1e} rad after {steps} Newton steps"
    return FixedPoint(
        x=best,
        residual=least,
        scatter=scatter,
        iterations=(walked, steps),
        converged=converged,
        message="" if converged else message,
    )
