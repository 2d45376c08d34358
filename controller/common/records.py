"""What passes between the two worlds: an observation one way, a torque the other, 1000 times a second.

Common ground: `sim` knows a controller only by what stands here. Arrays in records are read-only by convention.
Joint vectors of shape (4,) are in *stance order* (stance hip, swing hip, stance knee, swing knee) inside the
controller and in *body order* (left hip, right hip, left knee, right knee) at its border: `Observation` and
`ControlStep`. The two orders differ by `swap_legs` when the right leg stands.
"""

import functools
import operator
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, StrEnum
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

JOINTS = ("left_hip", "right_hip", "left_knee", "right_knee")
"""Actuated joints, the body order of every torque vector of shape (4,)."""

COORDINATES = (*JOINTS, "torso")
"""Body order of every angle and rate vector of shape (5,): four joint angles, then the absolute torso angle."""

STANCE_HIP, SWING_HIP, STANCE_KNEE, SWING_KNEE, TORSO = range(5)
ROLES = ("stance hip", "swing hip", "stance knee", "swing knee")
"""Of the joints, in that order."""

ACTUATED = slice(0, 4)
"""The four actuated coordinates of q; they are also the controlled quantities h_0(q) of Eq. (5)."""

TANGENTIAL, NORMAL = range(2)
"""Rows of every contact force."""

_SWAPPED = np.array([SWING_HIP, STANCE_HIP, SWING_KNEE, STANCE_KNEE, TORSO])


def swap_legs(vector: Vector) -> Vector:
    """Exchange the roles of the legs: the R of the gait literature.

    Args:
        vector: Joint vector, (4,) or (5,).

    Returns:
        R times the vector, a copy of the same shape.
    """
    return vector[_SWAPPED[: vector.shape[0]]]


class Leg(Enum):
    """The leg that stands."""

    LEFT = "left"
    RIGHT = "right"

    @property
    def other(self) -> "Leg":
        """The leg that swings."""
        return Leg.RIGHT if self is Leg.LEFT else Leg.LEFT

    def from_body(self, vector: Vector) -> Vector:
        """Body order to stance order (or back: the map is its own inverse)."""
        return vector if self is Leg.LEFT else swap_legs(vector)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observation:
    """What a controller may see of the plant at one tick.

    Attributes:
        t: Time since the start of the run in [s].
        q: Joint angles and absolute torso angle in [rad], (5,), ordered as `COORDINATES`.
        dq: Their rates in [rad/s], (5,).
        contact: Whether the (left, right) foot stands on the ground; one that runs into a riser does not.
    """

    t: float
    q: Vector
    dq: Vector
    contact: tuple[bool, bool]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StanceState:
    """State of the pinned walker, x = (q, dq) of Eq. (1).

    Attributes:
        q: Coordinates in [rad], (5,), stance order.
        dq: Rates in [rad/s], (5,).
        leg: The leg that stands.
    """

    q: Vector
    dq: Vector
    leg: Leg


class Plan(Protocol):
    """What a controller expects over its horizon; worked out only when somebody looks."""

    def outputs(self) -> Vector:
        """Predicted outputs in [rad], (N + 1, 4), stance order of each stage."""

    def contact_forces(self) -> Vector:
        """Predicted stance contact forces, (tangential, normal) in [N], (N, 2)."""


class Status(StrEnum):
    """How a torque came about; the order is part of the log's format: append, never reorder."""

    OTHER = "other"
    ZD_PD = "zd-pd"  # no optimisation
    OPTIMAL = "optimal"
    NO_SOLUTION = "no-solution"
    SOLVER_ERROR = "solver-error"
    SECOND_SOLVER = "second-solver"  # one behind the one asked for
    PREDICTION_DIVERGED = "prediction-diverged"
    SUBOPTIMAL = "suboptimal"  # a plan that could be better
    RELAXED = "relaxed"  # the limits left no way to what a law guarantees


_zeros2, _zeros3, _zeros4 = (functools.partial(np.zeros, n) for n in (2, 3, 4))


@dataclass(slots=True, kw_only=True, eq=False)  # made a thousand times a second: frozen would take ten times as long
class ControlStep:
    """What a controller decided in one tick: a torque; all else is for the log and has a default.

    Joint vectors are ordered as `JOINTS`, outputs in stance order. Read-only by convention, as its arrays are.

    Attributes:
        stance: Leg the controller believes to stand, "left" or "right".
        u_total: Commanded torque, Eq. (23), in [N.m], (4,).
        u_zd: ZD+PD share of it in [N.m], (4,), not saturated; the feed-forward of a law without ZD+PD inside.
        u_mpc: MPC share in [N.m], (4,).
        y: Outputs, Eq. (5), in [rad], (4,).
        dy: Output rates in [rad/s], (4,).
        theta: Internal clock in [rad].
        dtheta: Its rate in [rad/s].
        s: Normalised clock, 0 to 1 over a nominal step.
        contact_force: Stance force expected under `u_total`, (tangential, normal) in [N], (2,).
        impact_in: Ticks to the first predicted impact, -1 if none within the horizon.
        status: How the torque came about, or why the tick fell back to saturated ZD+PD.
        fallback: Whether it did.
        iterations: Solver iterations.
        residuals: Feasibility, stationarity and complementarity of the torque found, all in [N.m], (3,); infinite if
            none was found.
        slack: Largest softening of a contact-force row over the horizon in [N].
        active: Active constraints over the horizon.
        solve_s: Wall time in the solver in [s].
        plan: What the controller expects over the horizon; None if it plans nothing.
        followed: Speed of the gait followed over that of the walker's own gait in [m/s].
        diagnostics: Figures of the law's own by name, with the unit in brackets: {"push [N]": 3.0}; they are logged and
            plotted. The names of the first tick that has any are those of the run.
    """

    stance: str
    u_total: Vector
    u_zd: Vector = field(default_factory=_zeros4)
    u_mpc: Vector = field(default_factory=_zeros4)
    y: Vector = field(default_factory=_zeros4)
    dy: Vector = field(default_factory=_zeros4)
    theta: float = 0.0
    dtheta: float = 0.0
    s: float = 0.0
    contact_force: Vector = field(default_factory=_zeros2)
    impact_in: int = -1
    status: Status = Status.OTHER
    fallback: bool = False
    iterations: int = 0
    residuals: Vector = field(default_factory=_zeros3)
    slack: float = 0.0
    active: int = 0
    solve_s: float = 0.0
    plan: Plan | None = None
    followed: float = 0.0
    diagnostics: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(
        cls, leg: Leg, u_total: Vector, *, u_zd: Vector | None = None, u_mpc: Vector | None = None, **rest: Any
    ) -> "ControlStep":
        """A step from torques in stance order.

        Args:
            leg: The leg that stands.
            u_total: Commanded torque in [N.m], (4,).
            u_zd: As the field; zero if not given.
            u_mpc: As the field; zero if not given.
            rest: The other fields, by name.
        """
        return cls(
            stance=leg.value,
            u_total=leg.from_body(u_total),
            u_zd=np.zeros(4) if u_zd is None else leg.from_body(u_zd),
            u_mpc=np.zeros(4) if u_mpc is None else leg.from_body(u_mpc),
            **rest,
        )


class Controller(Protocol):
    """A law: from an observation to a torque. State it needs between ticks it keeps itself."""

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` ("left" or "right") is the leg that stands at the start."""

    def step(self, observation: Observation) -> ControlStep:
        """Decide the torque for the coming control period."""


FLAG = np.int8
"""A flag in a row: compiled code takes no arrays of bool inside records."""

OBSERVATION = np.dtype([("t", float), ("q", float, 5), ("dq", float, 5), ("contact", FLAG, 2)], align=True)
"""An `Observation` as a row of numbers, field by field."""

STEP = np.dtype(
    [
        ("u_total", float, 4),
        ("u_zd", float, 4),
        ("u_mpc", float, 4),
        ("y", float, 4),
        ("dy", float, 4),
        ("theta", float),
        ("dtheta", float),
        ("s", float),
        ("contact_force", float, 2),
        ("residuals", float, 3),
        ("slack", float),
        ("solve_s", float),
        ("followed", float),
        ("impact_in", np.int64),
        ("iterations", np.int64),
        ("active", np.int64),
        ("status", np.int64),  # position in `Status`
        ("stance", np.int64),  # 0 left, 1 right
        ("fallback", FLAG),
    ],
    align=True,
)
"""A `ControlStep` as a row of numbers, field by field, its plan left out."""

Rows = NDArray[np.void]
"""Rows of `OBSERVATION` or `STEP`, (n,)."""


PLAIN = tuple(name for name in STEP.names or () if name not in ("stance", "status", "fallback"))
"""Fields of `STEP` that are those of `ControlStep` as they are."""

_plain = operator.attrgetter(*PLAIN)
_LEGS = tuple(leg.value for leg in Leg)
_STATUS_CODES = {status: code for code, status in enumerate(Status)}


def observation_of(row: np.void) -> Observation:
    """A row of `OBSERVATION` as a record, a copy."""
    fields: Any = row.item()
    t, q, dq, contact = fields
    left, right = contact.tolist()
    return Observation(t=t, q=q.copy(), dq=dq.copy(), contact=(left != 0, right != 0))


def write_step(rows: Rows, i: int, step: ControlStep) -> bool:
    """Fill row `i` of `STEP` rows from a record; whether its status is one of `Status`."""
    code = _STATUS_CODES.get(step.status)
    rows[i] = (*_plain(step), code or 0, _LEGS.index(step.stance), step.fallback)  # fields in the order of `STEP`
    return code is not None


@runtime_checkable
class RowController(Controller, Protocol):
    """A controller that also decides from row to row, without a record a tick: the same decisions, for less."""

    def decide(self, seen: Rows, step: Rows, i: int) -> None:
        """Fill row `i` of `step`, all of it, from row `i` of `seen`."""

    def plan(self) -> Plan | None:
        """What the last decision expects over its horizon; good until the next one."""
