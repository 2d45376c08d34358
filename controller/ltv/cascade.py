"""`c-mpc-ltv`: the cascade on the closed loop's own linearisation, with the clock's rate in the cost."""

import time
from dataclasses import dataclass

import numpy as np

from controller import kernels
from controller.cascade import Friction
from controller.gait import Gait
from controller.kernels import compiled
from controller.ltv import horizon, sweep
from controller.ltv.orbit import Orbit, find_orbit, nominal_rate
from controller.model import WalkerModel
from controller.records import ControlStep, Observation, Vector
from controller.stance import StanceEstimator

ROWS = 11  # a stage: both bounds of four torques, both sides of the friction cone, normal force
SWEEPS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class LtvWeights:
    """Cost of a stage, and how much the last one counts.

    Attributes:
        output: On y^2 in [1/rad^2].
        output_rate: On dy^2 in [s^2/rad^2].
        clock_rate: On (dtheta - dtheta*(theta))^2 in [s^2/rad^2].
        torque: On u_tilde^2 in [1/(N.m)^2].
        last: Factor on the weights of the last stage.
        torque_penalty: On (torque beyond its limit)^2 in [1/(N.m)^2].
        force_penalty: On (force beyond its limit)^2 in [1/N^2].
    """

    output: float = 1e5
    output_rate: float = 1e3
    clock_rate: float = 3e4
    torque: float = 1.0
    last: float = 10.0
    torque_penalty: float = 1e3
    force_penalty: float = 1e2


class LtvCascade:
    """The second cascade; ZD+PD inside as in the first, and the same records out."""

    def __init__(
        self,
        model: WalkerModel,
        gait: Gait,
        gains: kernels.Gains,
        *,
        stages: int,
        stage_time: float,
        substeps: int,
        weights: LtvWeights,
        friction: Friction | None,
    ) -> None:
        """Put the parts together.

        Args:
            model: The walker believed in.
            gait: The outputs.
            gains: ZD+PD gains.
            stages: N.
            stage_time: Length of a stage in [s].
            substeps: Integration steps of a stage.
            weights: Cost.
            friction: Contact-force limits, None to leave their rows out.
        """
        self.model, self.gait, self.gains = model, gait, gains
        self.weights, self.friction = weights, friction
        self.orbit: Orbit = find_orbit(model, gait)
        self.stance = StanceEstimator(model)
        self._substep = stage_time / substeps
        self._substeps = np.full(stages, substeps, dtype=np.int64)
        self._horizon = horizon.new_horizon(stages)
        self._stages = stages
        self.reset("left")

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        self.stance.reset(stance)
        self._state = sweep.new_state(self._stages, ROWS)

    def step(self, observation: Observation) -> ControlStep:
        """One tick."""
        state = self.stance.update(observation)
        ahead, limit = self._horizon, self.model.torque_limits
        horizon.look_ahead(
            self.model.lumped, self.gait.table, self.gains, self._substep, self._substeps, state.q, state.dq, ahead
        )
        started = time.perf_counter()
        u = ahead.u[0].copy()
        finite = bool(np.isfinite(ahead.z[-1]).all())
        sweeps = 0
        if finite:
            problem = self.build(limit)
            sweeps = sweep.solve(problem, self._state, SWEEPS)
        found = finite and bool(np.isfinite(self._state.u[0]).all())
        u_mpc = self._state.u[0].copy() if found else np.clip(u, -limit, limit) - u
        if not found:
            self._state = sweep.new_state(self._stages, ROWS)
        solve_s = time.perf_counter() - started
        u_total = u + u_mpc
        z = ahead.z[0]
        first = int(ahead.exchange.argmax())
        impact = round((first + 1) * self._substeps[0] * self._substep / 1e-3) if ahead.exchange[first] else -1
        return ControlStep(
            stance=state.leg.value,
            u_zd=state.leg.from_body(u),
            u_mpc=state.leg.from_body(u_mpc),
            u_total=state.leg.from_body(u_total),
            y=z[:4].copy(),
            dy=z[4:8].copy(),
            theta=float(z[8]),
            dtheta=float(z[9]),
            s=self.gait.normalised(float(z[8])),
            contact_force=ahead.force[0] + ahead.force_u[0] @ u_mpc,
            impact_in=impact,
            status="optimal" if found else "prediction-diverged",
            fallback=not found,
            iterations=abs(sweeps),
            residuals=np.zeros(3),
            slack=0.0,
            active=int(self._state.exceeded.sum() + (self._state.fixed != 0).sum()),
            solve_s=solve_s,
        )

    def build(self, limit: Vector) -> sweep.LtvProblem:
        """The problem over the present horizon."""
        N, w, h = self._stages, self.weights, self._horizon
        e = np.empty
        stage_weight = np.array([w.output] * 4 + [w.output_rate] * 4 + [w.clock_rate])
        weight = np.tile(stage_weight, (N, 1))
        weight[-1] *= w.last
        problem = sweep.LtvProblem(
            A=h.A,
            B=h.B,
            error=e((N, 9)),
            weight=weight,
            slope=e(N),
            R=np.full(4, w.torque),
            rows_z=np.zeros((N, ROWS, 10)),
            rows_u=np.zeros((N, ROWS, 4)),
            limits=np.full((N, ROWS), 1e9),
            penalty=np.array([w.torque_penalty] * 8 + [w.force_penalty] * 3),
            lower=-limit - h.u[0],
            upper=limit - h.u[0],
        )
        friction = self.friction
        _fill(
            h, self.orbit, limit, friction.mu if friction else 0.0, friction.normal_min if friction else 0.0,
            friction is not None, problem,
        )  # fmt: skip
        return problem


@compiled
def _fill(h, orbit, limit, mu, normal_min, with_friction, p):  # type: ignore[no-untyped-def]
    """Errors at the end of every stage and rows at its beginning."""
    for k in range(p.slope.shape[0]):
        z = h.z[k + 1]
        rate, slope = nominal_rate(orbit, z[8])
        for i in range(8):
            p.error[k, i] = z[i]
        p.error[k, 8] = z[9] - rate
        p.slope[k] = slope
        if k > 0:  # the box of the first torque is hard
            for i in range(4):
                for m in range(10):
                    p.rows_z[k, i, m] = h.u_z[k, i, m]
                    p.rows_z[k, 4 + i, m] = -h.u_z[k, i, m]
                p.rows_u[k, i, i] = 1.0
                p.rows_u[k, 4 + i, i] = -1.0
                p.limits[k, i] = limit[i] - h.u[k, i]
                p.limits[k, 4 + i] = limit[i] + h.u[k, i]
        if with_friction:
            for m in range(10):
                t, n = h.force_z[k, 0, m], h.force_z[k, 1, m]
                p.rows_z[k, 8, m] = t - mu * n
                p.rows_z[k, 9, m] = -t - mu * n
                p.rows_z[k, 10, m] = -n
            for m in range(4):
                t, n = h.force_u[k, 0, m], h.force_u[k, 1, m]
                p.rows_u[k, 8, m] = t - mu * n
                p.rows_u[k, 9, m] = -t - mu * n
                p.rows_u[k, 10, m] = -n
            p.limits[k, 8] = mu * h.force[k, 1] - h.force[k, 0]
            p.limits[k, 9] = mu * h.force[k, 1] + h.force[k, 0]
            p.limits[k, 10] = h.force[k, 1] - normal_min
