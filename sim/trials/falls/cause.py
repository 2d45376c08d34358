"""What can break in a trial that falls, and the figures that speak for it."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any


class Cause(Enum):
    """What breaks; the value is what users read, its first word what the evidence bears."""

    START = "start: a foot begins in the ground"
    ACTUATOR = "actuator: a joint does not get the torque asked of it"
    DELAY = "delay: what is measured or applied comes late"
    SENSOR = "sensor: what is measured is not what is"
    TRIP = "clearance: the swing foot meets the ground"
    SLIP = "friction: the stance foot slides"
    FLIGHT = "contact: both feet leave the ground"
    STALL = "energy: the clock stands still"
    LATE = "prediction: the foot lands later than foreseen"
    OVERRUN = "landing: the step is over and no foot has landed"
    EARLY = "landing: a foot lands before the step is over"
    TORQUE = "torque: a joint is at its limit"
    SOLVER = "solver: the controller falls back"
    TRACKING = "tracking: the outputs are lost, torque to spare"
    UNCLEAR = "unclear: none of the symptoms lasts"

    @property
    def word(self) -> str:
        """The value's first word."""
        return self.value.split(":")[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Figures of the time around the beginning of a fall, `sim.trials.falls.verdict.WINDOW` to either side.

    Attributes:
        began_s: When the fall began, in simulated time, in [s].
        lasted_s: Time from there to the end of the run in [s].
        torque_share: Share of the time in which some joint was at its limit.
        joint: The joint that was there longest, empty if none was.
        flight_share: Share of the time with both feet off the ground.
        slip_m: Distance the stance foot slid in [m].
        scuff_s: Time the swing foot touched the ground where no step is, in [s].
        clock_min_rad_s: Least rate of the clock in [rad/s].
        clock_max_rad_s: Its largest rate in [rad/s].
        late_s: Largest time since the landing was due that the controller had foreseen, in [s]; 0 if none was.
        s_max: Largest normalised clock; a foot should have landed at 1.
        output_max_rad: Largest output in [rad].
        fallback_share: Share of the time in which the controller fell back.
        landed_s: Normalised clock of the last landing before or around it; 1 if there was none.
        sunk_m: Depth of the lower foot in the ground at the start of the run in [m].
        weak_joint: The joint that lacked most of the torque asked of it, before the fall and in it.
        given: Part of the torque asked of it that it got, 0 to 1, delays aside.
        measured_late_s: Time by which the observation lags behind the truth, in [s].
        applied_late_s: Time by which the torque lags behind the command, in [s].
        sensor_error_rad: Largest mean difference of a measured from a true angle, delays aside, in [rad].
        off_s: When both feet left the ground, before the fall or in it, in [s].
        asked_Nm: Largest torque asked of a joint since the fall began, whatever the joint can give, in [N.m].
    """

    began_s: float
    lasted_s: float
    torque_share: float
    joint: str
    flight_share: float
    slip_m: float
    scuff_s: float
    clock_min_rad_s: float
    clock_max_rad_s: float
    late_s: float
    s_max: float
    output_max_rad: float
    fallback_share: float
    sunk_m: float
    landed_s: float = 1.0
    weak_joint: str = ""
    given: float = 1.0
    measured_late_s: float = 0.0
    applied_late_s: float = 0.0
    sensor_error_rad: float = 0.0
    off_s: float = 0.0
    asked_Nm: float = 0.0

    def to_json(self) -> str:
        """As one line of JSON, figures to four digits; what is not finite becomes null."""
        values = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return json.dumps({name: _rounded(value) for name, value in values.items()})


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.4g}") if math.isfinite(value) else None
    return value


PROOFS = {
    Cause.START: "{sunk_m:.4f} m in the ground at t = 0",
    Cause.ACTUATOR: "{weak_joint} gets {given:.0%} of it",
    Cause.DELAY: "measured {measured_late_s:.3f} s late, applied {applied_late_s:.3f} s late",
    Cause.SENSOR: "by {sensor_error_rad:.3f} rad on the mean",
    Cause.TRIP: "it touches for {scuff_s:.3f} s",
    Cause.SLIP: "by {slip_m:.3f} m",
    Cause.FLIGHT: "none touches from {off_s:.3f} s on, up to {asked_Nm:.0f} N.m asked",
    Cause.STALL: "down to {clock_min_rad_s:.2f} rad/s",
    Cause.LATE: "{late_s:.3f} s overdue, s = {s_max:.2f}",
    Cause.OVERRUN: "s = {s_max:.2f}",
    Cause.EARLY: "at s = {landed_s:.2f}",
    Cause.TORQUE: "{joint}, {torque_share:.0%} of the time",
    Cause.SOLVER: "{fallback_share:.0%} of the ticks",
    Cause.TRACKING: "{output_max_rad:.2f} rad, torque at a limit {torque_share:.0%} of the time",
    Cause.UNCLEAR: "",
}
"""The figures that speak for each cause."""


def decisive(cause: str, evidence: Mapping[str, Any]) -> str:
    """The figures of an evidence that speak for a cause, in words.

    Args:
        cause: Value of a `Cause`.
        evidence: Fields of an `Evidence` by name.
    """
    blank = dict.fromkeys(Evidence.__dataclass_fields__, math.nan)  # results of before lack what was added since
    known = blank | {name: math.nan if value is None else value for name, value in evidence.items()}
    return PROOFS[Cause(cause)].format(**known)


def sentence(cause: Cause, evidence: Evidence) -> str:
    """When and how a fall began, and how long it took."""
    figures = {name: getattr(evidence, name) for name in evidence.__dataclass_fields__}
    proof = decisive(cause.value, figures)
    what = f"{cause.value}, {proof}" if proof else cause.value
    return f"from {evidence.began_s:.3f} s {what}; down {evidence.lasted_s:.2f} s later"
