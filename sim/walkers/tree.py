"""A robot's file as a tree of links, whatever its format: what `reduction.py` makes a five-link walker of."""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FULL_TURN = 6.28
"""[rad] A bound this far from the zero pose stops nothing."""

Kind = Literal["fixed", "hinge", "slide", "planar", "free"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the table of a conversion.

    Attributes:
        part: Of the file.
        found: What was found there.
        made: What was made of it.
        verdict: "as it is", "made", "left out", "given", "must be given" or "outside"; the last two stop it.
    """

    part: str
    found: str
    made: str
    verdict: str

    @property
    def stops(self) -> bool:
        """Whether no walker can be made because of it."""
        return self.verdict in ("must be given", "outside")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inertial:
    """A mass in its link's frame.

    Attributes:
        mass: In [kg].
        com: Centre of mass in [m], (3,).
        inertia: About the centre of mass, along the link's axes, in [kg m^2], (3, 3).
    """

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Joint:
    """What joins a link to its parent.

    Attributes:
        name: In the file.
        kind: How it moves.
        axis: In the link's frame, (3,), of length 1.
        anchor: A point of the axis in the link's frame in [m], (3,).
        zero: Coordinate at which the link's placement holds in [rad] or [m].
        low, high: Stops; infinite where there is none.
        effort: Largest torque in [N.m]; NaN where the file says none.
        damping: In [N.m.s/rad].
        friction: Dry, in [N.m].
        rotor: Rotor inertia as the joint feels it in [kg m^2].
        stiffness: Of a spring in [N.m/rad].
        rest: Where the spring is slack in [rad].
    """

    name: str
    kind: Kind
    axis: Array
    anchor: Array
    zero: float = 0.0
    low: float = -math.inf
    high: float = math.inf
    effort: float = math.nan
    damping: float = 0.0
    friction: float = 0.0
    rotor: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tip:
    """A point of a link that may be its foot.

    Attributes:
        what: In words.
        point: In the link's frame in [m], (3,).
        rank: How likely; the lowest is taken.
    """

    what: str
    point: Array
    rank: int


@dataclass(slots=True, kw_only=True, eq=False)
class Link:
    """One link.

    Attributes:
        name: In the file.
        parent: Its parent's name; None for a root.
        placement: Its frame in its parent's where the joint is at `zero`, (4, 4).
        joint: What joins it to its parent; None for a root and for what is fixed.
        inertials: Its masses.
        tips: Points that may be a foot.
    """

    name: str
    parent: str | None
    placement: Array
    joint: Joint | None = None
    inertials: list[Inertial] = field(default_factory=list)
    tips: list[Tip] = field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tree:
    """A robot's links, parents before children, and what was noticed on reading them."""

    links: list[Link]
    rows: list[Row]


def rotation(rpy: Array) -> Array:
    """Rotation matrix of roll, pitch, yaw about fixed axes in [rad], (3, 3)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def placed(rotation_matrix: Array, position: Array) -> Array:
    """A frame as a matrix, (4, 4)."""
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation_matrix, position
    return frame


def at(frame: Array, point: Array) -> Array:
    """A point of a frame, seen from outside it, (3,)."""
    seen: Array = frame[:3, :3] @ point + frame[:3, 3]
    return seen


def words(numbers: Array) -> str:
    """A few numbers as a file would have them."""
    return " ".join(f"{0.0 if abs(x) < 1e-12 else x:.6g}" for x in numbers)
