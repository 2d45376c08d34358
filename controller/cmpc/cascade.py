"""C-MPC: a second layer that corrects ZD+PD where it errs, saturates or would slip."""

import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.belief import Friction, Gains, Gait, Law, Loop, WalkerModel
from controller.belief.friction import ROWS, UNLIMITED, cone, excess
from controller.belief.kernels import N_Q, N_U
from controller.belief.stance import watch
from controller.cmpc.prediction import CorrectedHorizon, Horizon, new_horizon, predict, roll_out, within_reason
from controller.common.clock import Clock, new_clock, now
from controller.common.compiled import Array, compile_for, compiled, nested
from controller.common.entry import Bound, bind, call
from controller.common.held import Held, held
from controller.common.products import applied
from controller.common.records import (
    OBSERVATION,
    ControlStep,
    Leg,
    Observation,
    Plan,
    Rows,
    Status,
    Vector,
    observation_of,
    write_step,
)
from controller.common.settings import WeightSettings
from controller.qp import Solver, StageQP
from controller.qp.problem import Solution, failed
from controller.qp.riccati_solver import RiccatiSolver, State, advance, good


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
        self._held: Held | None = None
        self._plan: Plan | None = None

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        super().reset(stance)
        self.solver.reset()
        if self._held is not None:
            self._held.value.came_to[0] = NOTHING

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
        return self._concluded(state.leg, horizon, solution)

    def _concluded(self, leg: Leg, horizon: Horizon, solution: Solution) -> ControlStep:
        """The decision that a prediction and a solution make."""
        u = horizon.u[0]
        limit = self.model.torque_limits
        if solution.found:
            u_mpc = solution.u[0]
        else:
            u_mpc = np.clip(u, -limit, limit) - u  # the one fall-back policy: saturated ZD+PD
        return self.held(
            ControlStep.of(
                leg,
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

    def decide(self, seen: Rows, step: Rows, i: int) -> None:
        """The same from row to row, in compiled code but for the few ticks without an answer."""
        solver = self.solver
        if not isinstance(solver, RiccatiSolver):
            self._by_records(seen, step, i)
            return
        parts, memory = self._parts(solver), self.stance.memory
        self._plan = None
        horizon, problem, came_to = parts.value.horizon, parts.value.problem, parts.value.came_to
        if came_to[0] == NOTHING:
            came_to[0] = FORESEEN if foresee(parts, memory, seen, i) else DIVERGED
            started = time.perf_counter()
            if came_to[0] == FORESEEN and settle(parts, memory, step, i):
                step["solve_s"][i] = time.perf_counter() - started
                self._plan = CorrectedHorizon(horizon=horizon, u_mpc=solver.state.sweep.u)
                came_to[0] = NOTHING
                return
        else:
            started = time.perf_counter() - float(step["solve_s"][i])
        if came_to[0] == FORESEEN:
            solution = solver.next_in_line(problem, started)
        else:
            solution = failed(self.N, Status.PREDICTION_DIVERGED)
        came_to[0] = NOTHING
        self._write(step, i, self._concluded(self.stance.leg, horizon, solution))

    def bound(self, seen: Rows, step: Rows) -> Bound | None:
        """The kernel of a tick with an answer, with rows of these types; `decide` goes on where it has none."""
        if type(self) is not CascadedMpc or not isinstance(self.solver, RiccatiSolver):
            return None  # one that may do more
        clock = new_clock()
        if clock is None:
            return None
        parts = self._parts(self.solver)
        own = parts, self.stance.memory
        halves = Halves(bind(foresee, own, (seen, 0)), bind(settle, own, (step, 0)), parts.value.came_to, clock)
        return bind(tick, (Held(halves),), (seen, step, 0))

    def plan(self) -> Plan | None:
        """What the last decision expects."""
        return self._plan

    def _by_records(self, seen: Rows, step: Rows, i: int) -> None:
        self._write(step, i, self.step(observation_of(seen[i])))

    def _write(self, step: Rows, i: int, decided: ControlStep) -> None:
        write_step(step, i, decided)
        self._plan = decided.plan

    def _parts(self, solver: RiccatiSolver) -> Held:
        """All that a tick works on, kept for compiled code; anew where the gait has been."""
        held = self._held
        if held is None or held.value.loop is not self.loop:
            horizon, limit = new_horizon(self.N, self.T), self.model.torque_limits
            friction = UNLIMITED if self.friction is None else self.friction
            problem = build_problem(horizon, self.weights, limit, self.friction)
            came_to = np.zeros(1, dtype=np.int64)
            held = Held(Parts(self.loop, horizon, self.weights, limit, friction, problem, solver.state, came_to))
            self._held = held
        return held


def compile_foresight(law: Any) -> None:
    """Compile what a tick does before it solves, and what hands its parts over."""
    seen = np.zeros(1, OBSERVATION)
    compile_for(foresee, law._parts(law.solver), law.stance.memory, seen, 0)


NOTHING, FORESEEN, DIVERGED = range(3)
"""How far `tick` has come that ended without a decision."""


class Parts(NamedTuple):
    """All that a tick works on.

    Attributes:
        came_to: What `decide` is to go on from, (1,).
    """

    loop: Loop
    horizon: Horizon
    weights: Weights
    limit: Array
    friction: Friction
    problem: StageQP
    state: State
    came_to: NDArray[np.int64]


OPTIMAL = list(Status).index(Status.OPTIMAL)


@compiled
def foresee(parts: Any, memory: Any, seen: Any, i: int) -> bool:
    """Predict from row `i` of `seen` and build the problem; false where the prediction diverges."""
    p = held(parts)
    q, dq = np.empty(N_Q), np.empty(N_Q)
    watch(memory, p.loop.walker, seen[i], q, dq)
    roll_out(p.loop, q, dq, p.horizon)
    if not within_reason(p.horizon.x, p.horizon.force):
        return False
    fill(p.horizon, p.weights, p.limit, p.friction, p.problem)
    return True


@compiled
def settle(parts: Any, memory: Any, step: Any, i: int) -> bool:
    """Solve the problem and fill row `i` of `step`, but for the time it took; whether it has an answer."""
    p = held(parts)
    sweeps, checks = advance(p.problem, p.state)
    if not good(checks):
        return False
    m, out, horizon, u_mpc = memory[0], step[i], p.horizon, p.state.sweep.u[0]
    for j in range(N_U):
        joint = j ^ m.leg
        out.u_zd[joint], out.u_mpc[joint] = horizon.u[0, j], u_mpc[j]
        out.u_total[joint] = m.torque[joint] = horizon.u[0, j] + u_mpc[j]  # Eq. (23)
        out.y[j], out.dy[j] = horizon.y[0, j], horizon.dy[0, j]
    force = applied(horizon.force_per_torque[0], u_mpc)  # Eq. (20)
    out.contact_force[0], out.contact_force[1] = horizon.force[0, 0] + force[0], horizon.force[0, 1] + force[1]
    out.theta, out.dtheta = horizon.clock[0], horizon.clock[1]
    out.s = (horizon.clock[0] - p.loop.gait.theta_start) / p.loop.gait.theta_span
    out.impact_in = -1
    for k in range(horizon.exchange.shape[0]):
        if horizon.exchange[k]:
            out.impact_in = k + 1
            break
    out.residuals[0], out.residuals[1], out.residuals[2] = checks[0], checks[1], checks[2]
    out.slack, out.active, out.iterations = checks.slack, checks.active, sweeps
    out.followed = 0.0
    out.status, out.stance, out.fallback = OPTIMAL, m.leg, 0
    return True


class Halves(NamedTuple):
    """What `tick` works on: both kernels as values, which are compiled for Python, too, and need not be once more."""

    foresee: Bound
    settle: Bound
    came_to: NDArray[np.int64]
    clock: Clock


@compiled
def tick(halves: Any, seen: Any, step: Any, i: int) -> bool:
    """Fill row `i` of `step` from that of `seen`; false where there is no answer yet, `came_to` then says why."""
    p = held(halves)
    if not call(p.foresee.entry, p.foresee.arguments, (seen, i)):
        p.came_to[0] = DIVERGED
        step[i].solve_s = 0.0
        return False
    started = now(p.clock)
    answered: bool = call(p.settle.entry, p.settle.arguments, (step, i))
    step[i].solve_s = now(p.clock) - started
    if not answered:
        p.came_to[0] = FORESEEN
    return answered


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
