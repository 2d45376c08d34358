"""Which leg stands: the controller's own view, from joint angles and two contact flags."""

from controller.belief.model import WalkerModel
from controller.records import Leg, Observation, StanceState


class StanceEstimator:
    """Keeps the stance leg and exchanges the legs when the swing foot lands ahead.

    The legs are exchanged when the swing foot's flag is up and the foot is ahead of the stance foot, the
    p_2^h > 0 of Eq. (4). The height of Eq. (4) is left to the flag: the ground may not be where it is believed.
    After an exchange the old stance foot is behind, so lingering double support does not exchange them back.
    """

    def __init__(self, model: WalkerModel) -> None:
        """Args: model: kinematics of the swing foot."""
        self._model = model
        self.leg = Leg.LEFT

    def reset(self, stance: str) -> None:
        """Start with a known stance leg, "left" or "right"."""
        self.leg = Leg(stance)

    def update(self, observation: Observation) -> StanceState:
        """State in stance order, after exchanging the legs if the swing foot has landed."""
        left, right = observation.contact
        swing_landed = right if self.leg is Leg.LEFT else left
        if swing_landed:
            q, dq = self.leg.from_body(observation.q), self.leg.from_body(observation.dq)
            ahead, _, _ = self._model.swing_foot(q, dq)
            if ahead > 0.0:
                self.leg = self.leg.other
        return StanceState(q=self.leg.from_body(observation.q), dq=self.leg.from_body(observation.dq), leg=self.leg)
