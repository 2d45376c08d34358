"""Stability of a gait: eigenvalues of the step map's Jacobian, with the study of step sizes behind them.

A map that jumps by r moves a difference quotient over h by r / h, however the Jacobian is. That is the noise floor of
its eigenvalues: large perturbations measure the map's curvature, small ones its jumps.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interface import Vector
from sim.sections import Surface
from sim.step_map import Fell, StepMap, distance, expand, jacobian, reduce

STEP_SIZES = (3e-2, 2e-2, 1e-2, 5e-3, 3e-3, 1e-3, 3e-4, 1e-4)
"""[rad] of the step-size study."""

NOISE = 0.1
"""Noise floor above which a row of the study is not chosen."""

PROBE = 1e-4  # [rad] perturbation at which the roughness of the map is measured
PROBES = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepSizeRow:
    """One row of the step-size study.

    Attributes:
        h: Perturbation in [rad].
        largest: Largest magnitude of an eigenvalue; None where a perturbed walker falls.
        noise: What the map's jumps may add to it: roughness, or residual of the fixed point if larger, over h.
    """

    h: float
    largest: float | None
    noise: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stability:
    """Linearised stability of a fixed point.

    Attributes:
        eigenvalues: Of the Jacobian on S, largest magnitude first, (9,).
        h: Perturbation it was taken with in [rad]: the middle of the flattest stretch of the study, among those whose
            noise floor is at most `NOISE`; the largest if there is none.
        spread: Largest difference of the largest magnitude to its neighbours' in that stretch; None without any.
        noise: Noise floor of the largest magnitude.
        study: Every step size tried.
        roughness: The most that the map does beside its Jacobian under small random perturbations, same norm
            as the residual. A controller that predicts impacts at whole ticks makes the map jump by about this.
    """

    eigenvalues: NDArray[np.complex128]
    h: float
    spread: float | None
    noise: float
    study: tuple[StepSizeRow, ...]
    roughness: float

    @property
    def largest(self) -> float:
        """Largest magnitude of an eigenvalue."""
        return float(np.abs(self.eigenvalues[0]))


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
        step_sizes: Perturbations in [rad], from large to small.
        progress: Told finished step sizes and their number.

    Raises:
        Fell: the perturbed walker falls at every step size, or at the fixed point.
    """
    jacobians: dict[float, Vector] = {}
    for done, h in enumerate(step_sizes, start=1):
        try:
            jacobians[h] = jacobian(P, surface, x, h)
        except Fell:
            pass
        if progress:
            progress(done, len(step_sizes))
    if not jacobians:
        raise Fell("a perturbed walker falls at every step size of the study")
    residual, roughness = _jumps(P, surface, x, list(jacobians.values()))
    jumps = max(residual, roughness)
    eigenvalues = {h: _sorted_eigenvalues(J) for h, J in jacobians.items()}
    study = tuple(
        StepSizeRow(h=h, largest=float(np.abs(eigenvalues[h][0])) if h in eigenvalues else None, noise=jumps / h)
        for h in step_sizes
    )
    chosen, spread = _flattest(study)
    return Stability(
        eigenvalues=eigenvalues[chosen.h],
        h=chosen.h,
        spread=spread,
        noise=chosen.noise,
        study=study,
        roughness=roughness,
    )


def _sorted_eigenvalues(J: Vector) -> NDArray[np.complex128]:
    values = np.linalg.eigvals(J).astype(complex)
    return values[np.argsort(-np.abs(values), kind="stable")]


def _flattest(study: tuple[StepSizeRow, ...]) -> tuple[StepSizeRow, float | None]:
    """The row whose largest eigenvalue differs least from its neighbours', and by how much."""
    walked = [row for row in study if row.largest is not None]
    rows = [row for row in walked if row.noise <= NOISE] or walked[:1]
    values = [row.largest or 0.0 for row in rows]
    if len(rows) < 3:
        return rows[0], float(np.ptp(values)) if len(rows) > 1 else None
    steps = np.abs(np.diff(values))
    spreads = np.maximum(steps[:-1], steps[1:])
    best = int(np.argmin(spreads))
    return rows[best + 1], float(spreads[best])


def _jumps(P: StepMap, surface: Surface, x: Vector, jacobians: list[Vector]) -> tuple[float, float]:
    """Residual at x, and the most that P does beside a Jacobian under small perturbations; beside the best of them."""
    V = surface.basis(x)
    here = P(x)
    rng = np.random.default_rng(0)
    moves = rng.normal(size=(PROBES, 9))
    moves *= PROBE / np.linalg.norm(moves, axis=1, keepdims=True)
    found = np.array([reduce(V, P(surface.project(x + expand(V, move))) - here) for move in moves])
    return distance(here, x), min(float(np.linalg.norm(found - moves @ J.T, axis=1).max()) for J in jacobians)
