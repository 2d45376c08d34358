"""The truth's side of the seam: what a plant is and what it tells.

What passes between the two worlds (`Observation`, `ControlStep`, `Controller`) is common ground, handed on from
`controller.common.records`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from controller.common.records import (
    COORDINATES,
    FLAG,
    JOINTS,
    OBSERVATION,
    PLAIN,
    STEP,
    Controller,
    ControlStep,
    Observation,
    Plan,
    RowController,
    Rows,
    Status,
    Vector,
    observation_of,
    write_step,
)

__all__ = [
    "COORDINATES",
    "FEET",
    "JOINTS",
    "LEGS",
    "LINKS",
    "OBSERVATION",
    "PLAIN",
    "STATE",
    "STEP",
    "AppliedForce",
    "ControlStep",
    "Controller",
    "NoTorque",
    "Observation",
    "Plan",
    "Plant",
    "PlantState",
    "RowController",
    "Rows",
    "Status",
    "Vector",
    "observation_of",
    "write_step",
]

LEGS = ("left", "right")
"""Names of the legs; the position is a leg's number on the plant's side, and its row in every per-foot array."""

LINKS = ("torso", "left_femur", "left_tibia", "right_femur", "right_tibia")
"""Links of the walker, root first."""

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
        contact: Whether each foot stands on the ground; one that runs into a ledge's riser does not.
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

    @classmethod
    def of(cls, row: np.void, applied: tuple["AppliedForce", ...] = ()) -> Self:
        """The state in a row of `STATE`, a copy; `applied` are the forces that the row does not hold."""
        numbers = {name: row[name].copy() for name in _ARRAYS}
        left, right = (bool(flag) for flag in row["contact"])
        touching = row["penetrating"].tolist()
        return cls(
            t=float(row["t"]),
            contact=(left, right),
            penetrating=tuple(link for link, touches in zip(LINKS, touching, strict=True) if touches),
            applied=applied,
            **numbers,
        )


STATE = np.dtype(
    [
        ("t", float),
        ("q", float, 5),
        ("dq", float, 5),
        ("hip", float, 2),
        ("dhip", float, 2),
        ("foot", float, (2, 2)),
        ("clearance", float, 2),
        ("torque", float, 4),
        ("contact_force", float, (2, 2)),
        ("push", float, 2),
        ("contact", FLAG, 2),
        ("penetrating", FLAG, len(LINKS)),
    ],
    align=True,
)
"""A `PlantState` as a row of numbers, field by field, without the forces one by one."""

_ARRAYS = tuple(name for name in STATE.names or () if STATE[name].shape and STATE[name].base.kind == "f")


class NoTorque(ValueError):
    """A commanded torque is not finite, or not four numbers."""


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
    """A walker that obeys physics; the loop holds a torque on it and looks again, from row to row."""

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

    def load(self, forces: Sequence[AppliedForce]) -> None:
        """Name the external forces that may act in the holds to come."""

    def look(self, state: Rows, seen: Rows, i: int) -> None:
        """Fill row `i` of `state` (`STATE`) with the truth now, of `seen` (`OBSERVATION`) with what is seen of it."""

    def move(self, step: Rows, i: int, acting: NDArray[np.bool_]) -> None:
        """Hold the torque commanded in row `i` of `step`, of `STEP`, for one control period; the plant saturates it.

        Args:
            step: What was decided.
            i: Its row.
            acting: Which of the forces loaded act throughout the hold, (number of forces,).

        Raises:
            NoTorque: the torque is not finite: a defect of the controller.
            PlantDiverged: the state is not finite any more.
        """
