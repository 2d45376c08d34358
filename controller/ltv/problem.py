"""Linear-quadratic problem over the stages of an `LtvHorizon`; softened rows, and a hard box on the first torque."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.common.compiled import Array, compiled
from controller.ltv.coordinates import N_Z
from controller.qp.bounds import AT_UPPER, FREE


class LtvProblem(NamedTuple):
    """minimise 1/2 sum_k [e' W e at z_{k+1}] + 1/2 u' R u + linear' u + 1/2 sum_r rho_r max(0, Ez z + Eu u - d)^2.

    Attributes:
        AB: Of z_{k+1} = A z_k + B u_k, z_0 = 0 (deviations), (N, 10, 14).
        error: e at z_{k+1} = 0: outputs, rates, clock rate, (N, 9).
        weight: Diagonal W, (N, 9).
        slope: dtheta*'(theta) at the end of each stage, (N,).
        R: (4,).
        linear: On u, (N, 4).
        rows_z, rows_u, limits: Ez (N, r, 10), Eu (N, r, 4), d (N, r).
        penalty: rho, (r,).
        lower, upper: Box of the first torque in [N.m], (4,).
    """

    AB: Array
    error: Array
    weight: Array
    slope: Array
    R: Array
    linear: Array
    rows_z: Array
    rows_u: Array
    limits: Array
    penalty: Array
    lower: Array
    upper: Array


class LtvState(NamedTuple):
    """Guess and answer: exceeded rows (N, r), fixed first torques (4,), torques (N, 4), deviations (N + 1, 10)."""

    exceeded: NDArray[np.bool_]
    fixed: NDArray[np.int8]
    u: Array
    z: Array
    K: Array
    k: Array
    H0: Array


def new_state(N: int, r: int) -> LtvState:
    """Room for N stages, nothing active."""
    z = np.zeros
    return LtvState(
        z((N, r), dtype=np.bool_), z(4, dtype=np.int8), z((N, 4)), z((N + 1, N_Z)), z((N, 4, N_Z)), z((N, 4)),
        z((4, 5)),
    )  # fmt: skip


@compiled
def residuals(p: LtvProblem, s: LtvState) -> Array:
    """Feasibility, stationarity and complementarity of the torque applied now in [N.m], (3,).

    As `qp.residuals.Residuals` has them, for stage 0 alone: the torque beyond its box; the largest gradient by a free
    torque; of a torque at a bound the push against it or the distance from it, whichever is smaller. Gradients are
    divided by R.
    """
    out = np.zeros(3)
    for i in range(4):
        u = s.u[0, i]
        g = s.H0[i, 4]
        for j in range(4):
            g += s.H0[i, j] * s.u[0, j]
        g /= p.R[i]
        out[0] = max(out[0], u - p.upper[i], p.lower[i] - u)
        if s.fixed[i] == FREE:
            out[1] = max(out[1], abs(g))
        else:
            distance = p.upper[i] - u if s.fixed[i] == AT_UPPER else u - p.lower[i]
            out[2] = max(out[2], min(abs(g), abs(distance)))
    return out
