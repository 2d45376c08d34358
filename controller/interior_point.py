"""Predictor-corrector interior-point method on Riccati sweeps, for what the active-set iteration does not settle.

Mehrotra, *On the implementation of a primal-dual interior point method*, SIAM J. Optimization 2(4), 1992. A row that
is softened by a quadratic penalty rho needs no variable of its own: its softening is lambda / rho, so the row reads
t = d - E u + lambda / rho with t, lambda >= 0 and t lambda = 0. The torque box needs no slack variables either: u
stays strictly inside.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.active_set import Guess
from controller.kernels import Array, compiled
from controller.riccati import AT_LOWER, AT_UPPER, FREE, Factors, Problem, newton_step, rates, smooth_gradient, step

TO_BOUNDARY = 0.995  # share of the way to the nearest bound that a step may go
FEASIBLE = 1e-7  # [N]
INSIDE = 1e-2  # share of the box's width that the start keeps from its bounds
COLD, WARM = 1e-1, 1e-4  # least multipliers at the start, relative to the gradient


class Point(NamedTuple):
    """Primal and dual variables, or a direction in them.

    Attributes:
        u: Torques in [N.m], (N, 4).
        lower, upper: Multipliers of the torque box, (N, 4).
        force: Multipliers of the contact-force rows, (N, r).
        slack: t of those rows in [N], (N, r).
    """

    u: Array
    lower: Array
    upper: Array
    force: Array
    slack: Array


class Newton(NamedTuple):
    """One Newton system.

    Attributes:
        R: Diagonal of the input weight with the box barrier, (N, 4).
        Omega: Weights of the contact-force rows, (N, r).
        a: Gradient on w_{k+1}, (N, 4).
        residual: d - E u + lambda / rho - t in [N], (N, r).
        per_below, per_above: Reciprocal distances to the bounds in [1/(N.m)], (N, 4).
        per_row: 1 / (t + lambda / rho) in [1/N], (N, r).
        factors: Of the matrix.
    """

    R: Array
    Omega: Array
    a: Array
    residual: Array
    per_below: Array
    per_above: Array
    per_row: Array
    factors: Factors


@compiled
def new_point(N: int, r: int) -> Point:
    """Room for a point of N stages with r rows each."""
    return Point(np.zeros((N, 4)), np.zeros((N, 4)), np.zeros((N, 4)), np.zeros((N, r)), np.zeros((N, r)))


@compiled
def minimise(
    p: Problem, x: Point, scale: float, w: Array, gradient: Array, factors: Factors, tolerance: float, limit: int
) -> int:
    """Minimise from a point inside all bounds: that of `start`, or where an earlier call with less tolerance ended.

    Args:
        p: Problem.
        x: The point; overwritten by the answer.
        scale: From `start`.
        w: Filled with the rates, (N, 4).
        gradient: Filled with the gradient of the smooth part of the objective, (N, 4).
        factors: Scratch.
        tolerance: On stationarity and mean complementarity, relative to `scale`.
        limit: Most iterations.

    Returns:
        Iterations, negative if the tolerance was not reached.
    """
    N, r = p.limits.shape
    d, second = new_point(N, r), new_point(N, r)
    e = np.empty
    newton = Newton(e((N, 4)), e((N, r)), e((N, 4)), e((N, r)), e((N, 4)), e((N, 4)), e((N, r)), factors)
    free = np.zeros((N, 4), dtype=np.int8)
    for count in range(limit + 1):
        rates(p, x.u, w)
        smooth_gradient(p, x.u, w, gradient)
        mu, stationarity, feasibility = linearise(p, x, w, gradient, newton)
        if mu <= tolerance * scale and stationarity <= tolerance * scale and feasibility <= FEASIBLE:
            return count
        for part in second:
            part[:] = 0.0
        direction(p, x, newton, 0.0, second, free, True, d)
        affine = complementarity(p, x, d, longest(x, newton, d))
        for k in range(N):
            for i in range(4):
                second.lower[k, i] = d.lower[k, i] * d.u[k, i]
                second.upper[k, i] = -d.upper[k, i] * d.u[k, i]
            for q in range(r):
                second.force[k, q] = d.force[k, q] * d.slack[k, q]
        direction(p, x, newton, mu * (affine / mu) ** 3, second, free, False, d)
        alpha = min(1.0, TO_BOUNDARY * longest(x, newton, d))
        for k in range(N):
            for i in range(4):
                x.u[k, i] += alpha * d.u[k, i]
                x.lower[k, i] += alpha * d.lower[k, i]
                x.upper[k, i] += alpha * d.upper[k, i]
            for q in range(r):
                x.force[k, q] += alpha * d.force[k, q]
                x.slack[k, q] += alpha * d.slack[k, q]
    return -limit


@compiled
def start(p: Problem, x: Point, warm: bool, w: Array, gradient: Array) -> float:
    """Point to begin with, strictly inside all bounds.

    Args:
        p: Problem.
        x: The point of the tick before if `warm`; overwritten.
        warm: Whether to begin near that, or at the centre of the torque box.
        w: Filled with the rates, (N, 4).
        gradient: Filled with the gradient of the smooth part of the objective, (N, 4).

    Returns:
        The largest gradient there, which residuals are relative to.
    """
    N, r = p.limits.shape
    for k in range(N):
        before = min(k + 1, N - 1)  # the tick before was one stage behind
        for i in range(4):
            low, width = p.lower[k, i], p.upper[k, i] - p.lower[k, i]
            u = x.u[before, i] if warm else low + 0.5 * width
            x.u[k, i] = min(max(u, low + INSIDE * width), low + (1.0 - INSIDE) * width)
    rates(p, x.u, w)
    smooth_gradient(p, x.u, w, gradient)
    scale = max(1.0, np.abs(gradient).max())
    floor = (WARM if warm else COLD) * scale
    for k in range(N):
        before = min(k + 1, N - 1)
        for i in range(4):
            x.lower[k, i] = max(x.lower[before, i] if warm else max(gradient[k, i], 0.0) + floor, floor)
            x.upper[k, i] = max(x.upper[before, i] if warm else max(-gradient[k, i], 0.0) + floor, floor)
        for q in range(r):
            x.force[k, q] = max(x.force[before, q] if warm else floor, floor)
            room = p.limits[k, q] + (x.force[k, q] / p.penalty if warm else 0.0)
            for i in range(4):
                room -= p.rows[k, q, i] * x.u[k, i]
            x.slack[k, q] = max(room, 1.0)
    return scale


@compiled
def identify(p: Problem, x: Point, guess: Guess) -> None:
    """What is active at a point near the optimum: where the multiplier outweighs the distance."""
    N, r = p.limits.shape
    for k in range(N):
        for i in range(4):
            guess.fixed[k, i] = FREE
            if x.lower[k, i] > x.u[k, i] - p.lower[k, i] and x.lower[k, i] > x.upper[k, i]:
                guess.fixed[k, i] = AT_LOWER
            elif x.upper[k, i] > p.upper[k, i] - x.u[k, i]:
                guess.fixed[k, i] = AT_UPPER
        for q in range(r):
            guess.exceeded[k, q] = x.force[k, q] > x.slack[k, q]


@compiled
def linearise(p: Problem, x: Point, w: Array, gradient: Array, newton: Newton) -> tuple[float, float, float]:
    """Newton system at x; returns mean complementarity product, stationarity and feasibility residual."""
    N, r = p.limits.shape
    mu = stationarity = feasibility = 0.0
    for k in range(N):
        for q in range(r):
            residual = p.limits[k, q] + x.force[k, q] / p.penalty - x.slack[k, q]
            for i in range(4):
                residual -= p.rows[k, q, i] * x.u[k, i]
            newton.residual[k, q] = residual
            newton.per_row[k, q] = 1.0 / (x.slack[k, q] + x.force[k, q] / p.penalty)
            newton.Omega[k, q] = x.force[k, q] * newton.per_row[k, q]
            feasibility = max(feasibility, abs(residual))
            mu += x.force[k, q] * x.slack[k, q]
        for i in range(4):
            below, above = x.u[k, i] - p.lower[k, i], p.upper[k, i] - x.u[k, i]
            mu += x.lower[k, i] * below + x.upper[k, i] * above
            newton.per_below[k, i], newton.per_above[k, i] = 1.0 / below, 1.0 / above
            newton.R[k, i] = p.R[i] + x.lower[k, i] * newton.per_below[k, i] + x.upper[k, i] * newton.per_above[k, i]
            newton.a[k, i] = p.weight[k, i] * w[k, i] + p.linear[k, i]
            g = gradient[k, i] - x.lower[k, i] + x.upper[k, i]
            for q in range(r):
                g += p.rows[k, q, i] * x.force[k, q]
            stationarity = max(stationarity, abs(g))
    return mu / (N * (8 + r)), stationarity, feasibility


@compiled
def direction(
    p: Problem, x: Point, newton: Newton, mu: float, second: Point, free: NDArray[np.int8], fresh: bool, d: Point
) -> None:
    """Newton direction towards complementarity products mu, less the second-order terms; factorises if fresh."""
    N, r = p.limits.shape
    b, dw = np.empty((N, 4)), np.empty((N, 4))
    for k in range(N):
        for i in range(4):
            push = (mu - second.upper[k, i]) * newton.per_above[k, i]
            push -= (mu - second.lower[k, i]) * newton.per_below[k, i]
            b[k, i] = p.R[i] * x.u[k, i] + push
        for q in range(r):
            product = mu - second.force[k, q] - x.force[k, q] * (x.slack[k, q] + newton.residual[k, q])
            d.force[k, q] = product * newton.per_row[k, q]
            for i in range(4):
                b[k, i] += p.rows[k, q, i] * (x.force[k, q] + d.force[k, q])
    if fresh:
        newton_step(p, free, x.u, newton.R, newton.Omega, newton.a, b, newton.factors, d.u, dw)
    else:
        step(p, free, x.u, newton.Omega, newton.a, b, newton.factors, d.u, dw)
    softness = 1.0 / p.penalty
    for k in range(N):
        for i in range(4):
            du, low, up = d.u[k, i], x.lower[k, i], x.upper[k, i]
            d.lower[k, i] = (mu - second.lower[k, i] - low * du) * newton.per_below[k, i] - low
            d.upper[k, i] = (mu - second.upper[k, i] + up * du) * newton.per_above[k, i] - up
        for q in range(r):
            change = 0.0
            for i in range(4):
                change += p.rows[k, q, i] * d.u[k, i]
            d.force[k, q] += newton.Omega[k, q] * change
            d.slack[k, q] = newton.residual[k, q] - change + d.force[k, q] * softness


@compiled
def longest(x: Point, newton: Newton, d: Point) -> float:
    """Longest step, at most 1, that keeps every bounded quantity from crossing zero."""
    N, r = newton.residual.shape
    blocked = 1.0  # reciprocal of the step
    for k in range(N):
        for i in range(4):
            du = d.u[k, i]
            blocked = max(blocked, du * newton.per_above[k, i], -du * newton.per_below[k, i])
            blocked = max(blocked, -d.lower[k, i] / x.lower[k, i], -d.upper[k, i] / x.upper[k, i])
        for q in range(r):
            blocked = max(blocked, -d.force[k, q] / x.force[k, q], -d.slack[k, q] / x.slack[k, q])
    return 1.0 / blocked


@compiled
def complementarity(p: Problem, x: Point, d: Point, alpha: float) -> float:
    """Mean complementarity product after a step."""
    N, r = p.limits.shape
    total = 0.0
    for k in range(N):
        for i in range(4):
            u = x.u[k, i] + alpha * d.u[k, i]
            total += (x.lower[k, i] + alpha * d.lower[k, i]) * (u - p.lower[k, i])
            total += (x.upper[k, i] + alpha * d.upper[k, i]) * (p.upper[k, i] - u)
        for q in range(r):
            total += (x.force[k, q] + alpha * d.force[k, q]) * (x.slack[k, q] + alpha * d.slack[k, q])
    return total / (N * (8 + r))
