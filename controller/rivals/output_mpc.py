"""`output-mpc`: model predictive control of the linearised output dynamics, within the torque limits.

The kind of controller the paper calls MPC around linearised output dynamics ([8], [9] there): after feedback
linearisation, Eqs. (6)-(8), every output is a double integrator, ddy_i = v_i, and the plan is made for these alone;
ground, impacts and the clock's own dynamics are not in it. The torque limits are, through v = L_f^2 h + L_g L_f h u,
with both terms as they are now over the whole horizon:

    minimise    sum_{k=1..N-1} (q |y_k|^2 + q' |dy_k|^2) + sum_{k=0..N-1} |v_k|^2 + [y_N; dy_N]' S [y_N; dy_N]
    subject to  v_k = L_f^2 h + L_g L_f h u_k,  -u_max <= u_k <= u_max

and S solves the Riccati equation of the same cost, so that without a torque at its limit the first v is that of the
linear-quadratic regulator whatever N is. In the u_k the only constraints are bounds: there always is a plan.

Tuning (`controller.rivals` says on what): q = 3e7 and q' = 3e4 are the least weights within 5 % of the least mean RMS,
1.0 mrad, of q from 3e3 to 1e8 and q' from 0 to 3e4. Horizons from 10 to 100 ms, of 5 to 20 stages, differ by less than
that; N = 10 and T = 5 ms are in their middle.
"""

from dataclasses import dataclass

import numpy as np
import qpsolvers
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from controller.common.records import Vector
from controller.common.settings import OutputMpcSettings
from controller.rivals import dense_qp
from controller.rivals.dense_qp import Applied
from controller.rivals.law import Decision
from controller.rivals.output_dynamics import OutputDynamics


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DoubleIntegrator:
    """An output over the horizon: (y, dy) at stages 1 to N is free (y_0, dy_0) + forced v, v held over each stage.

    Attributes:
        A, B: Of one stage, (2, 2) and (2, 1).
        free: (N, 2, 2).
        forced: (N, 2, N).
    """

    A: Vector
    B: Vector
    free: Vector
    forced: Vector

    @classmethod
    def over(cls, N: int, T: float) -> "DoubleIntegrator":
        """Args: N: stages; T: length of a stage in [s]."""
        A, B = np.array([[1.0, T], [0.0, 1.0]]), np.array([[0.5 * T * T], [T]])
        free, forced = np.empty((N, 2, 2)), np.zeros((N, 2, N))
        reached, response = np.eye(2), np.zeros((2, N))
        for k in range(N):
            reached, response = A @ reached, A @ response
            response[:, k] += B[:, 0]
            free[k], forced[k] = reached, response
        return cls(A=A, B=B, free=free, forced=forced)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputPlan:
    """What is expected over the horizon, told tick by tick.

    Attributes:
        dynamics: At the present state.
        u: Planned torques in [N.m], (N, 4).
        T: Length of a stage in [s].
        period: Length of a tick in [s].
    """

    dynamics: OutputDynamics
    u: Vector
    T: float
    period: float

    def outputs(self) -> Vector:
        """Predicted outputs in [rad], (ticks + 1, 4)."""
        v = self.dynamics.drift + self.u @ self.dynamics.decoupling.T
        y, dy = [self.dynamics.y], [self.dynamics.dy]
        for now in v:
            y.append(y[-1] + self.T * dy[-1] + 0.5 * self.T**2 * now)
            dy.append(dy[-1] + self.T * now)
        t, stage = self._ticks(1)
        since = (t - self.T * stage)[:, None]
        return np.array(y)[stage] + since * np.array(dy)[stage] + 0.5 * since**2 * v[stage]

    def contact_forces(self) -> Vector:
        """Predicted stance contact forces, (tangential, normal) in [N], (ticks, 2)."""
        _, stage = self._ticks(0)
        return self.dynamics.force + self.u[stage] @ self.dynamics.force_per_torque.T

    def _ticks(self, end: int) -> tuple[Vector, NDArray[np.intp]]:
        """Time of each tick in [s], and the stage it lies in; the end belongs to the last."""
        N = len(self.u)
        t = self.period * np.arange(int(N * self.T / self.period + 1e-9) + end).astype(float)
        return t, np.minimum((t / self.T + 1e-9).astype(np.intp), N - 1)


class OutputMpc:
    """The law: the first torque of the plan."""

    def __init__(self, settings: OutputMpcSettings, *, limit: Vector, period: float) -> None:
        """Work out what is the same at every tick.

        Args:
            settings: N, T, and the weights q and q'.
            limit: Torque limits in [N.m], (4,).
            period: Length of a tick in [s].
        """
        N, T = settings.stages, settings.stage_time
        self.N, self.T, self.limit, self.period = N, T, limit, period
        self.integrator = DoubleIntegrator.over(N, T)
        free, forced = self.integrator.free, self.integrator.forced
        weight = np.diag([settings.output, settings.output_rate])
        S = solve_discrete_are(self.integrator.A, self.integrator.B, weight, np.eye(1))
        weighted = np.einsum("kij,kin->njk", np.array([weight] * (N - 1) + [S]), forced)  # (N, 2, N)
        # Cost of one output: v' quadratic v + 2 v' linear (y_0, dy_0) + constant.
        self.quadratic = np.eye(N) + np.einsum("njk,kjm->nm", weighted, forced)
        self.linear = np.einsum("njk,kjm->nm", weighted, free)
        self.inverse = np.linalg.inv(self.quadratic)[:1]  # (1, N)
        self.first = np.eye(4, 4 * N)  # the first torque among all

    def decide(self, dynamics: OutputDynamics) -> Decision:
        """Build and solve the QP of one tick."""
        A = dynamics.decoupling
        inverse = np.kron(self.inverse, np.linalg.inv(A.T @ A))  # of the cost, (4, 4 N): rows of the first torque
        answer = dense_qp.solve(self.problem(dynamics), Applied(np.zeros(4), self.first, inverse, self.limit))
        u = answer.x.reshape(self.N, 4)
        return Decision(
            v=dynamics.drift + dynamics.decoupling @ u[0],
            answer=answer,
            plan=OutputPlan(dynamics=dynamics, u=u, T=self.T, period=self.period) if answer.found else None,
        )

    def problem(self, dynamics: OutputDynamics) -> qpsolvers.Problem:
        """The QP over the torques, stage by stage."""
        A, b = dynamics.decoupling, dynamics.drift
        eta = np.stack([dynamics.y, dynamics.dy])
        on_v = self.quadratic.sum(axis=1)[:, None] * b + self.linear @ eta  # (N, 4), at u = 0
        bound = np.tile(self.limit, self.N)
        return qpsolvers.Problem(P=np.kron(self.quadratic, A.T @ A), q=(on_v @ A).ravel(), lb=-bound, ub=bound)
