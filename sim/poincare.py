"""Stability of a gait: fixed point and Jacobian of the step-to-step map on the switching surface.

The map P takes the state just before an impact to the state just before the next one. The controller's tick grid
starts anew at each impact: P then has no memory of the phase of the ticks, and on the rigid plant it is smooth.
A free walk keeps its grid, so its section states scatter; that scatter is measured and reported beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interface import Vector
from sim.sections import Surface

RATE_SCALE = 4.0
"""[1/s] A perturbation of h rad in an angle goes with one of 4 h rad/s in a rate; sqrt(g / leg) is 3.5 1/s."""

STEP_SIZES = (3e-2, 2e-2, 1e-2, 5e-3, 3e-3, 1e-3, 3e-4, 1e-4)
"""[rad] of the step-size study."""

PROBE = 1e-4  # [rad] perturbation at which the roughness of the map is measured
PROBES = 10
SETTLED = 1e-6  # [rad] change of a step at which Newton takes over
PATIENCE = 10  # steps without a smaller change after which walking brings nothing more
SHARP = 1e-4  # [rad] largest residual of a fixed point proper
BOUNDED = 0.05
"""[rad] Scatter about their mean within which states of a walk count as one periodic state. A map that jumps has no
fixed point to more digits than its jumps, and walking on it hops about for ever; perturbations of 1e-2 rad and more
average over the jumps."""

StepMap = Callable[[Vector], Vector]
"""Section state (10,) in stance order to the next one; raises `Fell` where there is none."""


class Fell(RuntimeError):
    """The walker does not reach the next impact from this state."""


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepSizeRow:
    """One row of the step-size study.

    Attributes:
        h: Perturbation in [rad].
        largest: Largest magnitude of an eigenvalue; None where a perturbed walker falls.
    """

    h: float
    largest: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stability:
    """Linearised stability of a fixed point.

    Attributes:
        eigenvalues: Of the Jacobian on S, largest magnitude first, (9,).
        h: Perturbation it was taken with in [rad]: the middle of the flattest stretch of the study.
        spread: Largest difference of the largest magnitude to its two neighbours in the study.
        study: Every step size tried.
        roughness: The most that the map does beside its Jacobian under small random perturbations, same norm
            as the residual. A controller that predicts impacts at whole ticks makes the map jump by about this.
    """

    eigenvalues: NDArray[np.complex128]
    h: float
    spread: float
    study: tuple[StepSizeRow, ...]
    roughness: float

    @property
    def largest(self) -> float:
        """Largest magnitude of an eigenvalue."""
        return float(np.abs(self.eigenvalues[0]))


def scaled(x: Vector) -> Vector:
    """States or differences of states (..., 10) with rates in units of `RATE_SCALE`."""
    return np.concatenate((x[..., :5], x[..., 5:] / RATE_SCALE), axis=-1)


def distance(a: Vector, b: Vector) -> float:
    """Norm of a difference of states in [rad], rates in units of `RATE_SCALE`."""
    return float(np.linalg.norm(scaled(a - b)))


def find_fixed_point(
    P: StepMap,
    surface: Surface,
    start: Vector,
    *,
    tolerance: float = 1e-10,
    settling: int = 40,
    newton: int = 8,
    h: float = 1e-3,
) -> FixedPoint:
    """A periodic state: walk until it changes little, then Newton's method on P(x) - x.

    Newton also finds unstable periodic states, from which walking leads away.

    Args:
        P: The step map.
        surface: S.
        start: First guess, (10,); it is projected onto S.
        tolerance: Residual to reach in [rad].
        settling: Most steps to walk.
        newton: Most Newton steps.
        h: Perturbation of Newton's Jacobian in [rad].
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
            if residual < tolerance or residual > 0.5 * before or steps == newton:
                break  # found, or as good as the map's jumps allow
            before = residual
            V = surface.basis(x)
            A: Vector = jacobian(P, surface, x, h) - np.eye(9)
            move = -np.asarray(np.linalg.solve(A, _reduce(V, following - x)), dtype=np.float64)
            x = surface.project(x + _expand(V, move))
    except (Fell, np.linalg.LinAlgError) as error:
        message = message or f"Newton's method leaves the walkable states: {error}"
    scatter = float(np.linalg.norm(scaled(last).std(axis=0))) if len(last) else float("nan")
    sharp = least < max(tolerance, SHARP)
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


def jacobian(P: StepMap, surface: Surface, x: Vector, h: float) -> Vector:
    """Jacobian of P along S by central differences, (9, 9), in scaled coordinates of `Surface.basis`.

    Args:
        P: The step map.
        surface: S.
        x: Where, (10,), on S.
        h: Perturbation in [rad].

    Raises:
        Fell: a perturbed walker falls.
    """
    V = surface.basis(x)
    J = np.empty((9, 9))
    for column in range(9):
        move = np.zeros(9)
        move[column] = h
        ahead, behind = (P(surface.project(x + _expand(V, sign * move))) for sign in (1.0, -1.0))
        J[:, column] = _reduce(V, ahead - behind) / (2.0 * h)
    return J


def analyse(
    P: StepMap,
    surface: Surface,
    x: Vector,
    *,
    step_sizes: tuple[float, ...] = STEP_SIZES,
    progress: Callable[[int, int], None] | None = None,
) -> Stability:
    """Eigenvalues at a fixed point with the step-size study behind them.

    Args:
        P: The step map.
        surface: S.
        x: The fixed point, (10,).
        step_sizes: Perturbations in [rad], from large to small; at least three.
        progress: Told finished step sizes and their number.

    Raises:
        Fell: the perturbed walker falls at every step size.
    """
    found: dict[float, tuple[Vector, NDArray[np.complex128]]] = {}
    study = []
    for done, h in enumerate(step_sizes, start=1):
        try:
            J = jacobian(P, surface, x, h)
        except Fell:
            study.append(StepSizeRow(h=h, largest=None))
        else:
            values = np.linalg.eigvals(J).astype(complex)
            values = values[np.argsort(-np.abs(values), kind="stable")]
            found[h] = (J, values)
            study.append(StepSizeRow(h=h, largest=float(np.abs(values[0]))))
        if progress:
            progress(done, len(step_sizes))
    if not found:
        raise Fell("a perturbed walker falls at every step size of the study")
    h, spread = _flattest(study)
    J, values = found[h]
    return Stability(eigenvalues=values, h=h, spread=spread, study=tuple(study), roughness=_roughness(P, surface, x, J))


def _flattest(study: list[StepSizeRow]) -> tuple[float, float]:
    """The step size whose largest eigenvalue differs least from its neighbours', and by how much."""
    rows = [(row.h, row.largest) for row in study if row.largest is not None]
    if len(rows) < 3:
        return rows[0][0], float(np.ptp([largest for _, largest in rows]))
    spreads = [max(abs(rows[i][1] - rows[i - 1][1]), abs(rows[i][1] - rows[i + 1][1])) for i in range(1, len(rows) - 1)]
    best = int(np.argmin(spreads))
    return rows[best + 1][0], spreads[best]


def _roughness(P: StepMap, surface: Surface, x: Vector, J: Vector) -> float:
    V = surface.basis(x)
    here = P(x)
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(PROBES):
        move = rng.normal(size=9)
        move *= PROBE / np.linalg.norm(move)
        beside = _reduce(V, P(surface.project(x + _expand(V, move))) - here) - J @ move
        worst = max(worst, float(np.linalg.norm(beside)))
    return worst


def _reduce(V: Vector, difference: Vector) -> Vector:
    """Scaled coordinates (9,) of a difference of states (10,)."""
    coordinates = V.T @ difference
    coordinates[4:] /= RATE_SCALE
    return coordinates


def _expand(V: Vector, coordinates: Vector) -> Vector:
    """Difference of states (10,) of scaled coordinates (9,)."""
    move = coordinates.copy()
    move[4:] *= RATE_SCALE
    return V @ move
