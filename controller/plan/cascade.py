"""`c-mpc-plan`: the second cascade while all is calm, and a plan of this step and the next where it is not."""

from dataclasses import replace

import numpy as np

from controller.belief import Friction, Gait, Law, kernels
from controller.belief.closed_loop import outputs
from controller.belief.ground import Ground, under_the_foot
from controller.common.compiled import compiled
from controller.common.products import inner
from controller.common.records import ControlStep, Observation, StanceState, Status, Vector
from controller.common.settings import PlanSettings
from controller.ltv.cascade import LtvCascade
from controller.ltv.orbit import nominal_rate
from controller.observer import PushObserver
from controller.plan.dynamics import stance_force
from controller.plan.forecast import Forecast
from controller.plan.planner import Planner
from controller.plan.start import links, plan_of_gait, world


class PlanCascade(Law):
    """The third cascade: `c-mpc-ltv` on the gait, blended into a planner's torque and back.

    Attributes:
        calm: The law followed while all is calm.
        planner: Plans at all times, so that there is a plan when one is needed.
        share: Of the plan's torque in the total, 0 to 1.
    """

    def __init__(
        self, calm: LtvCascade, settings: PlanSettings, friction: Friction, observer: PushObserver, *, period: float
    ) -> None:
        """Put the parts together.

        Args:
            calm: The law on the gait.
            settings: Of the planner.
            friction: Contact-force limits.
            observer: Of push and slope, told of every tick before this law is.
            period: Of the ticks in [s].
        """
        super().__init__(calm.model, calm.gait, calm.loop.gains)
        self.calm, self.settings, self._period = calm, settings, period
        self._observer = observer
        cost, gait = plan_of_gait(self.model, self.gait, settings, friction)
        self._world = world(self.model)
        self.planner = Planner(cost, gait, settings, self._world, period)
        self.reset("left")

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        super().reset(stance)
        self.calm.reset(stance)
        self.planner.reset()
        self.share, self._wanted, self._quiet = 0.0, False, 0.0

    def step(self, observation: Observation) -> ControlStep:
        """One tick."""
        old_leg = self.stance.leg
        state = self.stance.update(observation)
        estimate = self._observer.estimate
        x = np.concatenate([links(state.q), links(state.dq)])
        if state.leg is not old_leg:
            self.planner.landed(x)
        ahead, height, _ = self.model.swing_foot(state.q, state.dq)
        ground = under_the_foot(Ground(estimate.slope, 0.0), ahead, height)
        believed = self._world._replace(push=estimate.push, tangent=ground.tangent, level=ground.level)
        u, planned = self.planner.tick(x, believed)
        off = self._off(state, estimate.push)
        self._decide(off)
        step = self._on_the_gait(observation) if self.share < 1.0 else self._outputs(state)
        own, kept = self.share, 1.0 - self.share
        limit = self.model.torque_limits
        total = kept * np.clip(state.leg.from_body(step.u_total), -limit, limit) + own * u
        forward = kept * state.leg.from_body(step.u_zd) + own * planned
        left = round(self.planner.left / self._period)
        lost = self.planner.made and own > 0.0 and not self.planner.found
        return self.held(
            replace(
                step,
                u_total=state.leg.from_body(total),
                u_zd=state.leg.from_body(forward),
                u_mpc=state.leg.from_body(total - forward),
                impact_in=left if own > 0.0 else step.impact_in,
                solve_s=self.planner.solve_s if own == 1.0 or self.planner.made else step.solve_s,
                contact_force=stance_force(believed, x, total),
                fallback=lost or step.fallback,
                status=Status.PREDICTION_DIVERGED if lost else step.status,
                plan=self._forecast(x) if own == 1.0 else step.plan,
                diagnostics=self._diagnostics(off),
            )
        )

    def follow(self, gait: Gait, rate_change: Vector) -> None:
        """Follow another gait from now on; landings are planned near those of the first one."""
        super().follow(gait, rate_change)
        self.calm.follow(gait, rate_change)

    def _off(self, state: StanceState, push: float) -> float:
        """How far from calm it is: 1 where the plan is wanted."""
        settings = self.settings
        y, dtheta, theta = _clock(self.loop.gait, state.q, state.dq)
        rate, _ = nominal_rate(self.calm.orbit, theta)
        return float(
            max(abs(push) / settings.push, np.abs(y).max() / settings.output, abs(dtheta - rate) / settings.rate)
        )

    def _decide(self, off: float) -> None:
        """Move the share towards the plan or the gait."""
        settings = self.settings
        self._quiet = self._quiet + self._period if off < settings.calm else 0.0
        if not self.planner.found:
            self._wanted = False  # the one fall-back: the law on the gait
        elif off > 1.0:
            self._wanted = True
        elif self._quiet > settings.rest:
            self._wanted = False
        change = self._period / settings.blend
        if self._wanted:
            self.share = min(1.0, self.share + change)
        else:
            if self.share == 1.0:
                self.calm.reset(self.stance.leg.value)
            self.share = max(0.0, self.share - change)

    def _on_the_gait(self, observation: Observation) -> ControlStep:
        self.calm.stance = self.stance
        return self.calm.step(observation)

    def _forecast(self, x: Vector) -> Forecast:
        """What the plan followed leads to from a state."""
        return Forecast(
            followed=self.planner.followed,
            gait=self.loop.gait,
            limit=self.model.torque_limits,
            period=self._period,
            x=x,
        )

    def _outputs(self, state: StanceState) -> ControlStep:
        """A step without torque: what the log says of the gait."""
        stage = kernels.new_stage()
        theta, dtheta = outputs(self.loop.gait, state.q, state.dq, stage)
        figures = self.planner.figures
        improved = figures is not None and figures.share > 0.0
        return ControlStep.of(
            state.leg, np.zeros(4), y=stage.y, dy=stage.dy, theta=theta, dtheta=dtheta, s=self.gait.normalised(theta),
            status=Status.OPTIMAL if improved else Status.SUBOPTIMAL, iterations=figures.iterations if figures else 0,
        )  # fmt: skip

    def _diagnostics(self, off: float) -> dict[str, float]:
        figures, planner = self.planner.figures, self.planner
        reach = self.model.lumped.reach
        landing = -float(inner(reach, np.sin(planner.landing[:5])))
        return {
            "plan followed": self.share,
            "plan made": float(planner.made),
            "plan off calm": off,
            "plan time left [s]": planner.left,
            "plan landing [m]": landing,
            "plan cost": figures.after if figures else 0.0,
            "plan gap [rad]": figures.gap if figures else 0.0,
            "plan iterations": float(figures.iterations) if figures else 0.0,
            "plan step taken": figures.share if figures else 0.0,
        }


@compiled
def _clock(gait, q, dq):  # type: ignore[no-untyped-def]
    stage = kernels.new_stage()
    theta, dtheta = outputs(gait, q, dq, stage)
    return stage.y, dtheta, theta
