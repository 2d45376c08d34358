"""Small dense quadratic programs through qpsolvers: a problem in, an answer with its residuals out."""

import time
from dataclasses import dataclass

import numpy as np
import qpsolvers

from controller.records import Status, Vector

SOLVER = "daqp"
FEASIBLE = 1e-3  # largest violation of a constraint, in its unit, by an answer that may be used
ACTIVE = 1e-9  # multiplier from which on a constraint counts as active


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """Answer to a `qpsolvers.Problem`.

    Attributes:
        found: Whether `x` may be used; look here first.
        x: Minimiser, zeros if not found.
        status: "optimal", or why there is none.
        residuals: Primal residual, dual residual and duality gap, (3,).
        active: Constraints with a multiplier.
        solve_s: Wall time in [s].
    """

    found: bool
    x: Vector
    status: Status
    residuals: Vector
    active: int
    solve_s: float


def solve(problem: qpsolvers.Problem) -> Answer:
    """Solve a strictly convex problem with dense matrices; one without an answer is `found=False`, never an exception.

    DAQP is a dual active-set method and exact; on the rivals' problems it takes a quarter of the time of PIQP, the
    other dense solver at hand. qpsolvers hands no warm start on to it; there is little left to save.
    """
    started = time.perf_counter()
    result = qpsolvers.solve_problem(problem, SOLVER)
    elapsed = time.perf_counter() - started
    x = result.x
    residuals = np.array([result.primal_residual(), result.dual_residual(), result.duality_gap()])
    # Where weights are too far apart an active-set method may take a point for feasible that is not.
    if x is None or not result.found or not residuals[0] <= FEASIBLE:
        return no_answer(len(problem.q), Status.NO_SOLUTION, elapsed)
    multipliers = [z for z in (result.z, result.z_box) if z is not None]
    return Answer(
        found=True,
        x=x,
        status=Status.OPTIMAL,
        residuals=residuals,
        active=sum(int(np.count_nonzero(np.abs(z) > ACTIVE)) for z in multipliers),
        solve_s=elapsed,
    )


def no_answer(n: int, status: Status, solve_s: float = 0.0) -> Answer:
    """An answer in n variables that must not be used."""
    return Answer(found=False, x=np.zeros(n), status=status, residuals=np.full(3, np.inf), active=0, solve_s=solve_s)
