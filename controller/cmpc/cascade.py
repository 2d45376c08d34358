"""C-MPC: a second layer that corrects ZD+PD where it errs, saturates or would slip."""

from typing import NamedTuple

import numpy as np

from controller.belief import Friction, Gains, Gait, Law, WalkerModel
from controller.belief.friction import ROWS, UNLIMITED, cone, excess
from controller.belief.kernels import N_U
from controller.cmpc.prediction import CorrectedHorizon, Horizon, predict
from controller.compiled import Array, compiled
from controller.products import applied
from controller.qp import Solver, StageQP
from controller.qp.problem import failed
from controller.records import ControlStep, Observation, Status, Vector
from controller.settings import WeightSettings


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


class CascadedMpc(Law):
    """The paper's controller (`c-mpc`)."""

    def __init__(
        self,
        model: WalkerModel,
        gait: Gait,
        gains: Gains,
        *,
        N: int,
        T: float,
        weights: Weights,
        friction: Friction | None,
        solver: Solver,
    ) -> None:
        """Put the parts together.

        Args:
            model: The walker believed in; its torque limits are the box.
            gait: The outputs.
            gains: ZD+PD gains.
            N: Horizon in stages.
            T: Sampling time in [s].
            weights: Cost.
            friction: Contact-force limits, None to leave the friction rows out.
            solver: Solves Eq. (22).
        """
        super().__init__(model, gait, gains)
        self.N, self.T = N, T
        self.weights, self.friction, self.solver = weights, friction, solver

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        super().reset(stance)
        self.solver.reset()

    def step(self, observation: Observation) -> ControlStep:
        """One tick, as listed in Sec. III.D.

        Implements: Eq. (23).
        """
        state = self.stance.update(observation)  # which leg stands
        horizon = predict(self.loop, state, self.N, self.T)  # Eqs. (10)-(13)
        if horizon.is_finite:
            problem = build_problem(horizon, self.weights, self.model.torque_limits, self.friction)  # Eqs. (14)-(22)
            solution = self.solver.solve(problem)
        else:
            solution = failed(self.N, Status.PREDICTION_DIVERGED)
        u = horizon.u[0]
        limit = self.model.torque_limits
        if solution.found:
            u_mpc = solution.u[0]
        else:
            u_mpc = np.clip(u, -limit, limit) - u  # the one fall-back policy: saturated ZD+PD
        return self.held(
            ControlStep.of(
                state.leg,
                u + u_mpc,  # Eq. (23)
                u_zd=u,
                u_mpc=u_mpc,
                y=horizon.y[0],
                dy=horizon.dy[0],
                theta=horizon.theta,
                dtheta=horizon.dtheta,
                s=self.gait.normalised(horizon.theta),
                contact_force=horizon.force[0] + applied(horizon.force_per_torque[0], u_mpc),  # Eq. (20)
                impact_in=horizon.impact_in,
                status=solution.status,
                fallback=not solution.found,
                iterations=solution.iterations,
                residuals=solution.residuals,
                slack=solution.slack,
                active=solution.active,
                solve_s=solution.solve_s,
                plan=CorrectedHorizon(horizon=horizon, u_mpc=solution.u) if solution.found else None,
            )
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


@compiled
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
