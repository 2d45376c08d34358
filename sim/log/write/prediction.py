"""Prediction against outcome: the horizon now and then, the contact force every tick, the impact at each impact."""

import numpy as np

from sim.interface import ControlStep, Plan, PlantState, Vector
from sim.log.format.fields import LEG_CODES, OUTPUTS, PREDICTED_IMPACT, PREDICTION
from sim.log.format.layout import layout_of
from sim.log.format.schema import descriptor, message_class

STAGE_EVERY = 5
"""Stages from one logged to the next; a horizon in full would double the log."""

_Prediction = message_class(PREDICTION)
_IMPACT = layout_of(descriptor(PREDICTED_IMPACT))
_NONE = np.zeros(2)


def horizon_message(plan: Plan, period: float, impact_in: int) -> bytes:
    """Serialised /prediction.

    Args:
        plan: What the controller expects.
        period: Control period in [s].
        impact_in: Ticks to the next predicted impact, -1 if none.
    """
    message = _Prediction(period=STAGE_EVERY * period, impact_in=impact_in)
    for name, series in zip(OUTPUTS, plan.outputs()[::STAGE_EVERY].T.tolist(), strict=True):
        getattr(message.y, name).extend(series)
    tangential, normal = plan.contact_forces()[::STAGE_EVERY].T.tolist()
    message.contact_force.tangential.extend(tangential)
    message.contact_force.normal.extend(normal)
    return message.SerializeToString(deterministic=True)


class Hindsight:
    """Remembers what the controller expected until the plant has answered."""

    def __init__(self) -> None:
        self._force: Vector | None = None
        self._foot = 0
        self._first: tuple[int, int] | None = None  # tick, tick of the predicted impact
        self._last: tuple[int, int] | None = None

    def force_error(self, state: PlantState) -> Vector:
        """Real minus expected contact force over the last hold in [N], (2,); 0 before the first."""
        if self._force is None:
            return _NONE
        error: Vector = state.contact_force[self._foot] - self._force
        return error

    def remember(self, k: int, step: ControlStep) -> None:
        """Note what tick `k` expects."""
        self._force, self._foot = step.contact_force, LEG_CODES[step.stance]
        if step.impact_in > 0:
            self._last = (k, k + step.impact_in)
            self._first = self._first or self._last

    def impact(self, k: int) -> bytes:
        """Serialised /prediction/impact for an impact at tick `k`; what was expected of it is forgotten."""
        first, last = self._first, self._last
        self._first = self._last = None
        message = np.frombuffer(bytearray(_IMPACT.template), _IMPACT.dtype)
        if first and last:
            message["foreseen"], message["first_error"], message["last_error"] = (
                k - first[0],
                first[1] - k,
                last[1] - k,
            )
        return message.tobytes()
