"""The step-to-step map on the switching surface, its distances and its Jacobian.

The map P takes the state just before an impact to the state just before the next one. The controller's tick grid
starts anew at each impact: P then has no memory of the phase of the ticks, and on the rigid plant it is smooth.
A free walk keeps its grid, so its section states scatter.
"""

from collections.abc import Callable

import numpy as np

from sim.interface import Vector
from sim.stability.sections import Surface

RATE_SCALE = 4.0
"""[1/s] A perturbation of h rad in an angle goes with one of 4 h rad/s in a rate; sqrt(g / leg) is 3.5 1/s."""

StepMap = Callable[[Vector], Vector]
"""Section state (10,) in stance order to the next one; raises `Fell` where there is none."""


class Fell(RuntimeError):
    """The walker does not reach the next impact from this state."""


def scaled(x: Vector) -> Vector:
    """States or differences of states (..., 10) with rates in units of `RATE_SCALE`."""
    return np.concatenate((x[..., :5], x[..., 5:] / RATE_SCALE), axis=-1)


def distance(a: Vector, b: Vector) -> float:
    """Norm of a difference of states in [rad], rates in units of `RATE_SCALE`."""
    return float(np.linalg.norm(scaled(a - b)))


def jacobian(P: StepMap, surface: Surface, x: Vector, h: float, directions: Vector | None = None) -> Vector:
    """Jacobian of P along S by central differences, (9, 9), in scaled coordinates of `Surface.basis`.

    Args:
        P: The step map.
        surface: S.
        x: Where, (10,), on S.
        h: Perturbation in [rad].
        directions: Orthonormal columns along which to perturb, (9, 9), in the same coordinates; the axes by default.

    Raises:
        Fell: a perturbed walker falls.
    """
    V = surface.basis(x)
    along = np.eye(9) if directions is None else directions
    J = np.empty((9, 9))
    for column in range(9):
        move = h * along[:, column]
        ahead, behind = (P(surface.project(x + expand(V, sign * move))) for sign in (1.0, -1.0))
        J[:, column] = reduce(V, ahead - behind) / (2.0 * h)
    return J @ along.T


def reduce(V: Vector, difference: Vector) -> Vector:
    """Scaled coordinates (9,) of a difference of states (10,)."""
    coordinates = V.T @ difference
    coordinates[4:] /= RATE_SCALE
    return coordinates


def expand(V: Vector, coordinates: Vector) -> Vector:
    """Difference of states (10,) of scaled coordinates (9,)."""
    move = coordinates.copy()
    move[4:] *= RATE_SCALE
    return V @ move
