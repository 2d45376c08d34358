"""The records that flow through the controller; arrays in them are read-only by convention.

Joint vectors of shape (4,) are in *stance order* (stance hip, swing hip, stance knee, swing knee) inside the
controller and in *body order* (left hip, right hip, left knee, right knee) at its border: `Observation` and
`ControlStep`. The two orders differ by `swap_legs` when the right leg stands.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

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


class Observation(Protocol):
    """What a controller may see at one tick.

    Attributes:
        t: Time since the start of the run in [s].
        q: Joint angles, body order, then the absolute torso angle in [rad], (5,).
        dq: Their rates in [rad/s], (5,).
        contact: Whether the (left, right) foot touches the ground.
    """

    @property
    def t(self) -> float: ...  # noqa: D102
    @property
    def q(self) -> Vector: ...  # noqa: D102
    @property
    def dq(self) -> Vector: ...  # noqa: D102
    @property
    def contact(self) -> tuple[bool, bool]: ...  # noqa: D102


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControlStep:
    """What a controller decided in one tick; joint vectors in body order, outputs in stance order.

    Attributes:
        stance: Leg the controller believes to stand, "left" or "right".
        u_zd: ZD+PD share of the torque in [N.m], (4,), not saturated; the feed-forward of a law without ZD+PD inside.
        u_mpc: MPC share in [N.m], (4,).
        u_total: Commanded torque, Eq. (23), in [N.m], (4,).
        y: Outputs, Eq. (5), in [rad], (4,).
        dy: Output rates in [rad/s], (4,).
        theta: Internal clock in [rad].
        dtheta: Its rate in [rad/s].
        s: Normalised clock, 0 to 1 over a nominal step.
        contact_force: Stance force expected under `u_total`, (tangential, normal) in [N], (2,).
        impact_in: Ticks to the first predicted impact, -1 if none within the horizon.
        status: "zd-pd", "optimal", "suboptimal" for a plan that could be better, "relaxed" where the limits left no
            way to what a law guarantees, or why the tick fell back to saturated ZD+PD.
        fallback: Whether it did.
        iterations: Solver iterations.
        residuals: Feasibility, stationarity and complementarity residuals of the solved problem, (3,).
        slack: Largest softening of a contact-force row over the horizon in [N].
        active: Active constraints over the horizon.
        solve_s: Wall time in the solver in [s].
        plan: What the controller expects over the horizon; None if it plans nothing.
        followed: Speed of the gait followed over that of the walker's own gait in [m/s].
    """

    stance: str
    u_zd: Vector
    u_mpc: Vector
    u_total: Vector
    y: Vector
    dy: Vector
    theta: float
    dtheta: float
    s: float
    contact_force: Vector
    impact_in: int
    status: str
    fallback: bool
    iterations: int
    residuals: Vector
    slack: float
    active: int
    solve_s: float
    plan: Plan | None = None
    followed: float = 0.0
