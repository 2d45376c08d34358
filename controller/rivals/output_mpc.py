"""`output-mpc`: model predictive control of the linearised output dynamics under torque limits."""

from dataclasses import dataclass

import numpy as np
import qpsolvers
from scipy.linalg import solve_discrete_are

from controller.records import Vector
from controller.rivals import dense_qp
from controller.rivals.law import Decision
from controller.rivals.output_dynamics import OutputDynamics


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DoubleIntegrator:
    """One output over the horizon: (y, dy) at stages 1 to N from (y, dy) at stage 0 and v held over each stage.

    Attributes:
        A: Of one stage, (2, 2).
        B: Of one stage, (2,).
        free: From the state at stage 0, (N, 2, 2).
        forced: From v at each stage, (N, 2, N).
    """

    A: Vector
    B: Vector
    free: Vector
    forced: Vector

    @classmethod
    def over(cls, N: int, T: float) -> "DoubleIntegrator":
        """Args: N: stages; T: length of a stage in [s]."""
        A, B = np.array([[1.0, T], [0.0, 1.0]]), np.array([0.5 * T * T, T])
        free = np.array([np.linalg.matrix_power(A, k + 1) for k in range(N)])
        forced = np.zeros((N, 2, N))
        for k in range(N):
            if k > 0:
                forced[k] = A @ forced[k - 1]
            forced[k, :, k] = B
        return cls(A=A, B=B, free=free, forced=forced)


class OutputMpc:
    """The law."""

    def __init__(self, *, N: int, T: float, output: float, output_rate: float, limit: Vector) -> None:
        self.N, self.T, self.limit = N, T, limit
        plant = self.plant = DoubleIntegrator.over(N, T)
        stage = np.diag([output, output_rate])
        S = solve_discrete_are(plant.A, plant.B[:, None], stage, np.eye(1))
        weights = np.array([stage] * (N - 1) + [S])
        weighted = np.einsum("kin,kij->kjn", plant.forced, weights)
        self.H = np.eye(N) + np.einsum("kjn,kjm->nm", weighted, plant.forced)
        self.F = np.einsum("kjn,kjm->nm", weighted, plant.free)

    def decide(self, dynamics: OutputDynamics) -> Decision:
        answer = dense_qp.solve(self.problem(dynamics))
        v = dynamics.drift + dynamics.decoupling @ answer.x[:4]
        return Decision(
            v=v,
            found=answer.found,
            status="optimal",
            residuals=answer.residuals,
            slack=0.0,
            active=answer.active,
            solve_s=answer.solve_s,
        )

    def problem(self, dynamics: OutputDynamics) -> qpsolvers.Problem:
        A, b = dynamics.decoupling, dynamics.drift
        eta = np.stack([dynamics.y, dynamics.dy])
        linear = self.H.sum(axis=1)[:, None] * b + self.F @ eta  # (N, 4) on v
        bound = np.tile(self.limit, self.N)
        return qpsolvers.Problem(P=np.kron(self.H, A.T @ A), q=(linear @ A).ravel(), lb=-bound, ub=bound)
