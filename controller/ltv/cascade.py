"""`c-mpc-ltv`: the cascade on the closed loop's own linearisation, with the clock's rate in the cost."""

import time
from dataclasses import dataclass

import numpy as np

from controller.belief import Friction, Gains, Gait, Law, WalkerModel
from controller.belief.ground import LEVEL, Ground, under_the_foot
from controller.common.products import inner
from controller.common.records import ControlStep, Observation, StanceState, Status, Vector
from controller.common.settings import LtvSettings
from controller.ltv import plan
from controller.ltv.cost import off_the_orbit
from controller.ltv.horizon import Outlook
from controller.ltv.orbit import Orbit, find_orbit, nominal_rate
from controller.ltv.problem import residuals

BEYOND = 0.05  # of the clock's normal range; the polynomials run away further out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LtvPlan:
    """What the controller expects, stage by stage, told tick by tick when somebody looks.

    Attributes:
        z: Output states at the beginning of each stage and at the end, (N + 1, 10).
        force: Stance forces at the beginning of each stage in [N], (N, 2).
        ticks_per_stage: Length of a stage in ticks.
    """

    z: Vector
    force: Vector
    ticks_per_stage: float

    def outputs(self) -> Vector:
        """Predicted outputs in [rad] at each tick, (ticks + 1, 4), stance order of its stage."""
        stage = np.arange(self._ticks + 1) / self.ticks_per_stage
        known = np.arange(len(self.z))
        return np.column_stack([np.interp(stage, known, self.z[:, i]) for i in range(4)])

    def contact_forces(self) -> Vector:
        """Predicted stance contact forces over each tick, (tangential, normal) in [N], (ticks, 2)."""
        return self.force[(np.arange(self._ticks) / self.ticks_per_stage).astype(int)]

    @property
    def _ticks(self) -> int:
        return int(len(self.force) * self.ticks_per_stage + 1e-9)


class LtvCascade(Law):
    """The second cascade; ZD+PD inside as in the first, and the same records out."""

    def __init__(
        self,
        model: WalkerModel,
        gait: Gait,
        gains: Gains,
        *,
        period: float,
        settings: LtvSettings,
        friction: Friction | None,
    ) -> None:
        """Put the parts together.

        Args:
            model: The walker believed in.
            gait: The outputs.
            gains: ZD+PD gains.
            period: Of the ticks in [s].
            settings: Prediction and cost.
            friction: Contact-force limits, None to leave their rows out.
        """
        super().__init__(model, gait, gains)
        self._end_polynomials()
        self.settings = settings
        self.cost = off_the_orbit(settings, model.torque_limits, friction)
        self._grown = self.cost.error[:, :1] / settings.output  # of a stage's weights over those of the first
        self.orbit = self._own_orbit = find_orbit(model, gait)
        self._N, self._period = settings.stages, period
        self._stage_time, self._substeps = settings.stage_time, settings.substeps
        self.reset("left")

    def follow(self, gait: Gait, rate_change: Vector) -> None:
        """Follow another gait, at its nominal clock rate, from now on."""
        super().follow(gait, rate_change)
        self._end_polynomials()
        self.orbit = Orbit(self._own_orbit.poly + rate_change, gait.table.theta_start, gait.table.theta_span)

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        super().reset(stance)
        self.ground = LEVEL
        self.workspace = plan.new_workspace(self._N)
        self._figures: plan.Figures | None = None

    def _end_polynomials(self) -> None:
        """Outputs go on along their tangents a little beyond the clock's normal range."""
        table = self.loop.gait._replace(s_first=-BEYOND, s_last=1.0 + BEYOND)
        self.loop = self.loop._replace(gait=table)

    def step(self, observation: Observation) -> ControlStep:
        """One tick."""
        old_leg = self.stance.leg
        state = self.stance.update(observation)
        w = self.workspace
        exchanged = state.leg is not old_leg
        if exchanged:
            self._touched_down(state)
        self._weigh(state)
        started = time.perf_counter()
        outlook = Outlook(
            self.loop, self.cost.limit, self._ground_under(state), self._stage_time / self._substeps, self._substeps,
            state.q, state.dq,
        )  # fmt: skip
        doubtful = self._figures is None or self._figures.share < 1.0
        figures = plan.improve(
            outlook, self.cost, self.orbit, self._period / self._stage_time, exchanged, doubtful, w
        )  # fmt: skip
        self._figures = figures
        solve_s = time.perf_counter() - started
        u, z = w.other.u[0].copy(), w.other.z[0]
        limit = self.model.torque_limits
        if figures.found:
            u_mpc = w.plan[0].copy()
        else:
            u_mpc = np.clip(u, -limit, limit) - u  # the one fall-back policy: saturated ZD+PD
            w.plan[:] = 0.0
        return self.held(
            ControlStep.of(
                state.leg,
                u + u_mpc,
                u_zd=u,
                u_mpc=u_mpc,
                y=z[:4].copy(),
                dy=z[4:8].copy(),
                theta=float(z[8]),
                dtheta=float(z[9]),
                s=self.gait.normalised(float(z[8])),
                contact_force=w.other.force[0].copy(),
                impact_in=self._impact_in(),
                status=_status(figures),
                fallback=not figures.found,
                iterations=abs(figures.sweeps),
                residuals=residuals(w.problem, w.state) if figures.found else np.full(3, np.inf),
                slack=figures.excess,
                active=int(w.state.exceeded.sum() + np.count_nonzero(w.state.fixed)),
                solve_s=solve_s,
                plan=self._plan() if figures.found else None,
            )
        )

    def _weigh(self, state: StanceState) -> None:
        """Set the outputs' weights for the clock's rate measured."""
        clock = self.gait.clock
        rate, _ = nominal_rate(self.orbit, inner(clock, state.q))
        output, output_rate = self.settings.weights_at(inner(clock, state.dq) - rate)
        self.cost.error[:, :4] = self._grown * output
        self.cost.error[:, 4:8] = self._grown * output_rate

    def _plan(self) -> LtvPlan:
        ahead = self.workspace.other
        return LtvPlan(z=ahead.z.copy(), force=ahead.force.copy(), ticks_per_stage=self._stage_time / self._period)

    def _touched_down(self, state: StanceState) -> None:
        """The old stance foot is now behind: the line between the feet is the ground."""
        behind, height, _ = self.model.swing_foot(state.q, state.dq)
        seen = height / behind if behind < -0.05 else 0.0
        kept = self.settings.slope_memory
        self.ground = Ground(kept * self.ground.tangent + (1.0 - kept) * seen, 0.0)

    def _ground_under(self, state: StanceState) -> Ground:
        """The ground believed in, lowered where the swing foot is below it and feels nothing."""
        ahead, height, _ = self.model.swing_foot(state.q, state.dq)
        return under_the_foot(self.ground, ahead, height)

    def _impact_in(self) -> int:
        exchange = self.workspace.other.exchange
        first = int(exchange.argmax())
        return round((first + 1) * self._stage_time / self._period) if exchange[first] else -1


def _status(figures: plan.Figures) -> Status:
    """Whether there is an answer, the quadratic model was solved, and its whole step taken."""
    if not figures.found:
        return Status.PREDICTION_DIVERGED
    return Status.OPTIMAL if figures.share == 1.0 and figures.sweeps > 0 else Status.SUBOPTIMAL
