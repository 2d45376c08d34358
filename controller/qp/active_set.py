"""Primal-dual active-set iteration: guess what is active, solve, correct the guess.

Hintermueller, Ito, Kunisch, *The primal-dual active set strategy as a semismooth Newton method*, SIAM J. Optimization
13(3), 2002. From the guess of the last tick it nearly always ends after one to three sweeps, with the exact answer;
where torque box and contact-force rows contradict each other it may cycle, and says so.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.compiled import Array, compiled
from controller.qp.problem import StageQP
from controller.qp.riccati import (
    AT_LOWER,
    AT_UPPER,
    FREE,
    Factors,
    newton_step,
    smooth_gradient,
)

TORQUE_TOLERANCE = 1e-9  # [N.m] beyond a bound
GRADIENT_TOLERANCE = 1e-6  # [cost/(N.m)] of the wrong sign at a bound


class Guess(NamedTuple):
    """What is active.

    Attributes:
        fixed: FREE, AT_LOWER or AT_UPPER for each torque, (N, 4).
        exceeded: Whether a contact-force row is beyond its limit, (N, r).
    """

    fixed: NDArray[np.int8]
    exceeded: NDArray[np.bool_]


@compiled
def shift(guess: Guess) -> None:
    """Move the guess one stage on: what was stage 1 a tick ago is stage 0 now."""
    N, r = guess.exceeded.shape
    for k in range(N - 1):
        for i in range(4):
            guess.fixed[k, i] = guess.fixed[k + 1, i]
        for q in range(r):
            guess.exceeded[k, q] = guess.exceeded[k + 1, q]


@compiled
def iterate(p: StageQP, guess: Guess, u: Array, w: Array, gradient: Array, factors: Factors, limit: int) -> int:
    """Sweep until a guess is confirmed.

    Args:
        p: StageQP.
        guess: What is active; corrected.
        u: Filled with the torques, (N, 4).
        w: Filled with the rates, (N, 4).
        gradient: Filled with the gradient of the whole objective, (N, 4).
        factors: Scratch.
        limit: Most sweeps.

    Returns:
        Sweeps taken, negative if no guess was confirmed.
    """
    N, r = guess.exceeded.shape
    R, given, b = np.empty((N, 4)), np.empty((N, 4)), np.empty((N, 4))
    Omega = np.empty((N, r))
    for k in range(N):
        for i in range(4):
            R[k, i] = p.R[i]
    for count in range(1, limit + 1):
        for k in range(N):
            for i in range(4):
                given[k, i] = p.upper[k, i] if guess.fixed[k, i] == AT_UPPER else p.lower[k, i]
                b[k, i] = 0.0
            for q in range(r):
                Omega[k, q] = 0.0
                if guess.exceeded[k, q]:
                    Omega[k, q] = p.penalty
                    for i in range(4):
                        b[k, i] -= p.penalty * p.limits[k, q] * p.rows[k, q, i]
        newton_step(p, guess.fixed, given, R, Omega, p.linear, b, factors, u, w)
        smooth_gradient(p, u, w, gradient)
        if correct(p, guess, u, gradient) == 0:
            return count
    return -limit


@compiled
def correct(p: StageQP, guess: Guess, u: Array, gradient: Array) -> int:
    """Complete the gradient by the rows' share, correct the guess, and say in how many places."""
    N, r = guess.exceeded.shape
    changes = 0
    for k in range(N):
        for q in range(r):
            excess = -p.limits[k, q]
            for i in range(4):
                excess += p.rows[k, q, i] * u[k, i]
            exceeded = excess > 0.0
            if exceeded:
                for i in range(4):
                    gradient[k, i] += p.penalty * excess * p.rows[k, q, i]
            if exceeded != guess.exceeded[k, q]:
                guess.exceeded[k, q] = exceeded
                changes += 1
        for i in range(4):
            old = guess.fixed[k, i]
            new = old
            if old == FREE:
                if u[k, i] < p.lower[k, i] - TORQUE_TOLERANCE:
                    new = AT_LOWER
                elif u[k, i] > p.upper[k, i] + TORQUE_TOLERANCE:
                    new = AT_UPPER
            elif old * gradient[k, i] > GRADIENT_TOLERANCE:
                new = FREE
            if new != old:
                guess.fixed[k, i] = new
                changes += 1
    return changes
