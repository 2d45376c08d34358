"""The problem of Eq. (22) in the scaled sparse form that general solvers take, by qpsolvers: any of them by name."""

import time
import warnings
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

from controller.common.records import Status, Vector
from controller.qp.problem import Solution, StageQP, failed
from controller.qp.residuals import residuals_at

_TORQUE_SCALE = 50.0  # [N.m] unit of u in the sparse form
_RATE_SCALE = 1.0  # [rad/s] unit of w
_FORCE_SCALE = 100.0  # [N] unit of the softening
_COST_SCALE = 1e4
_AT_BOUND = 1e-4  # [N.m] what counts as sitting at a bound: interior-point methods stop short of it
_AT_LIMIT = 1e-3  # [N] the same of a contact-force row at its limit


class SparsePattern:
    """Where the numbers of a problem of N stages and r rows a stage go; only values change between ticks.

    Variables are stacked by kind: u (4 N), w (4 N), softening (r N).
    """

    def __init__(self, N: int, r: int) -> None:
        """Args: N: stages; r: contact-force rows a stage."""
        self.N, self.r = N, r
        self.n_u = self.n_w = 4 * N
        self.n_s = r * N
        self.n = self.n_u + self.n_w + self.n_s
        k, i, j = (a.ravel() for a in np.indices((N, 4, 4)))
        w = np.arange(self.n_w)
        # w_{k+1} - w_k - M_k u_k = 0
        self.A_rows = np.concatenate([w, w[4:], 4 * k + i])
        self.A_cols = self.n_u + np.concatenate([w, w[:-4], 4 * k + j - self.n_u])
        self.A_fixed = np.concatenate([np.ones(self.n_w), -np.ones(self.n_w - 4)])
        k, i, j = (a.ravel() for a in np.indices((N, r, 4)))
        s = np.arange(self.n_s)
        # E_k u_k - s_k <= d_k
        self.G_rows = np.concatenate([r * k + i, s])
        self.G_cols = np.concatenate([4 * k + j, self.n_u + self.n_w + s])


class SparseSolver:
    """Any solver of qpsolvers, by name, on the scaled sparse form."""

    def __init__(self, name: str, N: int, **options: Any) -> None:
        """Choose a solver.

        Args:
            name: A solver qpsolvers finds installed.
            N: Stages.
            options: Passed on to the solver, its own names.
        """
        self.name = name
        self._N = N
        self._options = options
        self._pattern = SparsePattern(N, 0)

    def sparse_form(self, problem: StageQP) -> qpsolvers.Problem:
        """The scaled problem in the form qpsolvers takes."""
        if self._pattern.r != problem.rows.shape[1]:
            self._pattern = SparsePattern(self._N, problem.rows.shape[1])
        at = self._pattern
        P = np.concatenate(
            [
                np.tile(problem.R * _TORQUE_SCALE**2, at.N),
                problem.weight.ravel() * _RATE_SCALE**2,
                np.full(at.n_s, problem.penalty * _FORCE_SCALE**2),
            ]
        )
        q = np.concatenate([np.zeros(at.n_u), problem.linear.ravel() * _RATE_SCALE, np.zeros(at.n_s)])
        rate = problem.rate.ravel() * _TORQUE_SCALE / _RATE_SCALE
        A = sp.csc_matrix((np.concatenate([at.A_fixed, -rate]), (at.A_rows, at.A_cols)), shape=(at.n_w, at.n))
        rows = problem.rows.ravel() * _TORQUE_SCALE / _FORCE_SCALE
        G = sp.csc_matrix((np.concatenate([rows, -np.ones(at.n_s)]), (at.G_rows, at.G_cols)), shape=(at.n_s, at.n))
        free, soft = np.full(at.n_w, np.inf), np.full(at.n_s, np.inf)
        return qpsolvers.Problem(
            P=sp.diags(P / _COST_SCALE, format="csc"),
            q=q / _COST_SCALE,
            G=G if at.r else None,
            h=problem.limits.ravel() / _FORCE_SCALE if at.r else None,
            A=A,
            b=np.zeros(at.n_w),
            lb=np.concatenate([problem.lower.ravel() / _TORQUE_SCALE, -free, -soft]),
            ub=np.concatenate([problem.upper.ravel() / _TORQUE_SCALE, free, soft]),
        )

    def reset(self) -> None:
        """Nothing is kept between ticks."""

    def solve(self, problem: StageQP) -> Solution:
        """Solve through qpsolvers."""
        start = time.perf_counter()
        qp = self.sparse_form(problem)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # adapters warn of what the status says anyway
                result = qpsolvers.solve_problem(qp, solver=self.name, **self._options)
        except qpsolvers.exceptions.QPError:
            return failed(self._N, Status.SOLVER_ERROR, time.perf_counter() - start)
        elapsed = time.perf_counter() - start
        if not result.found or result.x is None or not np.isfinite(result.x).all():
            return failed(self._N, Status.NO_SOLUTION, elapsed)
        # An interior-point answer may sit a rounding outside the box; the box is hard.
        u = result.x[: 4 * self._N].reshape(-1, 4) * _TORQUE_SCALE
        u = np.clip(u, problem.lower, problem.upper)
        info = (result.extras or {}).get("info")  # PIQP's; the adapters of others do not hand a count on
        return Solution(
            found=True,
            u=u,
            status=Status.OPTIMAL,
            iterations=int(getattr(info, "iter", 0)),
            residuals=np.array(residuals_at(problem, u, _AT_BOUND)[:3]),
            slack=float(problem.softening(u).max(initial=0.0)),
            active=count_active(problem, u),
            solve_s=elapsed,
        )


def count_active(problem: StageQP, u: Vector) -> int:
    """Constraints that shape the answer: torques at a bound, rows at their limit."""
    at_bound = (u - problem.lower < _AT_BOUND) | (problem.upper - u < _AT_BOUND)
    rows = np.einsum("krj,kj->kr", problem.rows, u) - problem.limits
    return int(at_bound.sum() + (rows > -_AT_LIMIT).sum())
