"""The solver `riccati`: the problem of Eq. (22) by its own structure, many times inside a millisecond.

Active-set sweeps from the guess of the last tick settle nearly every tick (`active_set`). Where they cycle, the
interior-point method (`interior_point`) finds the answer, warm in a run of such ticks, and its active set gives the
sweeps their next guess. Both rest on the same linear algebra (`riccati`).

Why not HPIPM or acados, which exist for this: their stage is a general one (dense dynamics, slacks as variables,
inequalities with a slack each), set up and solved by an interior-point method from C, 10 to 15 iterations with a
factorisation each. Here the dynamics are w + M u with as many states as torques, a softened row needs no variable, and
the active set of the last tick is nearly always right, so that a tick is one or two sweeps. They would also bring a
C build with BLASFEO kernels chosen by processor, and with it answers that differ from machine to machine in the last
bits; the same bytes everywhere are what replay and the tests rest on.
"""

import dataclasses
import time
from typing import NamedTuple

import numpy as np

from controller.compiled import Array, compiled
from controller.qp import active_set, interior_point
from controller.qp.active_set import Guess
from controller.qp.interior_point import Point
from controller.qp.problem import Solution, Solver, StageQP, failed
from controller.qp.residuals import Residuals, residuals
from controller.qp.riccati import Factors, new_factors, rates, smooth_gradient
from controller.records import Status

EASY_SWEEPS, HARD_SWEEPS, POLISH_SWEEPS = 8, 1, 4  # most sweeps: as a rule, after a hard tick, after interior point
INTERIOR_ITERATIONS = 40
INTERIOR_TOLERANCES = (1e-5, 1e-7, 1e-10)  # relative; what is active shows at the first in most cases
STATIONARY = 1e-4  # [N.m] residual of an answer that may be used
AT_BOUND = 1e-7  # [N.m] what counts as sitting at a bound


class State(NamedTuple):
    """What the solver keeps between ticks."""

    guess: Guess
    point: Point
    u: Array
    w: Array
    gradient: Array
    factors: Factors


class RiccatiSolver:
    """Solves every tick's problem; one that it cannot settle goes to the next solver in line, and is counted.

    Attributes:
        state: What it keeps between ticks.
        hard: Whether the last tick needed the interior-point method.
    """

    def __init__(self, N: int, r: int, fallbacks: tuple[Solver, ...]) -> None:
        """Make room.

        Args:
            N: Stages.
            r: Contact-force rows a stage.
            fallbacks: Tried in order where this one fails.
        """
        self._N, self._r = N, r
        self._fallbacks = fallbacks
        self.reset()

    def reset(self) -> None:
        """Forget the last tick."""
        N, r = self._N, self._r
        guess = Guess(np.zeros((N, 4), dtype=np.int8), np.zeros((N, r), dtype=np.bool_))
        u, w, gradient = np.zeros((3, N, 4))
        self.state = State(guess, interior_point.new_point(N, r), u, w, gradient, new_factors(N))
        self.hard = False

    def solve(self, problem: StageQP) -> Solution:
        """Solve one tick's problem, starting from the answer to the last one."""
        started = time.perf_counter()
        state = self.state
        iterations, self.hard, checks = advance(problem, state, self.hard)
        if not good(checks):
            return self.next_in_line(problem, started)
        return Solution(
            found=True,
            u=state.u.copy(),
            status=Status.OPTIMAL,
            iterations=iterations,
            residuals=np.array(checks[:3]),
            slack=checks.slack,
            active=checks.active,
            solve_s=time.perf_counter() - started,
        )

    def next_in_line(self, problem: StageQP, started: float) -> Solution:
        """Hand a problem on that has taken since `started` in [s]."""
        self.reset()
        for solver in self._fallbacks:
            solution = solver.solve(problem)
            if solution.found:
                elapsed = time.perf_counter() - started
                return dataclasses.replace(solution, status=Status.SECOND_SOLVER, solve_s=elapsed)
        return failed(self._N, Status.NO_SOLUTION, time.perf_counter() - started)


@compiled
def good(checks: Residuals) -> bool:
    """Whether an answer may be used; NaN is not."""
    return checks.stationarity <= STATIONARY and checks.feasibility <= AT_BOUND


@compiled
def advance(p: StageQP, s: State, hard: bool) -> tuple[int, bool, Residuals]:
    """Answer one tick's problem into `s.u`.

    Args:
        p: StageQP.
        s: State from the last tick.
        hard: Whether the last tick needed the interior-point method.

    Returns:
        Sweeps and iterations taken, whether this tick needed the interior-point method, and `residuals`.
    """
    active_set.shift(s.guess)
    limit = HARD_SWEEPS if hard else EASY_SWEEPS
    sweeps = active_set.iterate(p, s.guess, s.u, s.w, s.gradient, s.factors, limit)
    if sweeps > 0:
        return sweeps, False, residuals(p, s.u, s.gradient, AT_BOUND)
    total = limit
    polish = -1
    scale = interior_point.start(p, s.point, hard, s.w, s.gradient)
    for tolerance in INTERIOR_TOLERANCES:
        total += abs(
            interior_point.minimise(p, s.point, scale, s.w, s.gradient, s.factors, tolerance, INTERIOR_ITERATIONS)
        )
        interior_point.identify(p, s.point, s.guess)
        polish = active_set.iterate(p, s.guess, s.u, s.w, s.gradient, s.factors, POLISH_SWEEPS)
        total += abs(polish)
        if polish > 0:
            break
    if polish < 0:
        for k in range(s.u.shape[0]):
            for i in range(4):
                s.u[k, i] = s.point.u[k, i]
        rates(p, s.u, s.w)
        smooth_gradient(p, s.u, s.w, s.gradient)
        interior_point.identify(p, s.point, s.guess)
        active_set.correct(p, s.guess, s.u, s.gradient)
    return total, True, residuals(p, s.u, s.gradient, AT_BOUND)
