"""What a plan is made for: the push as far as it can last, and the ground as the feet have met it."""

import numpy as np

from controller.belief import WalkerModel
from controller.belief.ground import Ground, under_the_foot
from controller.common.products import inner
from controller.common.records import StanceState, Vector
from controller.observer import Estimate
from controller.plan.dynamics import Terrain, World
from controller.plan.ledge import Ledge
from controller.plan.load import Scales

BACK, FORWARD = -0.24, 0.48  # of the weight: a push beyond cannot last, since nobody could stand it; it is an impulse
FADES = 0.15  # [s] at most that what is left of an impulse in the estimate is not believed
GONE = 0.04  # of the weight: less than this is left of it when it is over
AGREES = 0.3  # of a slope seen, that the one seen before must have been to agree
ALONE = 0.5  # of a slope seen that is believed at once
LATE = 0.025  # [s] by which the observer sees a change late
BEHIND = 0.05  # [m] the old foot must be behind to tell a slope


class Beliefs:
    """Makes a world of what the observer tells.

    An impulse looks like a push that is far too large, and like a push while the estimate comes back from it; a plan
    for a push that lasts would be wrong. A ledge looks like a slope for one landing, so that one alone is half
    believed, and two in a row that agree wholly; one that the swing foot has run into is known as such. A push is
    believed as far as the observer, which knows no torque, and the scales, which do, agree.

    Attributes:
        world: What is believed now.
        push: What pushes for the moment, an impulse too, in [N].
        scales: Tell the load.
        ledge: That the swing foot has run into.
    """

    def __init__(self, model: WalkerModel, undisturbed: World, period: float, impact_time: float) -> None:
        """Args: model: the walker; undisturbed: its world; period: of the ticks; impact_time: of a landing, in [s]."""
        self._model, self._undisturbed, self._period = model, undisturbed, period
        self.scales, self.ledge = Scales(model, undisturbed, period, impact_time), Ledge()
        mass = 2.0 * (model.femur.mass + model.tibia.mass) + model.torso.mass
        self._weight = mass * model.lumped.gravity  # [N]
        self.reset()

    def reset(self) -> None:
        """Believe in nothing but the walker on level ground."""
        self.world = self._undisturbed
        self.scales.reset()
        self.ledge.reset()
        self.push = self._borne = self._momentum = 0.0
        self._fading = 0.0  # [s] since an impulse
        self._impulse = False
        self._tangent = self._seen = 0.0

    def update(
        self,
        estimate: Estimate,
        state: StanceState,
        x: Vector,
        u: Vector,
        *,
        stands: bool,
        swings: bool,
        exchanged: bool,
    ) -> bool:
        """Take in a tick.

        Args:
            estimate: Of the observer.
            state: As measured.
            x: The same in link angles and rates, (10,).
            u: Torque held since the tick before in [N.m], (4,), stance order.
            stands: Whether the stance foot touches the ground.
            swings: Whether the swing foot does not.
            exchanged: Whether the legs have just been exchanged.

        Returns:
            Whether the swing foot has run into a ledge.
        """
        self.scales.update(x, u, stands=stands, exchanged=exchanged)
        told, felt = estimate.push + self._known_load(estimate.load, x), self.scales.push
        self.push = float(np.copysign(min(abs(told), abs(felt)), told)) if told * felt > 0.0 else 0.0
        ahead, height, _ = self._model.swing_foot(state.q, state.dq)
        stumbled = swings and self.ledge.met(self.scales.blow, ahead, height, self._tangent)
        if swings:
            self.ledge.missed(ahead, height, self._tangent)
        if exchanged and not self.ledge.landed(ahead, height, self._tangent) and ahead < -BEHIND:
            before, self._seen = self._seen, height / ahead
            agree = before * self._seen > 0.0 and abs(before) > AGREES * abs(self._seen)
            self._tangent = self._seen if agree else ALONE * self._seen
        self.world = self._world(self._lasting(self.push), ahead, height)
        return stumbled

    def _world(self, push: float, ahead: float, height: float) -> World:
        """What to plan for, with a swing foot there."""
        if self.ledge.rise > 0.0:
            terrain = self.ledge.terrain(self._tangent)
        else:
            terrain = Terrain(*under_the_foot(Ground(self._tangent, 0.0), ahead, height))
        return self.scales.world._replace(push=push, terrain=terrain)

    def _known_load(self, seen: float, x: Vector) -> float:
        """What the observer takes for a push and is the load, as late as it does, to be added in [N]."""
        scales, lever = self.scales, self._undisturbed.lever
        sine, cosine, rate = np.sin(x[:5]), np.cos(x[:5]), x[5:]
        ahead, above = -inner(lever, sine), inner(lever, cosine)
        momentum = -above * inner(lever, cosine * rate) + ahead * inner(lever, sine * rate) - scales.gyration * rate[4]
        change = (momentum - self._momentum) / self._period if scales.weighs else 0.0
        self._momentum = momentum
        if scales.weighs:
            borne = (seen - scales.load) * (self._model.lumped.gravity * ahead - change) / above
            self._borne += self._period / LATE * (borne - self._borne)
        return self._borne

    def _lasting(self, push: float) -> float:
        """The push as far as it can last in [N]."""
        share = push / self._weight
        if share < BACK or share > FORWARD:
            self._impulse, self._fading = True, 0.0
        elif self._impulse:
            self._fading += self._period
            self._impulse = self._fading < FADES and abs(share) > GONE
        return 0.0 if self._impulse else push
