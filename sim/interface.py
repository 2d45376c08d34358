"""The truth's side of the seam: what a plant is and what it tells.

What passes between the two worlds (`Observation`, `ControlStep`, `Controller`) is common ground, handed on from
`controller.records`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from controller.records import COORDINATES, JOINTS, Controller, ControlStep, Observation, Plan, Status, Vector

__all__ = [
    "COORDINATES",
    "FEET",
    "JOINTS",
    "LEGS",
    "AppliedForce",
    "ControlStep",
    "Controller",
    "Observation",
    "Plan",
    "Plant",
    "PlantState",
    "Status",
    "Vector",
]

LEGS = ("left", "right")
"""Names of the legs; the position is a leg's number on the plant's side, and its row in every per-foot array."""

FEET = tuple(f"{leg}_foot" for leg in LEGS)


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

    @property
    def com(self) -> Mapping[str, tuple[float, float]]:
        """Centre of mass (x, z) of each link in its own frame in [m], by link name: where pushes attack by default."""

    @property
    def torque_limits(self) -> Vector:
        """Actuator limits in [N.m], (4,), ordered as `JOINTS`; infinite without saturation."""

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
