"""C-MPC: a second layer that corrects ZD+PD where it errs, saturates or would slip."""

import time
from typing import Any

import numpy as np

from controller.belief import Friction, Gains, Gait, Law, WalkerModel
from controller.belief.friction import UNLIMITED
from controller.cmpc.cascade_kernels import DIVERGED, FORESEEN, NOTHING, Halves, Parts, foresee, settle, tick
from controller.cmpc.prediction import CorrectedHorizon, Horizon, new_horizon, predict
from controller.cmpc.program import Weights, build_problem
from controller.common.clock import new_clock
from controller.common.compiled import compile_for
from controller.common.entry import Bound, bind
from controller.common.held import Held
from controller.common.products import applied
from controller.common.records import (
    OBSERVATION,
    STEP,
    ControlStep,
    Leg,
    Observation,
    Plan,
    Rows,
    Status,
    observation_of,
    write_step,
)
from controller.qp import Solver
from controller.qp.problem import Solution, failed
from controller.qp.riccati_solver import RiccatiSolver


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


def compile_half(law: Any, half: str) -> None:
    """Compile one half of a tick, "foresee" or "settle", and what hands the law's parts over to it."""
    kernel, rows = {"foresee": (foresee, OBSERVATION), "settle": (settle, STEP)}[half]
    compile_for(kernel, law._parts(law.solver), law.stance.memory, np.zeros(1, rows), 0)
