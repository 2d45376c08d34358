"""Which leg stands, and its rates while an impact lasts: the controller's own view, from what it measures."""

from typing import Any

import numpy as np

from controller.belief.kernels import N_Q, N_U
from controller.belief.model import WalkerModel
from controller.common.compiled import Array, inlined
from controller.common.records import Leg, Observation, StanceState, Vector

LEGS = tuple(Leg)

MEMORY = np.dtype(
    [
        ("leg", np.int64),  # that stands, 0 left, 1 right
        ("any", np.int64),  # whether there was a tick before
        ("t", float),  # [s] of the last tick
        ("q", float, N_Q),  # [rad] what it was taken for, in its stance order
        ("dq", float, N_Q),  # [rad/s]
        ("torque", float, N_U),  # [N.m] held since, body order
        ("until", float),  # [s] the end of the impact
    ],
    align=True,
)
"""What an estimator keeps from tick to tick, where compiled code finds it."""


@inlined
def calm(memory: Any, seen: Any) -> bool:
    """Whether no foot lands in a row of `OBSERVATION` and no impact lasts: it is then what it reads."""
    m = memory[0]
    return seen.contact[1 - m.leg] == 0 and not seen.t < m.until


@inlined
def take(memory: Any, seen: Any, q: Array, dq: Array) -> None:
    """Take over a calm row: fill the state in stance order, (5,) each, and remember it."""
    m = memory[0]
    for i in range(N_Q):
        j = i ^ m.leg if i < N_U else i  # legs differ in the last bit of a joint's place
        q[i], dq[i] = seen.q[j], seen.dq[j]
    for i in range(N_Q):
        m.q[i], m.dq[i] = q[i], dq[i]
    m.any, m.t = 1, seen.t


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
        self.memory = np.zeros(1, MEMORY)
        self._forget()

    @property
    def leg(self) -> Leg:
        """The leg that stands."""
        return LEGS[self.memory["leg"][0]]

    @leg.setter
    def leg(self, leg: Leg) -> None:
        self.memory["leg"] = LEGS.index(leg)

    def reset(self, stance: str) -> None:
        """Start with a known stance leg, "left" or "right"."""
        self.leg = Leg(stance)
        self._forget()

    def _forget(self) -> None:
        self.memory["any"], self.memory["torque"], self.memory["until"] = 0, 0.0, -np.inf

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
        memory = self.memory
        memory["any"], memory["t"], memory["q"], memory["dq"] = 1, observation.t, state.q, state.dq
        return state

    def held(self, torque: Vector) -> None:
        """Tell which torque is commanded until the next tick in [N.m], (4,), body order; the limits cut it."""
        self.memory["torque"] = torque

    def _through_impacts(self, observation: Observation, landed: bool) -> StanceState:
        """The state with rates predicted while an impact lasts."""
        before, memory = self.leg, self.memory[0]
        if landed:
            self.leg = before.other
            memory["until"] = observation.t + self._impact_time if memory["any"] else -np.inf
        q, dq = self.leg.from_body(observation.q), self.leg.from_body(observation.dq)
        if memory["any"] and observation.t < memory["until"]:
            dq = self._carried(observation.t, before)
            if landed:
                _, dq = self._model.impact(before.from_body(observation.q), dq)
        return StanceState(q=q, dq=dq, leg=self.leg)

    def _carried(self, t: float, leg: Leg) -> Vector:
        """The last tick's rates, carried to now by the model, in the stance order of the leg that stood at it."""
        then, q, dq = float(self.memory["t"][0]), self.memory["q"][0].copy(), self.memory["dq"][0].copy()
        limit = self._model.torque_limits
        u = np.clip(leg.from_body(self.memory["torque"][0]), -limit, limit)
        found: Vector = dq + (t - then) * self._model.acceleration(q, dq, u)
        return found
