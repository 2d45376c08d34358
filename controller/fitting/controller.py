"""A gait to fit the moment: any controller, following at each step the member of a gait family that suits its speed.

The speed is judged at each impact by the angular momentum about the new stance foot, which the impact itself does not
change: it is that of some member of the family just after its own impact, and that member's speed is the walker's. What
to follow is a matter of the sign of `FittingSettings.share`. To follow the walker (above 0) keeps the outputs close to
where they are, but lets the speed drift, for every gait is at home in its own speed. To oppose it (below 0) makes a
walker that was pushed forward follow a slower gait, which brakes.

Source: X. Da, O. Harib, R. Hartley, B. Griffin, J. W. Grizzle, From 2D design of underactuated bipedal gaits to 3D
implementation: walking with speed tracking, IEEE Access 4, 2016, there with the mean speed of the last step.

Tried on pushes through the fourth step and left out: to follow the walker (comes back later, holds no more forward), a
step length that grows with the speed (loses 5 N) or shrinks with it (gains nothing), faster gaits for a walker that was
slowed (they have more of a hill to climb in mid-step, where a slow one turns back), and to follow it within the step.

A switch leaves the walker off the new gait's outputs by no more than its limit allows, and the inner controller removes
that within the step, as it does after a push. Predictions follow the gait that is followed now, through every impact
they see.
"""

from dataclasses import replace

from controller.belief import Law, StanceEstimator, WalkerModel
from controller.common.records import TORSO, ControlStep, Observation, StanceState
from controller.common.settings import FittingSettings
from controller.fitting.family import GaitFamily
from controller.guard import Guarded


class GaitFitting:
    """Chooses the gait at each impact; everything else is the inner controller's."""

    def __init__(self, inner: Law | Guarded, model: WalkerModel, family: GaitFamily, rule: FittingSettings) -> None:
        """Put the parts together.

        Args:
            inner: The controller, built with the family's own gait.
            model: The walker believed in.
            family: Gaits to choose from.
            rule: How.
        """
        self.inner, self.model, self.family, self.rule = inner, model, family, rule
        self._stance = StanceEstimator(model)
        self.reset("left")

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        self._stance.reset(stance)
        self._last: StanceState | None = None
        self._follow(0.0)
        self.inner.reset(stance)

    def step(self, observation: Observation) -> ControlStep:
        """One tick; after an impact, first which gait to follow."""
        leg, last = self._stance.leg, self._last
        self._last = self._stance.update(observation)
        if last is not None and self._last.leg is not leg:
            measured = self.measure(last)
            speed = self.rule.next(self.speed, measured)
            if speed != self.speed:
                self._follow(speed)
        step = self.inner.step(observation)
        return replace(step, followed=self.speed) if self.speed else step

    def measure(self, before: StanceState) -> float:
        """How much faster than its own gait a walker is whose swing foot lands, in [m/s].

        Args:
            before: The last state before the landing. Real contact takes a few ticks and pushes at both feet
                meanwhile, so that states after it tell less.
        """
        q, dq = self.model.impact(before.q, before.dq)
        momentum = -float(self.model.dynamics(q, dq).D[TORSO] @ dq)  # the clock runs against the absolute angles
        return self.family.faster_by(momentum)

    def _follow(self, speed: float) -> None:
        self.speed = min(max(speed, float(self.family.speeds[0])), float(self.family.speeds[-1]))
        self.inner.follow(self.family.member(self.speed), self.family.rate_change(self.speed))
