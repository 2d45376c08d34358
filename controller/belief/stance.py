"""Which leg stands, and its rates while an impact lasts: the controller's own view, from what it measures."""

from typing import Any

import numpy as np

from controller.belief.kernels import (
    N_Q,
    N_U,
    Stage,
    Walker,
    accelerate,
    impact,
    new_stage,
    place,
    swing_foot,
)
from controller.belief.model import WalkerModel
from controller.common.compiled import Array, compiled, inlined, nested
from controller.common.records import OBSERVATION, Leg, Observation, StanceState, Vector

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
        ("impact_time", float),  # [s] how long rates are predicted after a landing
        ("limit", float, N_U),  # [N.m] of the motors, stance order
    ],
    align=True,
)
"""What an estimator is and keeps from tick to tick, where compiled code finds it."""


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


@nested
def turn_to(leg: int, seen: Any, q: Array, dq: Array) -> None:
    """Fill the state measured in a row in the order of a leg that stands, 0 left, 1 right; (5,) each."""
    for i in range(N_Q):
        j = i ^ leg if i < N_U else i
        q[i], dq[i] = seen.q[j], seen.dq[j]


@nested
def through(memory: Any, walker: Walker, seen: Any, q: Array, dq: Array) -> None:
    """Take over a row in which a foot may land or an impact lasts; see `StanceEstimator`."""
    m, stage = memory[0], new_stage()
    before, landed = m.leg, False
    if seen.contact[1 - before] != 0:
        turn_to(before, seen, q, dq)
        place(q, dq, stage)
        ahead, _, _ = swing_foot(walker, stage)
        landed = ahead > 0.0
    if landed:
        m.leg = 1 - before
        m.until = seen.t + m.impact_time if m.any != 0 else -np.inf
    turn_to(m.leg, seen, q, dq)
    if m.any != 0 and seen.t < m.until:
        carry(m, walker, before, seen.t, dq, stage)
        if landed:
            there, measured = np.empty(N_Q), np.empty(N_Q)
            turn_to(before, seen, there, measured)
            place(there, dq, stage)
            impact(walker, there, dq, stage)
    for i in range(N_Q):
        m.q[i], m.dq[i] = q[i], dq[i]
    m.any, m.t = 1, seen.t


@nested
def carry(m: Any, walker: Walker, leg: int, t: float, dq: Array, stage: Stage) -> None:
    """Fill the last tick's rates, carried to t by the model, in the order of the leg that stood at it."""
    u = stage.u
    for i in range(N_U):
        u[i] = min(max(m.torque[i ^ leg], -m.limit[i]), m.limit[i])
    place(m.q, m.dq, stage)
    accelerate(walker, m.dq, u, stage)
    for i in range(N_Q):
        dq[i] = m.dq[i] + (t - m.t) * stage.ddq[i]


@nested
def watch(memory: Any, walker: Walker, seen: Any, q: Array, dq: Array) -> None:
    """Take over a row of `OBSERVATION`, whatever happens in it: fill the state in stance order, (5,) each."""
    if calm(memory, seen):
        take(memory, seen, q, dq)
    else:
        through(memory, walker, seen, q, dq)


@compiled
def _watch(memory: Any, walker: Walker, seen: Any, q: Array, dq: Array) -> None:
    watch(memory, walker, seen[0], q, dq)


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
        self._seen = np.zeros(1, OBSERVATION)
        self.memory = np.zeros(1, MEMORY)
        self.memory["impact_time"], self.memory["limit"] = impact_time, model.torque_limits
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
        row, q, dq = self._seen[0], np.empty(N_Q), np.empty(N_Q)
        row["t"], row["q"], row["dq"], row["contact"] = (
            observation.t,
            observation.q,
            observation.dq,
            observation.contact,
        )
        _watch(self.memory, self._model.lumped, self._seen, q, dq)
        return StanceState(q=q, dq=dq, leg=self.leg)

    def held(self, torque: Vector) -> None:
        """Tell which torque is commanded until the next tick in [N.m], (4,), body order; the limits cut it."""
        self.memory["torque"] = torque
