"""The quadratic program over the MPC's torques, Eqs. (14)-(22)."""

from typing import NamedTuple

import numpy as np

from controller.belief import Friction, Gains
from controller.belief.friction import ROWS, UNLIMITED, cone, excess
from controller.belief.kernels import N_U
from controller.cmpc.prediction import Horizon
from controller.common.compiled import Array, nested
from controller.common.records import Vector
from controller.common.settings import WeightSettings
from controller.qp import StageQP


class Weights(NamedTuple):
    """Cost of Eq. (16) on e = (y, dy) and u_tilde; stage k counts k times (Sec. III.E).

    Attributes:
        Q_position: Diagonal of the weight on y, (4,).
        Q_velocity: Diagonal of the weight on dy, (4,).
        R: Diagonal of the weight on u_tilde, (4,).
    """

    Q_position: Array
    Q_velocity: Array
    R: Array

    @classmethod
    def of_paper(cls, gains: Gains, T: float) -> "Weights":
        """Q = diag(2 K_P / T^2, K_D / T) and R = I, Sec. III.E."""
        return cls(Q_position=2.0 * gains.kp / T**2, Q_velocity=gains.kd / T, R=np.ones(4))

    def times(self, factors: WeightSettings) -> "Weights":
        """These weights with the factors of a scenario on them."""
        return Weights(
            Q_position=np.array(factors.output) * self.Q_position,
            Q_velocity=np.array(factors.output_rate) * self.Q_velocity,
            R=np.array(factors.torque) * self.R,
        )


def build_problem(horizon: Horizon, weights: Weights, limit: Vector, friction: Friction | None) -> StageQP:
    """The quadratic program over the MPC's torques.

    Implements: Eqs. (14)-(17), (19), (21)-(22).

    Every predicted error depends on the torques through their sum alone (Eq. (15)): with
    w_k = sum_{j<k} T (D^-1 B)_j u_tilde_j, the error is e_k = (y_k + T/2 w_k, dy_k + w_k). This is taken
    literally through predicted impacts, where "stance hip" passes from one leg to the other: w is added to the
    errors of the roles, not of the legs. (Exchanging w with the legs was tried; it makes C-MPC fall under 40 N.)

    Args:
        horizon: Partial prediction.
        weights: Cost on errors and inputs.
        limit: Torque limits in [N.m], (4,): hips, then knees.
        friction: Contact-force limits, None for none.
    """
    N, r = horizon.u.shape[0], 0 if friction is None else ROWS
    friction = UNLIMITED if friction is None else friction
    e = np.empty
    problem = StageQP(
        rate=horizon.rate_per_torque,
        weight=e((N, 4)),
        linear=e((N, 4)),
        R=weights.R,
        lower=e((N, 4)),
        upper=e((N, 4)),
        rows=e((N, r, 4)),
        limits=e((N, r)),
        penalty=friction.penalty,
    )
    fill(horizon, weights, limit, friction, problem)
    return problem


@nested
def fill(horizon: Horizon, weights: Weights, limit: Array, friction: Friction, out: StageQP) -> None:
    """All numbers of the problem that are not the horizon's own or the same in every tick."""
    T, Qp, Qd = horizon.T, weights.Q_position, weights.Q_velocity
    N, r = out.limits.shape
    for k in range(N):
        for i in range(N_U):
            # Cost of the error stack in w, Eqs. (14)-(17); stage k counts k times.
            out.weight[k, i] = (k + 1) * (0.25 * T * T * Qp[i] + Qd[i])
            out.linear[k, i] = (k + 1) * (0.5 * T * Qp[i] * horizon.y[k + 1, i] + Qd[i] * horizon.dy[k + 1, i])
            out.lower[k, i] = -limit[i] - horizon.u[k, i]  # Eq. (19)
            out.upper[k, i] = limit[i] - horizon.u[k, i]
        if r > 0:
            for j in range(N_U):  # Eq. (21)
                per_torque = cone(friction, horizon.force_per_torque[k, 0, j], horizon.force_per_torque[k, 1, j])
                out.rows[k, 0, j], out.rows[k, 1, j], out.rows[k, 2, j] = per_torque
            beyond = excess(friction, horizon.force[k])
            out.limits[k, 0], out.limits[k, 1], out.limits[k, 2] = -beyond[0], -beyond[1], -beyond[2]
