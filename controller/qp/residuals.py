"""How far torques are from optimal: the three residuals every solution carries, all in [N.m]."""

from typing import NamedTuple

import numpy as np

from controller.common.compiled import Array, nested
from controller.qp.problem import StageQP
from controller.qp.riccati import rates, smooth_gradient


class Residuals(NamedTuple):
    """How far torques are from optimal.

    Gradients are divided by R: as the objective is at least as curved as R, they then bound distances in [N.m].

    Attributes:
        feasibility: Largest violation of the torque box in [N.m].
        stationarity: Largest gradient by a torque that is not at a bound, in [N.m].
        complementarity: Largest, over torques pushed against a bound, of the push or the distance that is left,
            whichever is smaller, in [N.m].
        slack: Largest softening of a contact-force row in [N].
        active: Number of torques held at a bound plus softened rows.
    """

    feasibility: float
    stationarity: float
    complementarity: float
    slack: float
    active: int


@nested
def residuals(p: StageQP, u: Array, gradient: Array, at_bound: float) -> Residuals:
    """Residuals of torques whose gradient is known.

    Args:
        p: Problem.
        u: Torques in [N.m], (N, 4).
        gradient: Of the whole objective there, (N, 4).
        at_bound: What counts as sitting at a bound, in [N.m].
    """
    N, r = p.limits.shape
    stationarity = feasibility = complementarity = slack = 0.0
    active = 0
    for k in range(N):
        for i in range(4):
            g = gradient[k, i] / p.R[i]
            below, above = u[k, i] - p.lower[k, i], p.upper[k, i] - u[k, i]
            feasibility = max(feasibility, -below, -above)
            room = below if g > 0.0 else above  # where the gradient pushes to
            if room <= at_bound:
                active += 1
                complementarity = max(complementarity, min(abs(g), max(room, 0.0)))
            elif not abs(g) <= stationarity:
                stationarity = abs(g)
        for q in range(r):
            excess = -p.limits[k, q]
            for i in range(4):
                excess += p.rows[k, q, i] * u[k, i]
            if excess > 0.0:
                active += 1
                slack = max(slack, excess)
    return Residuals(feasibility, stationarity, complementarity, slack, active)


@nested
def residuals_at(p: StageQP, u: Array, at_bound: float) -> Residuals:
    """Residuals of any torques; arguments as of `residuals`."""
    N, r = p.limits.shape
    w, gradient = np.empty((N, 4)), np.empty((N, 4))
    rates(p, u, w)
    smooth_gradient(p, u, w, gradient)
    for k in range(N):
        for q in range(r):
            excess = -p.limits[k, q]
            for i in range(4):
                excess += p.rows[k, q, i] * u[k, i]
            if excess > 0.0:
                for i in range(4):
                    gradient[k, i] += p.penalty * excess * p.rows[k, q, i]
    return residuals(p, u, gradient, at_bound)
