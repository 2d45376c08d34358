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
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.common.compiled import compile_for, nested, spliced
from controller.common.records import Status
from controller.qp import active_set, interior_point, riccati
from controller.qp.active_set import Guess, Sweep
from controller.qp.interior_point import Newton, Point
from controller.qp.problem import Solution, Solver, StageQP, failed
from controller.qp.residuals import Residuals, residuals
from controller.qp.riccati import rates, smooth_gradient

SWEEPS, POLISH_SWEEPS = 12, 6  # at most: at first, and from what the interior-point method says is active
INTERIOR_ITERATIONS = 40
INTERIOR_TOLERANCES = (1e-5, 1e-7, 1e-10)  # relative; what is active shows at the first in most cases
STATIONARY = 1e-4  # [N.m] residual of an answer that may be used
AT_BOUND = 1e-7  # [N.m] what counts as sitting at a bound


class State(NamedTuple):
    """What the solver keeps between ticks, and its room.

    Attributes:
        guess: What was active at the last answer.
        point: Of the last interior-point iteration.
        sweep: The last answer.
        newton: Room of the interior-point method.
        hard: Whether the last tick needed that, (1,).
    """

    guess: Guess
    point: Point
    sweep: Sweep
    newton: Newton
    hard: NDArray[np.bool_]


def new_state(N: int, r: int) -> State:
    """Room for N stages with r contact-force rows each, and nothing remembered."""
    guess = Guess(np.zeros((N, 4), dtype=np.int8), np.zeros((N, r), dtype=np.bool_))
    newton = interior_point.new_newton(N, r)
    sweep = active_set.new_sweep(N, riccati.new_terms(N, r))
    return State(guess, interior_point.new_point(N, r), sweep, newton, np.zeros(1, dtype=np.bool_))


class RiccatiSolver:
    """Solves every tick's problem; one that it cannot settle goes to the next solver in line, and is counted.

    Attributes:
        state: What it keeps between ticks.
    """

    def __init__(self, N: int, r: int, fallbacks: Iterable[Solver]) -> None:
        """Make room.

        Args:
            N: Stages.
            r: Contact-force rows a stage.
            fallbacks: Tried in order where this one fails.
        """
        self._N = N
        self._fallbacks = fallbacks
        self.state = new_state(N, r)

    def reset(self) -> None:
        """Forget the last tick; what is bound to `state` stays so."""
        _clear(self.state)

    def solve(self, problem: StageQP) -> Solution:
        """Solve one tick's problem, starting from the answer to the last one."""
        started = time.perf_counter()
        iterations, checks = advance(problem, self.state)
        if not good(checks):
            return self.next_in_line(problem, started)
        return Solution(
            found=True,
            u=self.state.sweep.u.copy(),
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


def _clear(arrays: Any) -> None:
    for one in arrays:
        if isinstance(one, tuple):
            _clear(one)
        else:
            one[...] = 0


def compile_kernels() -> None:
    """Compile what a solve calls, for a problem of one stage."""
    N, r = 1, 3
    e = np.zeros
    p = StageQP(
        e((N, 4, 4)), np.ones((N, 4)), e((N, 4)), np.ones(4), e((N, 4)) - 1.0, e((N, 4)) + 1.0, e((N, r, 4)),
        np.ones((N, r)), 1.0,
    )  # fmt: skip
    s = new_state(N, r)
    compile_for(active_set.iterate, p, s.guess, s.sweep, SWEEPS)
    compile_for(residuals, p, s.sweep.u, s.sweep.gradient, AT_BOUND)
    compile_for(interior_point.start, p, s.point, True, s.newton)
    compile_for(interior_point.minimise, p, s.point, 1.0, s.newton, 1e-5, INTERIOR_ITERATIONS)
    compile_for(interior_point.identify, p, s.point, s.guess)
    compile_for(active_set.correct, p, s.guess, s.sweep.u, s.sweep.gradient)


@nested
def good(checks: Residuals) -> bool:
    """Whether an answer may be used; NaN is not."""
    return checks.stationarity <= STATIONARY and checks.feasibility <= AT_BOUND


@spliced
def advance(p: StageQP, s: State) -> tuple[int, Residuals]:
    """Answer one tick's problem into `s.sweep.u`.

    Args:
        p: Problem.
        s: State from the last tick.

    Returns:
        Sweeps and iterations taken, and the answer's residuals.
    """
    u, w, gradient = s.sweep.u, s.sweep.w, s.sweep.gradient
    active_set.shift(s.guess)
    total = active_set.iterate(p, s.guess, s.sweep, SWEEPS)
    if total > 0:
        s.hard[0] = False
        return total, residuals(p, u, gradient, AT_BOUND)
    total = -total
    polish = -1
    scale = interior_point.start(p, s.point, s.hard[0], s.newton)
    s.hard[0] = True
    for tolerance in INTERIOR_TOLERANCES:
        total += abs(interior_point.minimise(p, s.point, scale, s.newton, tolerance, INTERIOR_ITERATIONS))
        interior_point.identify(p, s.point, s.guess)
        polish = active_set.iterate(p, s.guess, s.sweep, POLISH_SWEEPS)
        total += abs(polish)
        if polish > 0:
            break
    if polish < 0:
        for k in range(u.shape[0]):
            for i in range(4):
                u[k, i] = s.point.u[k, i]
        rates(p, u, w)
        smooth_gradient(p, u, w, gradient)
        interior_point.identify(p, s.point, s.guess)
        active_set.correct(p, s.guess, u, gradient)
    return total, residuals(p, u, gradient, AT_BOUND)
