"""What passes between the two worlds: an observation one way, a torque the other, 1000 times a second.

The loop and the recorder know the controller only as the protocols below; `controller/` declares its own
mirror of them, and the type checker compares the two where they meet (`sim/bridge/run.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

JOINTS = ("left_hip", "right_hip", "left_knee", "right_knee")
"""Actuated joints, the order of every torque vector of shape (4,)."""

COORDINATES = (*JOINTS, "torso")
"""Order of every angle and rate vector of shape (5,): four joint angles, then the absolute torso angle."""

FEET = ("left_foot", "right_foot")
"""Order of every per-foot array."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observation:
    """What the controller may see of the plant at one tick.

    Attributes:
        t: Time since the start of the run in [s].
        q: Joint angles and absolute torso angle in [rad], (5,), ordered as `COORDINATES`.
        dq: Their rates in [rad/s], (5,).
        contact: Whether the (left, right) foot touches the ground.
    """

    t: float
    q: Vector
    dq: Vector
    contact: tuple[bool, bool]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlantState:
    """The truth at one tick; it goes to the log and to the judges of a run, never to the controller.

    Attributes:
        t: Time since the start of the run in [s].
        q: Joint angles and absolute torso angle in [rad], (5,), ordered as `COORDINATES`.
        dq: Their rates in [rad/s], (5,).
        hip: Hip position (x, z) in [m], (2,).
        dhip: Hip velocity (x, z) in [m/s], (2,).
        foot: Foot positions (x, z) in [m], (2, 2), a row a foot as in `FEET`; z is the height of the foot
            point above level ground at x = 0.
        clearance: Height of each foot above the ground under it in [m], (2,).
        torque: Torque the actuators really applied over the last hold in [N.m], (4,), ordered as `JOINTS`.
        contact: Whether each foot touches the ground.
        contact_force: Ground reaction on each foot, mean over the last hold, (tangential forward, normal)
            in [N], (2, 2), a row a foot.
        push: Sum of the external forces over the last hold (x, z) in [N], (2,).
        penetrating: Names of links other than feet that touch the ground.
        applied: External forces over the last hold, one by one.
    """

    t: float
    q: Vector
    dq: Vector
    hip: Vector
    dhip: Vector
    foot: Vector
    clearance: Vector
    torque: Vector
    contact: tuple[bool, bool]
    contact_force: Vector
    push: Vector
    penetrating: tuple[str, ...] = ()
    applied: tuple["AppliedForce", ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class AppliedForce:
    """An external force on one link during one hold.

    Attributes:
        body: Link name: "torso", "left_femur", "left_tibia", "right_femur" or "right_tibia".
        point: Point of attack (x, z) in the link's own frame in [m]; the frame's origin is the proximal joint
            (the hip for the torso), and its z axis runs along the link.
        force: Force (x, z) in the world frame in [N]; x is forward.
    """

    body: str
    point: tuple[float, float]
    force: tuple[float, float]


class Plant(Protocol):
    """A walker that obeys physics; the loop holds a torque on it and looks again."""

    def reset(self, q: Vector, dq: Vector, stance: str) -> None:
        """Put the walker on its stance foot.

        Args:
            q: Joint angles and torso angle in [rad], (5,), ordered as `COORDINATES`.
            dq: Their rates in [rad/s], (5,).
            stance: "left" or "right": the foot that stands, at rest, at x = 0 on the ground.
        """

    def observe(self) -> Observation:
        """What ideal sensors read now."""

    def state(self) -> PlantState:
        """The truth now."""

    def hold(self, u: Vector, forces: Sequence[AppliedForce] = ()) -> None:
        """Hold a commanded torque and external forces for one control period.

        Args:
            u: Commanded joint torque in [N.m], (4,), ordered as `JOINTS`; the plant saturates it.
            forces: External forces that act throughout the hold.

        Raises:
            PlantDiverged: the state is not finite any more.
        """


class Plan(Protocol):
    """What a controller expects over its horizon; a `ControlStep` may carry one as `plan`."""

    def outputs(self) -> Vector:
        """Predicted outputs in [rad], (N + 1, 4), stance order of each stage."""

    def contact_forces(self) -> Vector:
        """Predicted stance contact forces, (tangential, normal) in [N], (N, 2)."""


class ControlStep(Protocol):
    """What a controller decided in one tick. Joint vectors are ordered as `JOINTS`, outputs in stance order.

    Attributes:
        stance: "left" or "right": the leg the controller believes to stand.
        u_zd: ZD+PD share of the commanded torque in [N.m], (4,), before any saturation; the feed-forward of a
            controller without ZD+PD inside.
        u_mpc: MPC share in [N.m], (4,); zeros for a controller without one.
        u_total: Commanded torque in [N.m], (4,).
        y: Outputs q_i - h_d,i(theta) in [rad], (4,): stance hip, swing hip, stance knee, swing knee.
        dy: Their rates in [rad/s], (4,).
        theta: Internal clock in [rad].
        dtheta: Its rate in [rad/s].
        s: Normalised clock, 0 at the start and 1 at the end of a nominal step.
        contact_force: Stance contact force the model expects under `u_total`, (tangential, normal) in [N], (2,).
        impact_in: Ticks to the next impact the prediction sees, -1 if none within the horizon.
        status: How the torque came about: "zd-pd", "optimal", "suboptimal", "relaxed", or the reason for falling back
            to ZD+PD.
        fallback: Whether the named fall-back policy was used in this tick.
        iterations: Solver iterations.
        residuals: Primal residual, dual residual and duality gap of the solved problem, (3,).
        slack: Largest softening of a contact-force row over the horizon in [N].
        active: Number of active constraints over the horizon.
        solve_s: Wall time spent in the solver in [s].
        followed: Speed of the gait followed over that of the scenario's gait in [m/s], 0 for that gait itself.
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
    followed: float


class Controller(Protocol):
    """A law: from an observation to a torque. State it needs between ticks it keeps itself."""

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` ("left" or "right") is the leg that stands at the start."""

    def step(self, observation: Observation) -> Any:
        """Decide the torque for the coming control period; returns a `ControlStep`."""
