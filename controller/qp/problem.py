"""The solver boundary: a stage-structured problem in, a solution with status and residuals out.

The problem of Eq. (22) in its own structure. With w_k the MPC's share of the output rates at stage k,

    minimise   1/2 sum_{k=1..N} w_k' diag(W_k) w_k + l_k' w_k  +  1/2 sum_{k=0..N-1} u_k' diag(R) u_k
               + rho/2 sum_k |max(0, E_k u_k - d_k)|^2
    subject to w_0 = 0, w_{k+1} = w_k + M_k u_k,  lower_k <= u_k <= upper_k,

the u_k being the MPC's torques. The contact-force rows E_k u_k <= d_k are softened by a stiff quadratic penalty,
so the problem always has exactly one solution; the torque box is hard.
"""

import time
import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
import qpsolvers
import scipy.sparse as sp

from controller.compiled import Array
from controller.records import Status, Vector

_TORQUE_SCALE = 50.0  # [N.m] unit of u in the sparse form
_RATE_SCALE = 1.0  # [rad/s] unit of w
_FORCE_SCALE = 100.0  # [N] unit of the softening
_COST_SCALE = 1e4


class StageQP(NamedTuple):
    """One problem of Eq. (22); joints in stance order of each stage.

    Attributes:
        rate: M_k = T (D^-1 B)_k in [rad/s/(N.m)], (N, 4, 4).
        weight: Diagonal W_k on w_{k+1}, (N, 4).
        linear: l_k on w_{k+1}, (N, 4).
        R: Diagonal input weight, (4,).
        lower, upper: Torque box in [N.m], (N, 4).
        rows: E_k in [1/m], (N, r, 4); r = 0 is a problem without them.
        limits: d_k in [N], (N, r).
        penalty: rho in [1/N^2].
    """

    rate: Array
    weight: Array
    linear: Array
    R: Array
    lower: Array
    upper: Array
    rows: Array
    limits: Array
    penalty: float

    @property
    def N(self) -> int:
        """Number of stages."""
        return self.rate.shape[0]

    def softening(self, u: Vector) -> Vector:
        """By how much each contact-force row is exceeded under u (N, 4), in [N], (N, r)."""
        return np.maximum(np.einsum("krj,kj->kr", self.rows, u) - self.limits, 0.0)

    def objective(self, u: Vector) -> float:
        """Cost of u (N, 4)."""
        w = np.cumsum(np.einsum("kij,kj->ki", self.rate, u), axis=0)
        smooth = 0.5 * np.sum(self.weight * w * w) + np.sum(self.linear * w) + 0.5 * np.sum(self.R * u * u)
        return float(smooth + 0.5 * self.penalty * np.sum(self.softening(u) ** 2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """Answer to a `StageQP`.

    Attributes:
        found: Whether `u` may be used; look here first.
        u: MPC torques in [N.m], (N, 4); zeros if not found.
        status: "optimal", "second-solver" (one behind the one asked for), "no-solution" or "solver-error".
        iterations: Solver iterations, 0 where the solver does not tell.
        residuals: Feasibility, stationarity and complementarity (duality gap) of the scaled problem, (3,).
        slack: Largest softening in [N].
        active: Number of torques at a bound plus softened or touching contact-force rows.
        solve_s: Wall time in [s].
    """

    found: bool
    u: Vector
    status: Status
    iterations: int
    residuals: Vector
    slack: float
    active: int
    solve_s: float


class Solver(Protocol):
    """Solves the problems of consecutive ticks."""

    def reset(self) -> None:
        """Forget the last tick."""

    def solve(self, problem: StageQP) -> Solution:
        """Solve; never raises for a problem without solution, says `found=False` instead."""


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
        residuals = np.array([result.primal_residual(), result.dual_residual(), result.duality_gap()])
        info = (result.extras or {}).get("info")  # PIQP's; the adapters of others do not hand a count on
        return Solution(
            found=True,
            u=u,
            status=Status.OPTIMAL,
            iterations=int(getattr(info, "iter", 0)),
            residuals=residuals,
            slack=float(problem.softening(u).max(initial=0.0)),
            active=count_active(problem, u),
            solve_s=elapsed,
        )


def failed(N: int, status: Status, solve_s: float = 0.0) -> Solution:
    """A solution over N stages that must not be used."""
    return Solution(
        found=False,
        u=np.zeros((N, 4)),
        status=status,
        iterations=0,
        residuals=np.full(3, np.inf),
        slack=0.0,
        active=0,
        solve_s=solve_s,
    )


def count_active(problem: StageQP, u: Vector, *, torque_tol: float = 1e-4, force_tol: float = 1e-3) -> int:
    """Constraints that shape the answer: torques within `torque_tol` [N.m] of a bound, rows within `force_tol` [N]."""
    at_bound = (u - problem.lower < torque_tol) | (problem.upper - u < torque_tol)
    rows = np.einsum("krj,kj->kr", problem.rows, u) - problem.limits
    return int(at_bound.sum() + (rows > -force_tol).sum())
