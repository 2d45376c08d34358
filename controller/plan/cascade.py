"""`c-mpc-plan`: the second cascade while all is calm, and a plan of this step and the next where it is not."""

from dataclasses import replace

import numpy as np

from controller.belief import Friction, Gait, Law, kernels
from controller.belief.closed_loop import outputs
from controller.common.products import inner
from controller.common.records import ControlStep, Leg, Observation, StanceState, Status, Vector
from controller.common.settings import PlanSettings
from controller.ltv.cascade import LtvCascade
from controller.ltv.orbit import nominal_rate
from controller.observer import PushObserver
from controller.plan.beliefs import Beliefs
from controller.plan.dynamics import stance_force
from controller.plan.forecast import Forecast
from controller.plan.planner import Planner
from controller.plan.share import Share
from controller.plan.start import links, on_the_clock, plan_of_gait, world

HEAVY = 1.0  # of the torso's own mass: a load at which the plan is followed
CLIMB = 2.0  # how far from calm a ledge between the feet or ahead is
STEEP = 0.05  # tangent of a slope believed in, at which the plan is followed


class PlanCascade(Law):
    """The third cascade: `c-mpc-ltv` on the gait, blended into a planner's torque and back.

    Attributes:
        calm: The law followed while all is calm.
        planner: Plans while it is not so calm that it may rest.
        beliefs: What it plans for.
        share: Of the plan's torque in the total.
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
        undisturbed = world(self.model)
        self.planner = Planner(cost, gait, settings, undisturbed, period)
        self.beliefs = Beliefs(self.model, undisturbed, period, observer.tuning.impact_time)
        self.share = Share(settings, period)
        self.reset("left")
        replace(
            self._forecast(self.planner.landing), horizon=0.0
        ).outputs()  # compiled, or loaded, before the first tick

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        super().reset(stance)
        self.calm.reset(stance)
        self.planner.reset()
        self.beliefs.reset()
        self.share.reset()
        self._torque = np.zeros(4)  # held, body order

    def step(self, observation: Observation) -> ControlStep:
        """One tick."""
        old_leg = self.stance.leg
        state = self.stance.update(observation)
        estimate = self._observer.estimate
        x = np.concatenate([links(state.q), links(state.dq)])
        exchanged = state.leg is not old_leg
        stance = 0 if state.leg is Leg.LEFT else 1
        stands, swings = observation.contact[stance], not observation.contact[1 - stance]
        held = state.leg.from_body(self._torque)
        stumbled = self.beliefs.update(estimate, state, x, held, stands=stands, swings=swings, exchanged=exchanged)
        off = self._off(state)
        self.share.look(off)
        if exchanged:
            self.planner.landed(x)
        if stumbled:
            self.planner.stumbled()
        u, planned = self.planner.tick(x, self.beliefs.world, rest=self.share.resting)
        if self.share.move(self.planner.found):
            self.calm.reset(self.stance.leg.value)
        own, kept = self.share.value, 1.0 - self.share.value
        step = self._on_the_gait(observation) if own < 1.0 else self._outputs(state)
        limit = self.model.torque_limits
        total = kept * np.clip(state.leg.from_body(step.u_total), -limit, limit) + own * u
        forward = kept * state.leg.from_body(step.u_zd) + own * planned
        self._torque = state.leg.from_body(total)
        left = round(self.planner.left / self._period)
        lost = self.planner.made and own > 0.0 and not self.planner.found
        return self.held(
            replace(
                step,
                u_total=self._torque,
                u_zd=state.leg.from_body(forward),
                u_mpc=state.leg.from_body(total - forward),
                impact_in=left if own > 0.0 else step.impact_in,
                solve_s=self.planner.solve_s if own == 1.0 or self.planner.made else step.solve_s,
                contact_force=stance_force(self.beliefs.world, x, total),
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

    def _off(self, state: StanceState) -> float:
        """How far from calm it is: 1 where the plan is wanted."""
        settings = self.settings
        y, dtheta, theta = on_the_clock(self.loop.gait, state.q, state.dq)
        rate, _ = nominal_rate(self.calm.orbit, theta)
        return float(
            max(
                abs(self.beliefs.push) / settings.push,
                np.abs(y).max() / settings.output,
                abs(dtheta - rate) / settings.rate,
                abs(self.beliefs.world.terrain.tangent) / STEEP,
                CLIMB if self.beliefs.ledge.rise > 0.0 else 0.0,
                abs(self.beliefs.scales.load) / (HEAVY * self.model.torso.mass),
            )
        )

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
            "plan followed": self.share.value,
            "plan made": float(planner.made),
            "plan off calm": off,
            "plan ledge [m]": self.beliefs.ledge.rise,
            "plan load [kg]": self.beliefs.scales.load,
            "plan push [N]": self.beliefs.world.push,
            "plan time left [s]": planner.left,
            "plan landing [m]": landing,
            "plan cost": figures.after if figures else 0.0,
            "plan gap [rad]": figures.gap if figures else 0.0,
            "plan iterations": float(figures.iterations) if figures else 0.0,
            "plan step taken": figures.share if figures else 0.0,
        }
