"""C-MPC: a second layer that corrects ZD+PD where it errs, saturates or would slip."""

from dataclasses import dataclass

import numpy as np

from controller.belief import Gait, StanceEstimator, WalkerModel, kernels
from controller.cmpc.prediction import CorrectedHorizon, Horizon, predict
from controller.compiled import compiled
from controller.qp import Solver, StageQP
from controller.qp.problem import ROWS, failed
from controller.records import ControlStep, Observation, Status, Vector
from controller.settings import WeightSettings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weights:
    """Cost of Eq. (16) on e = (y, dy) and u_tilde; stage k counts k times (Sec. III.E).

    Attributes:
        Q_position: Diagonal of the weight on y, (4,).
        Q_velocity: Diagonal of the weight on dy, (4,).
        R: Diagonal of the weight on u_tilde, (4,).
    """

    Q_position: Vector
    Q_velocity: Vector
    R: Vector

    @classmethod
    def of_paper(cls, gains: kernels.Gains, T: float) -> "Weights":
        """Q = diag(2 K_P / T^2, K_D / T) and R = I, Sec. III.E."""
        return cls(Q_position=2.0 * gains.kp / T**2, Q_velocity=gains.kd / T, R=np.ones(4))

    def times(self, factors: WeightSettings) -> "Weights":
        """These weights with the factors of a scenario on them."""
        return Weights(
            Q_position=np.array(factors.output) * self.Q_position,
            Q_velocity=np.array(factors.output_rate) * self.Q_velocity,
            R=np.array(factors.torque) * self.R,
        )


PENALTY = 1e5  # [1/N^2] of a softened contact-force row


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction:
    """Contact-force limits of Eq. (21).

    Attributes:
        mu: Friction coefficient the controller counts on.
        normal_min: Least normal force in [N]; it keeps Eq. (21) linear.
        penalty: Cost of a softened row in [1/N^2]; large enough that a row gives way only where the torque box
            leaves no choice.
    """

    mu: float
    normal_min: float
    penalty: float = PENALTY


class CascadedMpc:
    """The paper's controller (`c-mpc`)."""

    def __init__(
        self,
        model: WalkerModel,
        gait: Gait,
        gains: kernels.Gains,
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
        self.model, self.gait, self.gains = model, gait, gains
        self.N, self.T = N, T
        self.weights, self.friction, self.solver = weights, friction, solver
        self.stance = StanceEstimator(model)

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        self.stance.reset(stance)
        self.solver.reset()

    def follow(self, gait: Gait, rate_change: Vector) -> None:
        """Follow another gait from now on; its nominal clock rate does not matter here."""
        self.gait = gait

    def step(self, observation: Observation) -> ControlStep:
        """One tick, as listed in Sec. III.D.

        Implements: Eq. (23).
        """
        state = self.stance.update(observation)  # which leg stands
        horizon = predict(self.model, self.gait, self.gains, state, self.N, self.T)  # Eqs. (10)-(13)
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
        u_total = u + u_mpc  # Eq. (23)
        return ControlStep(
            stance=state.leg.value,
            u_zd=state.leg.from_body(u),
            u_mpc=state.leg.from_body(u_mpc),
            u_total=state.leg.from_body(u_total),
            y=horizon.y[0],
            dy=horizon.dy[0],
            theta=horizon.theta,
            dtheta=horizon.dtheta,
            s=self.gait.normalised(horizon.theta),
            contact_force=horizon.force[0] + horizon.force_per_torque[0] @ u_mpc,  # Eq. (20)
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
    N = horizon.u.shape[0]
    rows = 0 if friction is None else ROWS
    problem = StageQP(
        rate=horizon.rate_per_torque,
        weight=np.empty((N, 4)),
        linear=np.empty((N, 4)),
        R=weights.R,
        lower=np.empty((N, 4)),
        upper=np.empty((N, 4)),
        rows=np.empty((N, rows, 4)),
        limits=np.empty((N, rows)),
        penalty=0.0 if friction is None else friction.penalty,
    )
    mu, normal_min = (0.0, 0.0) if friction is None else (friction.mu, friction.normal_min)
    _fill(
        horizon.T, horizon.y, horizon.dy, horizon.u, horizon.force, horizon.force_per_torque, weights.Q_position,
        weights.Q_velocity, limit, mu, normal_min, problem.weight, problem.linear, problem.lower, problem.upper,
        problem.rows, problem.limits,
    )  # fmt: skip
    return problem


@compiled
def _errors(T, y, dy, Qp, Qd, weight, linear):  # type: ignore[no-untyped-def]
    """Cost of the error stack in w, Eqs. (14)-(17); stage k counts k times."""
    for k in range(weight.shape[0]):
        for i in range(4):
            weight[k, i] = (k + 1) * (0.25 * T * T * Qp[i] + Qd[i])
            linear[k, i] = (k + 1) * (0.5 * T * Qp[i] * y[k + 1, i] + Qd[i] * dy[k + 1, i])


@compiled
def _contact_rows(force, per_torque, mu, normal_min, rows, limits):  # type: ignore[no-untyped-def]
    """|F_T| <= mu F_N as two rows, which Eq. (21) is once F_N > 0, and F_N >= normal_min."""
    for k in range(rows.shape[0]):
        for j in range(4):
            tangential, normal = per_torque[k, 0, j], per_torque[k, 1, j]
            rows[k, 0, j] = tangential - mu * normal
            rows[k, 1, j] = -tangential - mu * normal
            rows[k, 2, j] = -normal
        limits[k, 0] = mu * force[k, 1] - force[k, 0]
        limits[k, 1] = mu * force[k, 1] + force[k, 0]
        limits[k, 2] = force[k, 1] - normal_min


@compiled
def _fill(  # type: ignore[no-untyped-def]
    T, y, dy, u, force, per_torque, Qp, Qd, limit, mu, normal_min, weight, linear, lower, upper, rows, limits
):
    """All numbers of the problem that are not the horizon's own."""
    _errors(T, y, dy, Qp, Qd, weight, linear)
    for k in range(u.shape[0]):
        for i in range(4):
            lower[k, i] = -limit[i] - u[k, i]  # Eq. (19)
            upper[k, i] = limit[i] - u[k, i]
    if rows.shape[1] > 0:
        _contact_rows(force, per_torque, mu, normal_min, rows, limits)
