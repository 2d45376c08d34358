"""What the compiled code of both plants takes besides their own: the ground and the forces of a hold."""

import numpy as np

from controller.common.compiled import Array, inlined

START, COS, SIN, INTERCEPT, TAN = range(5)
"""Columns of a ground (`Terrain.table`): where a facet begins in [m], cosine and sine of its angle, its height at
x = 0 in [m], its slope."""

FINE, DIVERGED, NO_TORQUE, NOTED = range(4)
"""How a hold ended; after one with something to note all is well, too."""

FORCE = np.dtype([("link", np.int64), ("point", float, 2), ("force", float, 2)], align=True)
"""An external force: position of its link in `LINKS`, its point in the link's frame in [m], the force in [N]."""


@inlined
def facet_under(ground: Array, x: float) -> int:
    """Row of the facet under x; on a border, of the one that begins there."""
    low, high = 0, ground.shape[0]
    while low < high:
        middle = (low + high) // 2
        if x < ground[middle, START]:
            high = middle
        else:
            low = middle + 1
    return max(0, low - 1)


@inlined
def height_under(ground: Array, x: float) -> float:
    """Height of the ground in [m] at x in [m]."""
    facet = facet_under(ground, x)
    return ground[facet, INTERCEPT] + ground[facet, TAN] * x
