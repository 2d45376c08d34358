"""What the contact may bear, and the three rows that say so: the one home of the friction cone."""

from typing import NamedTuple

import numpy as np

from controller.common.compiled import Array, inlined
from controller.common.records import Vector

ROWS = 3  # both sides of the friction cone, normal force
PENALTY = 1e5  # [1/N^2] of a softened contact-force row


class Friction(NamedTuple):
    """Contact-force limits of Eq. (21).

    Attributes:
        mu: Friction coefficient the controller counts on.
        normal_min: Smallest normal force in [N]; it keeps Eq. (21) linear.
        penalty: Cost of a softened row in [1/N^2]; large enough that a row gives way only where the torque box
            leaves no choice. 0 says that there are no limits.
    """

    mu: float
    normal_min: float
    penalty: float = PENALTY


UNLIMITED = Friction(mu=0.0, normal_min=0.0, penalty=0.0)
"""A contact that bears everything."""


@inlined
def cone(friction: Friction, tangential: float, normal: float) -> tuple[float, float, float]:
    """The rows' left sides for a force in [N], or for its change per unit of something.

    |F_T| <= mu F_N as two rows, which Eq. (21) is once F_N > 0, and F_N >= normal_min:
    F_T - mu F_N <= 0, -F_T - mu F_N <= 0, -F_N <= -normal_min.
    """
    return tangential - friction.mu * normal, -tangential - friction.mu * normal, -normal


@inlined
def excess(friction: Friction, force: Array) -> tuple[float, float, float]:
    """How far a force (2,) is beyond each limit in [N]; negative within."""
    a, b, c = cone(friction, force[0], force[1])
    return a, b, c + friction.normal_min


def matrix(friction: Friction) -> tuple[Vector, Vector]:
    """The same rows as C F <= d: C (3, 2), d (3,) in [N]."""
    columns = [cone(friction, *unit) for unit in ((1.0, 0.0), (0.0, 1.0))]
    return np.ascontiguousarray(np.transpose(columns)), -np.array(excess(friction, np.zeros(2)))
