"""Prediction against outcome: the horizon now and then, the contact force every tick, the impact at each impact."""

import numpy as np

from sim.interface import Plan, Vector
from sim.log.format.fields import OUTPUTS, PREDICTED_IMPACT, PREDICTION
from sim.log.format.layout import layout_of
from sim.log.format.schema import descriptor, message_class
from sim.loop import Ticks

STAGE_EVERY = 5
"""Stages from one logged to the next; a horizon in full would double the log."""

_Prediction = message_class(PREDICTION)
_IMPACT = layout_of(descriptor(PREDICTED_IMPACT))


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
        self._force: tuple[int, Vector] | None = None  # foot, and what was expected of it at the last tick
        self._first: tuple[int, int] | None = None  # tick, tick of the predicted impact
        self._last: tuple[int, int] | None = None

    def look(self, ticks: Ticks) -> Vector:
        """Note what ticks expect; real minus expected contact force over the last hold at each in [N], (n, 2)."""
        n, stance, expected = len(ticks), ticks.step["stance"], ticks.step["contact_force"]
        error = np.zeros((n, 2))
        real = ticks.state["contact_force"]
        error[1:] = real[np.arange(1, n), stance[:-1]] - expected[:-1]
        if self._force is not None:
            foot, force = self._force
            error[0] = real[0, foot] - force
        self._force = int(stance[-1]), expected[-1].copy()
        foreseen = np.flatnonzero(ticks.step["impact_in"] > 0)
        if len(foreseen):
            k = ticks.first + foreseen[[0, -1]]
            at = k + ticks.step["impact_in"][foreseen[[0, -1]]]
            self._first = self._first or (int(k[0]), int(at[0]))
            self._last = int(k[1]), int(at[1])
        return error

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
