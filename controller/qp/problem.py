"""The solver boundary: a stage-structured problem in, a solution with status and residuals out.

The problem of Eq. (22) in its own structure. With w_k the MPC's share of the output rates at stage k,

    minimise   1/2 sum_{k=1..N} w_k' diag(W_k) w_k + l_k' w_k  +  1/2 sum_{k=0..N-1} u_k' diag(R) u_k
               + rho/2 sum_k |max(0, E_k u_k - d_k)|^2
    subject to w_0 = 0, w_{k+1} = w_k + M_k u_k,  lower_k <= u_k <= upper_k,

the u_k being the MPC's torques. The contact-force rows E_k u_k <= d_k are softened by a stiff quadratic penalty,
so the problem always has exactly one solution; the torque box is hard.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from controller.common.compiled import Array
from controller.common.records import Status, Vector


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
        residuals: Feasibility, stationarity and complementarity in [N.m], (3,); see `residuals.Residuals`.
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
