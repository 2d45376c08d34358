"""Predictor-corrector interior-point method on Riccati sweeps, for what the active-set iteration does not settle.

Mehrotra, *On the implementation of a primal-dual interior point method*, SIAM J. Optimization 2(4), 1992. A row that
is softened by a quadratic penalty rho needs no variable of its own: its softening is lambda / rho, so the row reads
t = d - E u + lambda / rho with t, lambda >= 0 and t lambda = 0. The torque box needs no slack variables either: u
stays strictly inside.
"""

from typing import NamedTuple

import numpy as np

from controller.common.compiled import Array, nested
from controller.qp.active_set import Guess
from controller.qp.bounds import AT_LOWER, AT_UPPER, FREE
from controller.qp.fours import (
    dot,
    larger,
    largest,
    magnitude,
    minus,
    minus_scaled,
    negative,
    plus,
    reciprocal,
    row,
    scaled,
    store,
    total,
    vector,
)
from controller.qp.problem import StageQP
from controller.qp.riccati import Factors, Terms, new_factors, new_terms, newton_step, rates, smooth_gradient, step

TO_BOUNDARY = 0.995  # share of the way to the nearest bound that a step may go
FEASIBLE = 1e-7  # [N]
INSIDE = 1e-2  # share of the box's width that the start keeps from its bounds
COLD, WARM = 1e-1, 1e-4  # smallest multipliers at the start, relative to the gradient


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
        terms: R is the diagonal of the input weight with the box barrier, Omega the weights of the contact-force rows,
            a the gradient on w_{k+1}; no torque is fixed.
        residual: d - E u + lambda / rho - t in [N], (N, r).
        per_below, per_above: Reciprocal distances to the bounds in [1/(N.m)], (N, 4).
        per_row: 1 / (t + lambda / rho) in [1/N], (N, r).
        factors: Of the matrix.
        w: Rates in [rad/s], (N, 4).
        gradient: Of the smooth part of the objective by the torques, (N, 4).
        d: Direction.
        second: What a Newton step leaves out.
        dw: Change of the rates along the direction, (N, 4).
    """

    terms: Terms
    residual: Array
    per_below: Array
    per_above: Array
    per_row: Array
    factors: Factors
    w: Array
    gradient: Array
    d: Point
    second: Point
    dw: Array


def new_point(N: int, r: int) -> Point:
    """Room for a point of N stages with r rows each."""
    return Point(np.zeros((N, 4)), np.zeros((N, 4)), np.zeros((N, 4)), np.zeros((N, r)), np.zeros((N, r)))


def new_newton(N: int, r: int) -> Newton:
    """Room for the system of N stages with r rows each."""
    four, rows = (N, 4), (N, r)
    z = np.zeros
    return Newton(
        new_terms(N, r), z(rows), z(four), z(four), z(rows), new_factors(N), z(four), z(four),
        new_point(N, r), new_point(N, r), z(four),
    )  # fmt: skip


@nested
def minimise(p: StageQP, x: Point, scale: float, newton: Newton, tolerance: float, limit: int) -> int:
    """Minimise from a point inside all bounds: that of `start`, or where an earlier call with less tolerance ended.

    Args:
        p: Problem.
        x: The point; overwritten by the answer.
        scale: From `start`.
        newton: Scratch.
        tolerance: On stationarity and mean complementarity, relative to `scale`.
        limit: On the iterations.

    Returns:
        Iterations, negative if the tolerance was not reached.
    """
    d, second = newton.d, newton.second
    for count in range(limit + 1):
        rates(p, x.u, newton.w)
        smooth_gradient(p, x.u, newton.w, newton.gradient)
        mu, stationarity, feasibility = linearise(p, x, newton)
        if mu <= tolerance * scale and stationarity <= tolerance * scale and feasibility <= FEASIBLE:
            return count
        for part in second:
            part[:] = 0.0
        direction(p, x, newton, 0.0, True)
        affine = complementarity(p, x, d, longest(x, newton, d))
        second_order(d, second)
        direction(p, x, newton, mu * (affine / mu) ** 3, False)
        alpha = min(1.0, TO_BOUNDARY * longest(x, newton, d))
        advance(x, alpha, d)
    return -limit


@nested
def second_order(d: Point, second: Point) -> None:
    """Products of the steps in what is complementary, which a Newton step leaves out."""
    N, r = d.force.shape
    d_u, d_low, d_high, d_force, d_slack = d
    second_low, second_high, second_force = second.lower, second.upper, second.force
    for k in range(N):
        du = vector(d_u, k)
        store(scaled(vector(d_low, k), du), second_low, k)
        store(negative(scaled(vector(d_high, k), du)), second_high, k)
        for q in range(r):
            second_force[k, q] = d_force[k, q] * d_slack[k, q]


@nested
def advance(x: Point, alpha: float, d: Point) -> None:
    """x + alpha d, in place."""
    N, r = x.force.shape
    at_u, low, high, force, slack = x
    d_u, d_low, d_high, d_force, d_slack = d
    for k in range(N):
        store(minus_scaled(vector(at_u, k), -alpha, vector(d_u, k)), at_u, k)
        store(minus_scaled(vector(low, k), -alpha, vector(d_low, k)), low, k)
        store(minus_scaled(vector(high, k), -alpha, vector(d_high, k)), high, k)
        for q in range(r):
            force[k, q] += alpha * d_force[k, q]
            slack[k, q] += alpha * d_slack[k, q]


@nested
def start(p: StageQP, x: Point, warm: bool, newton: Newton) -> float:
    """Point to begin with, strictly inside all bounds.

    Args:
        p: StageQP.
        x: The point of the tick before if `warm`; overwritten.
        warm: Whether to begin near that, or at the centre of the torque box.
        newton: Scratch.

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
    gradient = newton.gradient
    rates(p, x.u, newton.w)
    smooth_gradient(p, x.u, newton.w, gradient)
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


@nested
def identify(p: StageQP, x: Point, guess: Guess) -> None:
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


@nested
def linearise(p: StageQP, x: Point, newton: Newton) -> tuple[float, float, float]:
    """Newton system at x; returns mean complementarity product, stationarity and feasibility residual."""
    N, r = p.limits.shape
    rows, limits, weight, linear, softness = p.rows, p.limits, p.weight, p.linear, 1.0 / p.penalty
    at_lower, at_upper, at_u = p.lower, p.upper, x.u
    low, high, force, slack = x.lower, x.upper, x.force, x.slack
    _, _, R, Omega, a, _ = newton.terms
    residual, w, gradient = newton.residual, newton.w, newton.gradient
    per_below, per_above, per_row = newton.per_below, newton.per_above, newton.per_row
    R0 = (p.R[0], p.R[1], p.R[2], p.R[3])
    products = worst = (0.0, 0.0, 0.0, 0.0)
    mu = feasibility = 0.0
    for k in range(N):
        u, lam_low, lam_high = vector(at_u, k), vector(low, k), vector(high, k)
        g = plus(minus(vector(gradient, k), lam_low), lam_high)
        for q in range(r):
            e, lam, t = row(rows, k, q), force[k, q], slack[k, q]
            off = limits[k, q] + lam * softness - t - dot(e, u)
            residual[k, q] = off
            per_row[k, q] = 1.0 / (t + lam * softness)
            Omega[k, q] = lam * per_row[k, q]
            feasibility = max(feasibility, abs(off))
            mu += lam * t
            g = minus_scaled(g, -lam, e)
        below, above = minus(u, vector(at_lower, k)), minus(vector(at_upper, k), u)
        products = plus(products, plus(scaled(lam_low, below), scaled(lam_high, above)))
        to_below, to_above = reciprocal(below), reciprocal(above)
        store(to_below, per_below, k)
        store(to_above, per_above, k)
        store(plus(R0, plus(scaled(lam_low, to_below), scaled(lam_high, to_above))), R, k)
        store(plus(scaled(vector(weight, k), vector(w, k)), vector(linear, k)), a, k)
        worst = larger(worst, magnitude(g))
    mu += total(products)
    return mu / (N * (8 + r)), largest(worst), feasibility


@nested
def direction(p: StageQP, x: Point, newton: Newton, mu: float, fresh: bool) -> None:
    """Newton direction towards complementarity products mu, without the second-order terms; factorises if fresh."""
    N, r = p.limits.shape
    rows, softness = p.rows, 1.0 / p.penalty
    at_u, low, high, force, slack = x
    d_u, d_low, d_high, d_force, d_slack = newton.d
    second, terms = newton.second, newton.terms
    second_low, second_high, second_force = second.lower, second.upper, second.force
    Omega, residual, b = terms.Omega, newton.residual, terms.b
    per_below, per_above, per_row = newton.per_below, newton.per_above, newton.per_row
    R0, target = (p.R[0], p.R[1], p.R[2], p.R[3]), (mu, mu, mu, mu)
    for k in range(N):
        push = minus(
            scaled(minus(target, vector(second_high, k)), vector(per_above, k)),
            scaled(minus(target, vector(second_low, k)), vector(per_below, k)),
        )
        g = plus(scaled(R0, vector(at_u, k)), push)
        for q in range(r):
            lam = force[k, q]
            change = (mu - second_force[k, q] - lam * (slack[k, q] + residual[k, q])) * per_row[k, q]
            d_force[k, q] = change
            g = minus_scaled(g, -(lam + change), row(rows, k, q))
        store(g, b, k)
    if fresh:
        newton_step(p, terms, newton.factors, d_u, newton.dw, N - 1)
    else:
        step(p, terms, newton.factors, d_u, newton.dw)
    for k in range(N):
        du, lam_low, lam_high = vector(d_u, k), vector(low, k), vector(high, k)
        towards_low = minus(minus(target, vector(second_low, k)), scaled(lam_low, du))
        towards_high = plus(minus(target, vector(second_high, k)), scaled(lam_high, du))
        store(minus(scaled(towards_low, vector(per_below, k)), lam_low), d_low, k)
        store(minus(scaled(towards_high, vector(per_above, k)), lam_high), d_high, k)
        for q in range(r):
            change = dot(row(rows, k, q), du)
            d_force[k, q] += Omega[k, q] * change
            d_slack[k, q] = residual[k, q] - change + d_force[k, q] * softness


@nested
def longest(x: Point, newton: Newton, d: Point) -> float:
    """Longest step, at most 1, that keeps every bounded quantity from crossing zero."""
    N, r = newton.residual.shape
    _, low, high, force, slack = x
    d_u, d_low, d_high, d_force, d_slack = d
    per_below, per_above = newton.per_below, newton.per_above
    blocked, blocked_row = (1.0, 1.0, 1.0, 1.0), 1.0  # reciprocals of the step
    for k in range(N):
        du = vector(d_u, k)
        blocked = larger(blocked, scaled(du, vector(per_above, k)))
        blocked = larger(blocked, negative(scaled(du, vector(per_below, k))))
        blocked = larger(blocked, negative(scaled(vector(d_low, k), reciprocal(vector(low, k)))))
        blocked = larger(blocked, negative(scaled(vector(d_high, k), reciprocal(vector(high, k)))))
        for q in range(r):
            blocked_row = max(blocked_row, -d_force[k, q] / force[k, q], -d_slack[k, q] / slack[k, q])
    return 1.0 / max(largest(blocked), blocked_row)


@nested
def complementarity(p: StageQP, x: Point, d: Point, alpha: float) -> float:
    """Mean complementarity product after a step."""
    N, r = p.limits.shape
    at_u, low, high, force, slack = x
    d_u, d_low, d_high, d_force, d_slack = d
    at_lower, at_upper = p.lower, p.upper
    products, mu = (0.0, 0.0, 0.0, 0.0), 0.0
    for k in range(N):
        u = minus_scaled(vector(at_u, k), -alpha, vector(d_u, k))
        lam_low = minus_scaled(vector(low, k), -alpha, vector(d_low, k))
        lam_high = minus_scaled(vector(high, k), -alpha, vector(d_high, k))
        below, above = minus(u, vector(at_lower, k)), minus(vector(at_upper, k), u)
        products = plus(products, plus(scaled(lam_low, below), scaled(lam_high, above)))
        for q in range(r):
            mu += (force[k, q] + alpha * d_force[k, q]) * (slack[k, q] + alpha * d_slack[k, q])
    return (mu + total(products)) / (N * (8 + r))
