"""Primal-dual active-set iteration: guess what is active, solve, correct the guess.

Hintermueller, Ito, Kunisch, *The primal-dual active set strategy as a semismooth Newton method*, SIAM J. Optimization
13(3), 2002. From the guess of the last tick it nearly always ends after one to three sweeps, with the exact answer;
where torque box and contact-force rows contradict each other it may cycle, and says so.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.common.compiled import Array, nested
from controller.qp.bounds import AT_UPPER, corrected
from controller.qp.problem import StageQP
from controller.qp.riccati import Factors, Terms, new_factors, newton_step, smooth_gradient

PATIENCE = 2  # sweeps in succession that do not come closer to a guess without errors


class Guess(NamedTuple):
    """What is active.

    Attributes:
        fixed: FREE, AT_LOWER or AT_UPPER for each torque, (N, 4).
        exceeded: Whether a contact-force row is beyond its limit, (N, r).
    """

    fixed: NDArray[np.int8]
    exceeded: NDArray[np.bool_]


@nested
def shift(guess: Guess) -> None:
    """Move the guess one stage on: what was stage 1 a tick ago is stage 0 now."""
    N, r = guess.exceeded.shape
    for k in range(N - 1):
        for i in range(4):
            guess.fixed[k, i] = guess.fixed[k + 1, i]
        for q in range(r):
            guess.exceeded[k, q] = guess.exceeded[k + 1, q]


class Sweep(NamedTuple):
    """Answer and room of a sweep.

    Attributes:
        u: Torques in [N.m], (N, 4).
        w: Rates in [rad/s], (N, 4), whose row k holds w_{k+1}.
        gradient: Of the whole objective by the torques, (N, 4).
        terms: Scratch.
        factors: Scratch.
    """

    u: Array
    w: Array
    gradient: Array
    terms: Terms
    factors: Factors


def new_sweep(N: int, terms: Terms) -> Sweep:
    """Room for N stages; `terms` may be shared with other methods."""
    return Sweep(np.zeros((N, 4)), np.zeros((N, 4)), np.zeros((N, 4)), terms, new_factors(N))


@nested
def iterate(p: StageQP, guess: Guess, s: Sweep, limit: int) -> int:
    """Sweep until a guess is confirmed.

    Args:
        p: Problem.
        guess: What is active; corrected.
        s: Filled.
        limit: On the sweeps.

    Returns:
        Sweeps taken, negative if no guess was confirmed: after `limit` of them, or where the corrections do not become
        fewer.
    """
    N, r = guess.exceeded.shape
    terms = Terms(guess.fixed, s.terms.given, s.terms.R, s.terms.Omega, p.linear, s.terms.b)
    for k in range(N):
        for i in range(4):
            terms.R[k, i] = p.R[i]
    fewest, patience, last = 4 * N * (r + 1), PATIENCE, N - 1
    for count in range(1, limit + 1):
        for k in range(last + 1):
            for i in range(4):
                terms.given[k, i] = p.upper[k, i] if guess.fixed[k, i] == AT_UPPER else p.lower[k, i]
                terms.b[k, i] = 0.0
            for q in range(r):
                terms.Omega[k, q] = 0.0
                if guess.exceeded[k, q]:
                    terms.Omega[k, q] = p.penalty
                    for i in range(4):
                        terms.b[k, i] -= p.penalty * p.limits[k, q] * p.rows[k, q, i]
        newton_step(p, terms, s.factors, s.u, s.w, last)
        smooth_gradient(p, s.u, s.w, s.gradient)
        changes, last = correct(p, guess, s.u, s.gradient)
        if changes == 0:
            return count
        if changes < fewest:
            fewest, patience = changes, PATIENCE
        elif patience == 0:
            return -count
        else:
            patience -= 1
    return -limit


@nested
def correct(p: StageQP, guess: Guess, u: Array, gradient: Array) -> tuple[int, int]:
    """Complete the gradient by the rows' share, correct the guess, and say in how many places and up to which stage."""
    N, r = guess.exceeded.shape
    changes, last = 0, -1
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
                changes, last = changes + 1, k
        for i in range(4):
            new = corrected(guess.fixed[k, i], u[k, i], p.lower[k, i], p.upper[k, i], gradient[k, i])
            if new != guess.fixed[k, i]:
                guess.fixed[k, i] = new
                changes, last = changes + 1, k
    return changes, last
