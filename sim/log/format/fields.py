"""The one table of what a log holds: channels, fields, units, and what fills each. Everything else is derived from it.

Field names are SI and unit-free; a dotted name becomes a nested message (`u_total.left_hip`), because named
scalars plot well in every viewer. Groups are contiguous, and a kind has one size on the wire, so that the
bytes of a message have a fixed layout.
"""

from dataclasses import dataclass
from enum import Enum

from sim.interface import COORDINATES, JOINTS, LEGS, LINKS, Status

PACKAGE = "cmpc"
"""Protobuf package of every message below."""

OUTPUTS = ("stance_hip", "swing_hip", "stance_knee", "swing_knee")
"""Names of the four outputs, the order of `ControlStep.y`."""

STATUSES = tuple(status.value for status in Status)
"""Code of a status -> `ControlStep.status`. A status not listed here is logged as "other", its text as an
event. Codes are part of the file format: append, never reorder."""


class Kind(Enum):
    """What a field holds; each but a series has one size on the wire."""

    DOUBLE = "double"
    BOOL = "bool"
    INT32 = "sfixed32"
    LEG = "Leg"
    STATUS = "Status"
    SERIES = "repeated double"


ENUMS = {Kind.LEG: LEGS, Kind.STATUS: STATUSES}
"""Enum kinds and the names of their codes."""


@dataclass(frozen=True, slots=True)
class Field:
    """One number of a message.

    Attributes:
        name: Dotted name, such as "torque.left_hip".
        kind: What it holds.
        unit: SI unit; "1" for a pure number, empty for flags and enums.
        description: What it means.
        of: Column of a tick that fills it, as "part.field" of `sim.loop.Ticks`; "timing.tick" and "error.force" are
            the recorder's own. Empty where messages are not made from columns.
        at: Where in that field it stands.
    """

    name: str
    kind: Kind
    unit: str
    description: str
    of: str = ""
    at: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class ChannelTable:
    """One per-tick channel.

    Attributes:
        topic: Topic in the log.
        message: Message name within `PACKAGE`.
        fields: Its fields, in the order of their numbers.
    """

    topic: str
    message: str
    fields: tuple[Field, ...]


def _group(
    prefix: str, names: tuple[str, ...], unit: str, description: str, kind: Kind = Kind.DOUBLE, *, of: str = ""
) -> tuple[Field, ...]:
    return tuple(Field(f"{prefix}.{name}", kind, unit, description, of, (at,)) for at, name in enumerate(names))


def _per_foot(prefix: str, axes: tuple[str, str], unit: str, description: str, *, of: str) -> tuple[Field, ...]:
    return tuple(
        Field(f"{prefix}.{leg}.{name}", Kind.DOUBLE, unit, description, of, (foot, axis))
        for foot, leg in enumerate(LEGS)
        for axis, name in enumerate(axes)
    )


_TN = ("tangential", "normal")
_XZ = ("x", "z")

PLANT_STATE = ChannelTable(
    "/plant/state",
    "PlantState",
    (
        *_group("q", COORDINATES, "rad", "true joint angle; absolute angle of the torso", of="state.q"),
        *_group("dq", COORDINATES, "rad/s", "true rate", of="state.dq"),
        *_group("hip", _XZ, "m", "hip position", of="state.hip"),
        *_group("dhip", _XZ, "m/s", "hip velocity", of="state.dhip"),
        *_per_foot("foot", _XZ, "m", "foot position; z above level ground at x = 0", of="state.foot"),
        *_group("clearance", LEGS, "m", "height of the foot above the ground under it", of="state.clearance"),
        *_group("torque", JOINTS, "N.m", "torque the actuators really applied over the last hold", of="state.torque"),
        *_per_foot(
            "contact_force", _TN, "N", "ground reaction on the foot, mean over the last hold", of="state.contact_force"
        ),
        *_group("push", _XZ, "N", "sum of the external forces over the last hold", of="state.push"),
        *_group("contact", LEGS, "", "the foot touches the ground", Kind.BOOL, of="state.contact"),
        *_group(
            "penetrating",
            LINKS,
            "",
            "the link itself, not its foot, touches the ground",
            Kind.BOOL,
            of="state.penetrating",
        ),
    ),
)

CONTROL = ChannelTable(
    "/control",
    "Control",
    (
        *_group("observation.q", COORDINATES, "rad", "measured joint angle; absolute angle of the torso", of="seen.q"),
        *_group("observation.dq", COORDINATES, "rad/s", "measured rate", of="seen.dq"),
        *_group("observation.contact", LEGS, "", "contact sensor of the foot", Kind.BOOL, of="seen.contact"),
        *_group(
            "u_zd",
            JOINTS,
            "N.m",
            "ZD+PD share of the commanded torque, before saturation; else feed-forward",
            of="step.u_zd",
        ),
        *_group(
            "u_mpc", JOINTS, "N.m", "MPC share of the commanded torque; else what is not feed-forward", of="step.u_mpc"
        ),
        *_group("u_total", JOINTS, "N.m", "commanded torque", of="step.u_total"),
        *_group("y", OUTPUTS, "rad", "output q_i - h_d,i(theta)", of="step.y"),
        *_group("dy", OUTPUTS, "rad/s", "rate of the output", of="step.dy"),
        *_group(
            "contact_force", _TN, "N", "stance contact force the model expects under u_total", of="step.contact_force"
        ),
        Field("theta", Kind.DOUBLE, "rad", "internal clock", "step.theta"),
        Field("dtheta", Kind.DOUBLE, "rad/s", "rate of the internal clock", "step.dtheta"),
        Field("s", Kind.DOUBLE, "1", "normalised clock, 0 to 1 over a nominal step", "step.s"),
        Field("impact_in", Kind.INT32, "tick", "ticks to the next predicted impact, -1 if none", "step.impact_in"),
        Field("stance", Kind.LEG, "", "the leg the controller believes to stand", "step.stance"),
        Field("fallback", Kind.BOOL, "", "the fall-back policy was used", "step.fallback"),
    ),
)

MPC = ChannelTable(
    "/mpc",
    "Mpc",
    (
        *_group(
            "residual",
            ("primal", "dual", "gap"),
            "N.m",
            "feasibility, stationarity, complementarity of the torque",
            of="step.residuals",
        ),
        Field("slack", Kind.DOUBLE, "N", "largest softening of a contact-force row over the horizon", "step.slack"),
        Field("iterations", Kind.INT32, "1", "solver iterations", "step.iterations"),
        Field("active", Kind.INT32, "1", "active constraints over the horizon", "step.active"),
        Field("status", Kind.STATUS, "", "how the torque came about", "step.status"),
    ),
)

TIMING = ChannelTable(
    "/timing",
    "Timing",
    (
        Field("tick", Kind.DOUBLE, "s", "controller wall time, observation in to torque out", "timing.tick"),
        Field("solve", Kind.DOUBLE, "s", "wall time spent in the solver", "step.solve_s"),
    ),
)
"""The only channel that may differ between two runs of one scenario and seed."""

PREDICTION_ERROR = ChannelTable(
    "/prediction/error",
    "PredictionError",
    _group(
        "contact_force",
        _TN,
        "N",
        "ground reaction over the last hold minus the expected one, on the stance foot; 0 at first",
        of="error.force",
    ),
)

CHANNELS = (PLANT_STATE, CONTROL, MPC, PREDICTION_ERROR, TIMING)
"""Every per-tick channel, in the order of their messages within a tick."""

PREDICTION = ChannelTable(
    "/prediction",
    "Prediction",
    (
        *_group("y", OUTPUTS, "rad", "output expected, from now to the end of the horizon", Kind.SERIES),
        *_group("contact_force", _TN, "N", "stance force expected, from now to the last stage", Kind.SERIES),
        Field("period", Kind.DOUBLE, "s", "time from one value of a series to the next"),
        Field("impact_in", Kind.INT32, "tick", "ticks to the next predicted impact, -1 if none"),
    ),
)
"""What the controller expects over its horizon, at the rate of /tf."""

PREDICTED_IMPACT = ChannelTable(
    "/prediction/impact",
    "PredictedImpact",
    (
        Field("foreseen", Kind.INT32, "tick", "how long before the impact it was first predicted, 0 if never"),
        Field("first_error", Kind.INT32, "tick", "first predicted time of the impact minus the real one"),
        Field("last_error", Kind.INT32, "tick", "last predicted time of the impact minus the real one"),
    ),
)
"""At each impact: when it had been predicted for. A positive error means that it came early."""

DIAGNOSTICS = "/diagnostics"
"""Topic of figures of a law's own; their names are those of the first tick that has any."""

DIAGNOSTICS_MESSAGE = "Diagnostics"

TABLES = (*CHANNELS, PREDICTION, PREDICTED_IMPACT)
"""Every channel with messages of this project's own."""
