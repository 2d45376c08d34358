"""Small dense quadratic programs through qpsolvers: a problem in, an answer with its residuals out."""

import time
from dataclasses import dataclass

import numpy as np
import qpsolvers

from controller.records import Vector

SOLVER = "daqp"
FEASIBLE = 1e-3  # largest violation of a constraint, in its unit, by an answer that may be used
ACTIVE = 1e-9  # multiplier from which on a constraint counts as active


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """Answer to a `qpsolvers.Problem`.

    Attributes:
        found: Whether `x` may be used; look here first.
        x: Minimiser, zeros if not found.
        residuals: Primal residual, dual residual and duality gap, (3,).
        active: Constraints with a multiplier.
        solve_s: Wall time in [s].
    """

    found: bool
    x: Vector
    residuals: Vector
    active: int
    solve_s: float


def solve(problem: qpsolvers.Problem, solver: str = SOLVER) -> Answer:
    """Solve a strictly convex problem; one without an answer is `found=False`, never an exception.

    Args:
        problem: With dense matrices.
        solver: A dense solver by its name in qpsolvers.
    """
    started = time.perf_counter()
    result = qpsolvers.solve_problem(problem, solver)
    elapsed = time.perf_counter() - started
    residuals = np.array([result.primal_residual(), result.dual_residual(), result.duality_gap()])
    # An active-set method may stop at a point it takes for feasible when the weights are too far apart.
    x = result.x
    if x is None or not result.found or not residuals[0] <= FEASIBLE:
        return Answer(found=False, x=np.zeros(problem.q.shape), residuals=np.full(3, np.inf), active=0, solve_s=elapsed)
    multipliers = [z for z in (result.z, result.z_box) if z is not None]
    return Answer(
        found=True,
        x=x,
        residuals=residuals,
        active=sum(int(np.count_nonzero(np.abs(z) > ACTIVE)) for z in multipliers),
        solve_s=elapsed,
    )
