"""Small dense quadratic programs through qpsolvers: a problem in, an answer with its residuals out."""

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import qpsolvers

from controller.common.records import Status, Vector

SOLVER = "daqp"
FEASIBLE = 1e-3  # largest violation of a constraint, in its unit, by an answer that may be used
ACTIVE = 1e-9  # multiplier from which on a constraint counts as active


class Applied(NamedTuple):
    """The torque applied now as a problem sees it: u = offset + per_x x, within limits.

    Attributes:
        offset: In [N.m], (4,).
        per_x: (4, n).
        inverse: per_x P^-1, what a gradient in x is worth in torque, (4, n).
        limit: Torque limits in [N.m], (4,).
        row: First of the eight rows of G that hold u below, then above its limits; None where they are the box of x.
    """

    offset: Vector
    per_x: Vector
    inverse: Vector
    limit: Vector
    row: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """Answer to a `qpsolvers.Problem`.

    Attributes:
        found: Whether `x` may be used; look here first.
        x: Minimiser, zeros if not found.
        status: "optimal", or why there is none.
        residuals: Feasibility, stationarity and complementarity of the torque applied now in [N.m], (3,).
        active: Constraints with a multiplier.
        solve_s: Wall time in [s].
    """

    found: bool
    x: Vector
    status: Status
    residuals: Vector
    active: int
    solve_s: float


def solve(problem: qpsolvers.Problem, applied: Applied) -> Answer:
    """Solve a strictly convex problem with dense matrices; one without an answer is `found=False`, never an exception.

    DAQP is a dual active-set method and exact; on the rivals' problems it takes a quarter of the time of PIQP, the
    other dense solver at hand. qpsolvers hands no warm start on to it; there is little left to save.
    """
    started = time.perf_counter()
    result = qpsolvers.solve_problem(problem, SOLVER)
    elapsed = time.perf_counter() - started
    x = result.x
    # Where weights are too far apart an active-set method may take a point for feasible that is not.
    if x is None or not result.found or not result.primal_residual() <= FEASIBLE:
        return no_answer(len(problem.q), Status.NO_SOLUTION, elapsed)
    multipliers = [z for z in (result.z, result.z_box) if z is not None]
    return Answer(
        found=True,
        x=x,
        status=Status.OPTIMAL,
        residuals=residuals(problem, applied, result),
        active=sum(int(np.count_nonzero(np.abs(z) > ACTIVE)) for z in multipliers),
        solve_s=elapsed,
    )


def residuals(problem: qpsolvers.Problem, applied: Applied, solution: qpsolvers.Solution) -> Vector:
    """How far the torque applied now is from optimal in [N.m], (3,), as `controller.qp.residuals` has it.

    Feasibility is the torque beyond its limits; stationarity what the Lagrangian's gradient is worth in torque;
    complementarity, of a torque pushed at by its limit, the push or the distance that is left, whichever is smaller.
    """
    x, z, z_box = np.array(solution.x), np.array(solution.z), np.array(solution.z_box)
    gradient = problem.P @ x + problem.q
    if problem.G is not None:
        gradient = gradient + problem.G.T @ z
    if problem.lb is not None:
        gradient = gradient + z_box
    if applied.row is None:
        push = z_box[:4]
    else:
        above, below = z[applied.row : applied.row + 4], z[applied.row + 4 : applied.row + 8]
        push = above - below
    u = applied.offset + applied.per_x @ x
    push = np.abs(push) * (applied.inverse * applied.per_x).sum(axis=1)
    beyond = np.abs(u) - applied.limit
    return np.array(
        [max(0.0, beyond.max()), np.abs(applied.inverse @ gradient).max(), np.minimum(push, np.abs(beyond)).max()]
    )


def no_answer(n: int, status: Status, solve_s: float = 0.0) -> Answer:
    """An answer in n variables that must not be used."""
    return Answer(found=False, x=np.zeros(n), status=status, residuals=np.full(3, np.inf), active=0, solve_s=solve_s)
