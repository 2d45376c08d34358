"""Two solvers on the same problems, as a walk meets them: for the benchmark and for tests."""

import numpy as np

from controller.qp import Solution, Solver, SparseSolver, StageQP
from controller.solvers import make_solver


class ComparingSolver:
    """Walks on the answers of one solver and holds a second one's beside them.

    Attributes:
        problems: Number of problems so far.
        active: Problems with at least one active constraint.
        torque_gap: Largest difference of a first torque in [N.m].
        torque_gaps: That difference for every problem in [N.m].
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
            self.torque_gaps.append(float(np.abs(solution.u[0] - reference.u[0]).max()))
            best = problem.objective(reference.u)
            gap = (problem.objective(solution.u) - best) / max(abs(best), 1.0)
            self.objective_gap = max(self.objective_gap, gap)
        outside = np.maximum(problem.lower - solution.u, solution.u - problem.upper)
        self.violation = max(self.violation, float(outside.max()))
        return solution


def exact_clarabel(N: int) -> Solver:
    """Clarabel at tolerances of 1e-12, the reference; at 1e-9 its first torque is still off by up to 0.02 N.m."""
    return SparseSolver("clarabel", N, tol_gap_abs=1e-12, tol_gap_rel=1e-12, tol_feas=1e-12)


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
