"""Primal-dual interior-point method on a planned motion's quadratic model: a Riccati sweep is a Newton step.

A row says J d + r <= c m for its multiplier m and compliance c: zero for a torque limit, which is hard, and the inverse
weight of the violation's square for a soft one. With a slack t, m t = mu, and t and m eliminated, a Newton step
minimises the cost with the row's square weighted by m / (t + c m) about r + t + mu / m (Wright, Primal-Dual
Interior-Point Methods, 1997; Rao, Wright, Rawlings 1998 for the Riccati recursion).
"""

from typing import NamedTuple

import numpy as np

from controller.common.compiled import Array, compiled
from controller.plan.cost import ROWS
from controller.plan.dynamics import N_U, N_X
from controller.plan.motion import Model
from controller.plan.sweep import backward, forward, step_times

ALL_ROWS = ROWS + 2 * N_U
CENTRE = 0.15  # share of the complementarity that the next step aims at
BOUNDARY = 0.99  # share of the way to the boundary that a step may go
START = 0.3  # complementarity that a solve begins with, in units of the cost
TOLERANCE = 1e-4  # complementarity that ends it


class Interior(NamedTuple):
    """What the method works on.

    Attributes:
        multiplier, slack, weight, offset: Of each row, (N, 17).
        k, K: Corrections of `backward`, (N, 4), (N, 4, nz).
        values, slopes: Value of every node, (N + 1, nz, nz), (N + 1, nz).
        dz, du: Answer, (N + 1, nz), (N, 4).
        new_z, new_u: Scratch of the same shapes.
    """

    multiplier: Array
    slack: Array
    weight: Array
    offset: Array
    k: Array
    K: Array
    values: Array
    slopes: Array
    dz: Array
    du: Array
    new_z: Array
    new_u: Array


@compiled
def new_interior(N: int, n: int) -> Interior:
    """Room for N stages of n states."""
    z = np.zeros
    rows = (N, ALL_ROWS)
    return Interior(
        z(rows), z(rows), z(rows), z(rows), z((N, N_U)), z((N, N_U, n)), z((N + 1, n, n)), z((N + 1, n)),
        z((N + 1, n)), z((N, N_U)), z((N + 1, n)), z((N, N_U)),
    )  # fmt: skip


@compiled
def _base(model: Model, limit: Array, planned: Array, s: int, row: int) -> float:
    """A row's r: how far its limit is exceeded where the model stands."""
    if row < ROWS:
        return model.r[s, row]
    i = (row - ROWS) % N_U
    return (planned[s, i] if row < ROWS + N_U else -planned[s, i]) / limit[i] - 1.0


@compiled
def _row(model: Model, limit: Array, planned: Array, s: int, row: int, dz: Array, du: Array) -> float:
    """J d + r of a row."""
    v = _base(model, limit, planned, s, row)
    if row < ROWS:
        for j in range(N_X):
            v += model.r_x[s, row, j] * dz[s, j]
        for j in range(N_U):
            v += model.r_u[s, row, j] * du[s, j]
        return v
    i = (row - ROWS) % N_U
    return v + (du[s, i] if row < ROWS + N_U else -du[s, i]) / limit[i]


@compiled
def solve(
    model: Model, impact: Array, limit: Array, planned: Array, T: Array, shortest: Array, longest: Array, most: float,
    sweeps: int, w: Interior, dT: Array,
) -> tuple[float, float, int]:  # fmt: skip
    """Step of the quadratic problem within its limits.

    Args:
        model: Linear-quadratic, with rows.
        impact: Stages without torque and rows, (N,).
        limit: Torque limits in [N.m], (4,).
        planned: Torques about which the model stands in [N.m], (N, 4).
        T: Step times about which it stands in [s], (P,).
        shortest: Least step times in [s], (P,).
        longest: Longest ones in [s], (P,).
        most: Change of a step time allowed in [s].
        sweeps: Most that are taken.
        w: Room, and the answer.
        dT: Answer: changes of the step times in [s], (P,).

    Returns:
        The largest multipliers of the dynamics, by angles and by rates, and the sweeps taken.
    """
    N, n = model.A.shape[0], model.A.shape[1]
    P = n - N_X
    new_T = np.empty(P)
    w.dz[:] = 0.0
    w.du[:] = 0.0
    dT[:] = 0.0
    w.weight[:] = 0.0
    w.offset[:] = 0.0
    rows = 0
    for s in range(N):
        if not impact[s]:
            for row in range(ALL_ROWS):
                w.slack[s, row] = max(-_base(model, limit, planned, s, row), 0.1)
                w.multiplier[s, row] = START / w.slack[s, row]
                rows += 1
    mu, share = START, 0.0
    angles, rates, count = 0.0, 0.0, 0
    while count < sweeps:
        count += 1
        aim = CENTRE * mu
        for s in range(N):
            if not impact[s]:
                for row in range(ALL_ROWS):
                    m, t = w.multiplier[s, row], w.slack[s, row]
                    compliance = 1.0 / model.weight[s, row] if row < ROWS else 0.0
                    w.weight[s, row] = m / (t + compliance * m)
                    w.offset[s, row] = _base(model, limit, planned, s, row) + t + aim / m
        backward(model, w.weight, w.offset, limit, w.k, w.K, w.values, w.slopes)
        step_times(w.values[0], w.slopes[0], T, shortest, longest, most, new_T)
        angles, rates = forward(model, w.k, w.K, w.values, w.slopes, new_T, w.new_z, w.new_u)
        share = 1.0
        for s in range(N):
            if not impact[s]:
                for row in range(ALL_ROWS):
                    m, t = w.multiplier[s, row], w.slack[s, row]
                    v = _row(model, limit, planned, s, row, w.new_z, w.new_u)
                    new_m = w.weight[s, row] * (v + t + aim / m)
                    new_t = (new_m / model.weight[s, row] if row < ROWS else 0.0) - v
                    w.offset[s, row] = v
                    if new_m < m:
                        share = min(share, BOUNDARY * m / (m - new_m))
                    if new_t < t:
                        share = min(share, BOUNDARY * t / (t - new_t))
        mu = 0.0
        for s in range(N):
            if not impact[s]:
                for row in range(ALL_ROWS):
                    m, t, v = w.multiplier[s, row], w.slack[s, row], w.offset[s, row]
                    new_m = w.weight[s, row] * (v + t + aim / m)
                    new_t = (new_m / model.weight[s, row] if row < ROWS else 0.0) - v
                    w.multiplier[s, row] = m + share * (new_m - m)
                    w.slack[s, row] = t + share * (new_t - t)
                    mu += w.multiplier[s, row] * w.slack[s, row]
        mu /= rows
        for s in range(N + 1):
            for i in range(n):
                w.dz[s, i] += share * (w.new_z[s, i] - w.dz[s, i])
            if s < N:
                for i in range(N_U):
                    w.du[s, i] += share * (w.new_u[s, i] - w.du[s, i])
        for p in range(P):
            dT[p] += share * (new_T[p] - dT[p])
        if mu < TOLERANCE and share > 0.9:
            break
    for s in range(N):
        for i in range(N_U):
            w.du[s, i] = min(max(w.du[s, i], -limit[i] - planned[s, i]), limit[i] - planned[s, i])
    return angles, rates, count
