"""Two solvers on the same problems, as a walk meets them: for the benchmark and for tests."""

import numpy as np

from controller.common.records import Vector
from controller.qp.problem import Solution, Solver, StageQP
from controller.qp.solvers import make_solver

REFINE_FROM = 1e-5  # [N.m] apart in the first torque
_AT_BOUND = 1e-4  # [N.m] what counts as sitting at a bound of the torque box


class ComparingSolver:
    """Walks on the answers of one solver and holds a second one's beside them.

    Attributes:
        problems: Number of problems so far.
        active: Problems with at least one active constraint.
        torque_gap: Largest difference of a first torque in [N.m].
        torque_gaps: That difference for every problem in [N.m].
        refined_gap: Largest difference after `refined` took the second solver's rounding away where the two were
            more than `REFINE_FROM` apart, in [N.m].
        objective_gap: Largest excess of the first solver's objective over the second's, relative.
        violation: Largest violation of the torque box by the first solver in [N.m].
        solve_s: Wall times of the first solver in [s].
        reference_s: Wall times of the second in [s], same order.
        kept: Every `keep_every`-th problem, for later use.
    """

    def __init__(self, solver: Solver, reference: Solver, *, keep_every: int = 25) -> None:
        """Args: solver: the one to walk on; reference: the one to compare with."""
        self._solver, self._reference, self._keep_every = solver, reference, keep_every
        self.problems = self.active = 0
        self.torque_gaps: list[float] = []
        self.refined_gap = 0.0
        self.objective_gap = self.violation = 0.0
        self.solve_s: list[float] = []
        self.reference_s: list[float] = []
        self.kept: list[StageQP] = []

    @property
    def torque_gap(self) -> float:
        """Largest difference of a first torque in [N.m]."""
        return max(self.torque_gaps, default=0.0)

    def reset(self) -> None:
        """Forget the last tick, not the statistics."""
        self._solver.reset()
        self._reference.reset()

    def solve(self, problem: StageQP) -> Solution:
        """Solve with both; the first one's answer counts."""
        solution, reference = self._solver.solve(problem), self._reference.solve(problem)
        if self.problems % self._keep_every == 0:
            self.kept.append(problem)
        self.problems += 1
        self.active += solution.active > 0
        self.solve_s.append(solution.solve_s)
        self.reference_s.append(reference.solve_s)
        if solution.found and reference.found:
            gap = float(np.abs(solution.u[0] - reference.u[0]).max())
            self.torque_gaps.append(gap)
            if gap > REFINE_FROM:
                gap = float(np.abs(solution.u[0] - refined(problem, reference.u)[0]).max())
            self.refined_gap = max(self.refined_gap, gap)
            best = problem.objective(reference.u)
            excess = (problem.objective(solution.u) - best) / max(abs(best), 1.0)
            self.objective_gap = max(self.objective_gap, excess)
        outside = np.maximum(problem.lower - solution.u, solution.u - problem.upper)
        self.violation = max(self.violation, float(outside.max()))
        return solution


def exact_clarabel(N: int) -> Solver:
    """Clarabel at tolerances of 1e-12, the reference; at 1e-9 its first torque is still off by up to 0.02 N.m."""
    from controller.qp.sparse import SparseSolver

    return SparseSolver("clarabel", N, tol_gap_abs=1e-12, tol_gap_rel=1e-12, tol_feas=1e-12)


def refined(problem: StageQP, u: Vector) -> Vector:
    """The optimum near a good answer, by dense linear algebra that shares nothing with `riccati`.

    An interior-point method stops short of the optimum by its tolerance. What is active at its answer tells the
    linear equations of the optimum; they are solved, and the active set is corrected until the signs of the
    multipliers confirm it.

    Args:
        problem: The problem.
        u: A good answer in [N.m], (N, 4).

    Returns:
        The confirmed optimum, or `u` itself where none is found in 20 corrections.
    """
    n, r = problem.N, problem.rows.shape[1]
    to_w = np.zeros((4 * n, 4 * n))  # w = to_w u, all stages stacked
    for j in range(n):
        to_w[4 * j :, 4 * j : 4 * j + 4] = np.tile(problem.rate[j], (n - j, 1))
    E = np.zeros((r * n, 4 * n))
    for k in range(n):
        E[r * k : r * k + r, 4 * k : 4 * k + 4] = problem.rows[k]
    H = to_w.T @ (problem.weight.reshape(-1, 1) * to_w) + np.diag(np.tile(problem.R, n))
    g = to_w.T @ problem.linear.ravel()
    lower, upper, limits = problem.lower.ravel(), problem.upper.ravel(), problem.limits.ravel()
    x = u.ravel().copy()
    low, high = x - lower < _AT_BOUND, upper - x < _AT_BOUND
    over = E @ x > limits
    for _ in range(20):
        matrix = H + problem.penalty * E[over].T @ E[over]
        rhs = problem.penalty * E[over].T @ limits[over] - g
        free = ~(low | high)
        x = np.where(low, lower, np.where(high, upper, 0.0))
        x[free] = np.linalg.solve(matrix[np.ix_(free, free)], (rhs - matrix[:, ~free] @ x[~free])[free])
        push = matrix @ x - rhs  # gradient: upwards cost at a lower bound, downwards at an upper one
        before = (low, high, over)
        low = np.where(free, x < lower, low & (push > 0.0))
        high = np.where(free, x > upper, high & (push < 0.0))
        over = E @ x > limits
        if all(np.array_equal(a, b) for a, b in zip(before, (low, high, over), strict=True)):
            return x.reshape(n, 4)
    return u


def compare_solvers(names: tuple[str, ...], problems: list[StageQP]) -> dict[str, dict[str, float]]:
    """Solvers on the same problems.

    Args:
        names: Solvers as `make_solver` knows them.
        problems: With the same number of stages.

    Returns:
        For each solver: "median_ms", "p99_ms", "gap_Nm" (largest difference of the first torque from the answer of
        least stationarity residual, which is `riccati`'s) and "failed".
    """
    N, r = problems[0].N, problems[0].rows.shape[1]
    exact = make_solver("riccati", N, r)
    answers = [exact.solve(problem).u[0] for problem in problems]
    table = {}
    for name in names:
        solver = make_solver(name, N, r)
        solver.solve(problems[0])
        solutions = [solver.solve(problem) for problem in problems]
        times = np.array([s.solve_s for s in solutions])
        gaps = [float(np.abs(s.u[0] - u).max()) for s, u in zip(solutions, answers, strict=True) if s.found]
        table[name] = {
            "median_ms": 1e3 * float(np.median(times)),
            "p99_ms": 1e3 * float(np.quantile(times, 0.99)),
            "gap_Nm": max(gaps, default=float("nan")),
            "failed": float(sum(not s.found for s in solutions)),
        }
    return table
