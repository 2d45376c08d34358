"""Limit states with known answers, told by yes and no alone: what the searches are proved on before any walk."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.trials.reliability.asking import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitState:
    """A limit state in standard normal space.

    Attributes:
        name: In tables.
        n: Number of axes.
        falls: Whether each of (k, n) points falls, (k,).
        margin: A continuous measure that has to do with it, of (k, n) points, (k,), and is no limit state: off by a
            wave of `OFF`, blind to curvature and to what lies beyond an island.
        beta: Distance of the nearest fall.
        probability: Of a fall.
        modes: Number of distinct nearest points.
    """

    name: str
    n: int
    falls: Callable[[Array], NDArray[np.bool_]]
    margin: Callable[[Array], Array]
    beta: float
    probability: float
    modes: int = 1


def _phi(x: float) -> float:
    return 0.5 * math.erfc(x / math.sqrt(2.0))


OFF = 0.4  # standard deviations by which a margin may be off


def _wave(u: Array) -> Array:
    """Error of a margin, (k, n) -> (k,)."""
    found: Array = OFF * np.sin(3.0 * u.sum(axis=1))
    return found


def _way(n: int) -> Array:
    """A unit direction in which every axis has a part, no two the same, (n,)."""
    way = (-1.0) ** np.arange(n) / np.sqrt(np.arange(1.0, n + 1.0))
    return np.asarray(way / np.linalg.norm(way), dtype=float)


def linear(n: int, beta: float = 3.0) -> LimitState:
    """A plane: P = Phi(-beta)."""
    way = _way(n)
    return LimitState(
        name=f"linear, {n}",
        n=n,
        falls=lambda u: u @ way >= beta,
        margin=lambda u: beta - u @ way + _wave(u),
        beta=beta,
        probability=_phi(beta),
    )


def parabolic(n: int, beta: float = 3.0, curvature: float = 0.1) -> LimitState:
    """A paraboloid a >= beta + curvature * (|u|^2 - a^2), a along `_way`: its P by quadrature over the rest."""
    from scipy.integrate import quad
    from scipy.stats import chi2

    p, _ = quad(lambda s: chi2.pdf(s, n - 1) * _phi(beta + curvature * s), 0.0, chi2.isf(1e-12, n - 1), limit=200)
    way = _way(n)

    def falls(u: Array) -> NDArray[np.bool_]:
        along = u @ way
        found: NDArray[np.bool_] = along >= beta + curvature * ((u**2).sum(axis=1) - along**2)
        return found

    return LimitState(
        name=f"parabolic, {n}",
        n=n,
        falls=falls,
        margin=lambda u: beta - u @ way + _wave(u),
        beta=beta,
        probability=float(p),
    )


def four_branch() -> LimitState:
    """The series system of four branches of Waarts (2000) with k = 7; P by quadrature over one axis."""
    from scipy.integrate import quad

    def falls(u: Array) -> NDArray[np.bool_]:
        a, b = (u[:, 0] + u[:, 1]) / math.sqrt(2.0), (u[:, 0] - u[:, 1]) / math.sqrt(2.0)
        g = np.array([3.0 + 0.2 * b**2 - a, 3.0 + 0.2 * b**2 + a, 7.0 / math.sqrt(2.0) - np.abs(math.sqrt(2.0) * b)])
        # (u1 - u2)^2 / 10 = b^2 / 5, and u1 - u2 + 7 / sqrt(2) <= 0 is |b| >= 3.5
        found: NDArray[np.bool_] = g.min(axis=0) <= 0.0
        return found

    inside = quad(
        lambda b: math.exp(-0.5 * b * b) / math.sqrt(2.0 * math.pi) * (1.0 - 2.0 * _phi(3.0 + 0.2 * b * b)), -3.5, 3.5
    )[0]
    return LimitState(
        name="four branches, 2",
        n=2,
        falls=falls,
        margin=lambda u: 3.2 - np.abs(u).max(axis=1) + _wave(u),
        beta=3.0,
        probability=1.0 - inside,
        modes=4,
    )


def island(n: int) -> LimitState:
    """A slab 2 <= u1 <= 2.6 that falls, a walk beyond it, and a plane u2 <= -2.8 far to the side: islands of falls."""

    def falls(u: Array) -> NDArray[np.bool_]:
        slab = (u[:, 0] >= 2.0) & (u[:, 0] <= 2.6)
        found: NDArray[np.bool_] = slab | (u[:, 1] <= -2.8)
        return found

    slab, plane = _phi(2.0) - _phi(2.6), _phi(2.8)
    return LimitState(
        name=f"island, {n}",
        n=n,
        falls=falls,
        margin=lambda u: np.minimum(2.0 - u[:, 0], 2.8 + u[:, 1]) + _wave(u),
        beta=2.0,
        probability=slab + plane - slab * plane,
        modes=2,
    )


def two_sided(n: int, beta: float = 2.5) -> LimitState:
    """Falls on both sides of one axis: a linear model of the whole sees nothing."""
    return LimitState(
        name=f"two-sided, {n}",
        n=n,
        falls=lambda u: np.abs(u[:, 0]) >= beta,
        margin=lambda u: beta - np.abs(u[:, 0]) + _wave(u),
        beta=beta,
        probability=2.0 * _phi(beta),
        modes=2,
    )


def all_limit_states() -> list[LimitState]:
    """Those of the proof."""
    return [
        *(linear(n) for n in (2, 5, 10, 20)),
        parabolic(2),
        parabolic(5),
        parabolic(20, curvature=0.02),
        four_branch(),
        *(island(n) for n in (2, 5, 20)),
        *(two_sided(n) for n in (2, 5, 20)),
    ]
