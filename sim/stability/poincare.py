"""Stability of a gait: eigenvalues of the step map's Jacobian, with their noise and the study of step sizes.

A controller that predicts impacts at whole ticks makes the map jump a little, and a difference quotient takes the
jumps for slopes: small perturbations measure them, large ones the map's curvature. So one perturbation is used for
every walker, and the same Jacobian is taken along other directions to see how far the jumps move its eigenvalues.
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interface import Vector
from sim.stability.sections import Surface
from sim.stability.step_map import Fell, StepMap, expand, jacobian, reduce

STEP_SIZES = (3e-2, 2e-2, 1e-2, 5e-3, 3e-3, 1e-3, 3e-4, 1e-4)
"""[rad] of the step-size study."""

PERTURBATION = 2e-2  # [rad] of the eigenvalues that are reported
REPEATS = 4  # Jacobians along other directions

PROBE = 1e-4  # [rad] perturbation at which the roughness of the map is measured
PROBES = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepSizeRow:
    """One row of the step-size study.

    Attributes:
        h: Perturbation in [rad].
        largest: Largest magnitude of an eigenvalue; None where a perturbed walker falls.
        jumps: The map's jumps over h: what they may do to an entry of the Jacobian, at worst.
    """

    h: float
    largest: float | None
    jumps: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stability:
    """Linearised stability of a fixed point.

    Attributes:
        eigenvalues: Of the Jacobian on S, largest magnitude first, (9,).
        h: Perturbation it was taken with in [rad].
        noise: Noise floor of the largest magnitude: standard deviation over Jacobians along different directions;
            infinite where the walker falls in all but one of them.
        study: Every step size tried.
        roughness: The most that the map does beside its Jacobian under small random perturbations, same norm
            as the residual.
    """

    eigenvalues: NDArray[np.complex128]
    h: float
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
    h: float = PERTURBATION,
    step_sizes: tuple[float, ...] = STEP_SIZES,
    repeats: int = REPEATS,
    progress: Callable[[int, int], None] | None = None,
) -> Stability:
    """Eigenvalues at a fixed point with their noise floor and the step-size study.

    Args:
        P: The step map.
        surface: S.
        x: The fixed point, (10,).
        h: Perturbation in [rad] of the eigenvalues.
        step_sizes: Perturbations in [rad] of the study.
        repeats: Jacobians along other directions, for the noise floor.
        progress: Told finished Jacobians and their number.

    Raises:
        Fell: the walker perturbed by h falls.
    """
    sizes = sorted({h, *step_sizes}, reverse=True)
    count = len(sizes) + repeats
    jacobians: dict[float, Vector] = {}
    for done, size in enumerate(sizes, start=1):
        with contextlib.suppress(Fell):
            jacobians[size] = jacobian(P, surface, x, size)
        if progress:
            progress(done, count)
    if h not in jacobians:
        raise Fell(f"a walker perturbed by {h:g} rad falls")
    largest = [_largest(jacobians[h])]
    rng = np.random.default_rng(0)
    for done in range(repeats):
        directions = np.linalg.qr(rng.normal(size=(9, 9)))[0]
        with contextlib.suppress(Fell):
            largest.append(_largest(jacobian(P, surface, x, h, directions)))
        if progress:
            progress(len(sizes) + done + 1, count)
    roughness = _roughness(P, surface, x, list(jacobians.values()))
    eigenvalues = np.linalg.eigvals(jacobians[h]).astype(complex)
    return Stability(
        eigenvalues=eigenvalues[np.argsort(-np.abs(eigenvalues), kind="stable")],
        h=h,
        noise=float(np.std(largest, ddof=1)) if len(largest) > 1 else np.inf,
        study=tuple(
            StepSizeRow(
                h=size, largest=_largest(jacobians[size]) if size in jacobians else None, jumps=roughness / size
            )
            for size in sizes
        ),
        roughness=roughness,
    )


def _largest(J: Vector) -> float:
    return float(np.abs(np.linalg.eigvals(J)).max())


def _roughness(P: StepMap, surface: Surface, x: Vector, jacobians: list[Vector]) -> float:
    """The most that P does beside a Jacobian under small perturbations; beside the best of them."""
    V = surface.basis(x)
    here = P(x)
    rng = np.random.default_rng(0)
    moves = rng.normal(size=(PROBES, 9))
    moves *= PROBE / np.linalg.norm(moves, axis=1, keepdims=True)
    found = np.array([reduce(V, P(surface.project(x + expand(V, move))) - here) for move in moves])
    return min(float(np.linalg.norm(found - moves @ J.T, axis=1).max()) for J in jacobians)
