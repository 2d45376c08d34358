"""Which leg stands, and its rates while an impact lasts: the controller's own view, from what it measures."""

import numpy as np

from controller.belief.model import WalkerModel
from controller.records import Leg, Observation, StanceState, Vector


class StanceEstimator:
    """Keeps the stance leg and exchanges the legs when the swing foot lands ahead.

    The legs are exchanged when the swing foot's flag is up and the foot is ahead of the stance foot, the
    p_2^h > 0 of Eq. (4). The height of Eq. (4) is left to the flag: the ground may not be where it is believed.
    After an exchange the old stance foot is behind, so lingering double support does not exchange them back.

    A real impact takes milliseconds, and rates measured meanwhile are neither those before it nor those after it.
    The paper's x+ = Delta(x-) is what the law behind this expects, so the rates are for `impact_time` those that the
    model predicts: the last ones measured before the landing, carried to now, through the impact map, and on under
    the torque that is held. Angles are measured throughout. On a plant whose impact takes no time the prediction is
    what is measured, to the model's accuracy.
    """

    def __init__(self, model: WalkerModel, *, impact_time: float = 0.0) -> None:
        """Put the parts together.

        Args:
            model: The walker believed in.
            impact_time: How long rates are predicted after a landing in [s]; 0 takes every measured rate literally.
        """
        self._model = model
        self._impact_time = impact_time
        self.leg = Leg.LEFT
        self._forget()

    def reset(self, stance: str) -> None:
        """Start with a known stance leg, "left" or "right"."""
        self.leg = Leg(stance)
        self._forget()

    def _forget(self) -> None:
        self._last: tuple[float, StanceState] | None = None  # [s], what the last tick was taken for
        self._torque: Vector = np.zeros(4)  # [N.m] held since, body order
        self._until = -np.inf  # [s] the end of the impact

    def update(self, observation: Observation) -> StanceState:
        """State in stance order, after exchanging the legs if the swing foot has landed."""
        left, right = observation.contact
        landed = False
        swing_landed = right if self.leg is Leg.LEFT else left
        if swing_landed:
            q, dq = self.leg.from_body(observation.q), self.leg.from_body(observation.dq)
            ahead, _, _ = self._model.swing_foot(q, dq)
            landed = ahead > 0.0
        if not self._impact_time:
            self.leg = self.leg.other if landed else self.leg
            return StanceState(q=self.leg.from_body(observation.q), dq=self.leg.from_body(observation.dq), leg=self.leg)
        state = self._through_impacts(observation, landed)
        self._last = observation.t, state
        return state

    def held(self, torque: Vector) -> None:
        """Tell which torque is commanded until the next tick in [N.m], (4,), body order; the limits cut it."""
        self._torque = torque

    def _through_impacts(self, observation: Observation, landed: bool) -> StanceState:
        """The state with rates predicted while an impact lasts."""
        before = self.leg
        if landed:
            self.leg = before.other
            self._until = observation.t + self._impact_time if self._last else -np.inf
        q, dq = self.leg.from_body(observation.q), self.leg.from_body(observation.dq)
        if self._last and observation.t < self._until:
            dq = self._carried(observation.t)
            if landed:
                _, dq = self._model.impact(before.from_body(observation.q), dq)
        return StanceState(q=q, dq=dq, leg=self.leg)

    def _carried(self, t: float) -> Vector:
        """The last tick's rates, carried to now by the model, in its stance order."""
        assert self._last is not None
        then, state = self._last
        limit = self._model.torque_limits
        u = np.clip(state.leg.from_body(self._torque), -limit, limit)
        found: Vector = state.dq + (t - then) * self._model.acceleration(state.q, state.dq, u)
        return found
