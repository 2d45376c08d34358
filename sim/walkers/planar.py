"""What a five-link walker of a robot's tree is in this program's conventions, and where that puts the file's robot.

In the plane of the walk, with x forward and z up, angles are counted about (0, -1, 0). A link's axis runs from its
joint to the next, or to the foot; the hip's angle is the femur's axis against the torso's z, the knee's the tibia's
against the femur's. Each joint of the file then is one coordinate here up to its sign and an offset: axes either way,
rotated origins, links that hang down and mirrored legs are all that.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sim.walkers.tree import Array

ROLES = ("left_hip", "left_knee", "right_hip", "right_knee")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarLink:
    """A link: mass in [kg], length and centre of mass along and across its axis in [m], inertia in [kg m^2]."""

    mass: float
    length: float
    com: float
    com_across: float
    inertia: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarJoint:
    """A joint: torque limit and friction in [N.m], the rest as in `tree.Joint`; angles in our coordinates."""

    torque: float
    damping: float
    friction: float
    rotor: float
    stiffness: float
    rest: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Coordinate:
    """How a joint of the file is a coordinate here: ours = sign (theirs - zero) + offset."""

    name: str
    sign: float
    zero: float
    offset: float

    def ours(self, theirs: float) -> float:
        """Our coordinate in [rad]."""
        return self.sign * (theirs - self.zero) + self.offset

    def theirs(self, ours: float) -> float:
        """The file's coordinate in [rad]."""
        return self.sign * (ours - self.offset) + self.zero


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanarWalker:
    """What a file's robot is here.

    Attributes:
        torso, femur, tibia: The links; the legs are alike.
        hip, knee: The joints.
        coordinates: Of each of `ROLES`.
        plane: Forward, left and up in the file's world, rows, (3, 3).
        root: First link of the file's torso.
        frame: Its frame in the file's world in the zero pose, (4, 4).
        middle: The hips' axis in the middle between the legs, there, (3,).
        lean: Angle of the torso in the file's zero pose in [rad].
        feet: Link and point in its frame of the left and the right foot.
        rounded: Largest angle by which an axis was taken into the plane in [rad], or share by which legs were made
            equal.
    """

    torso: PlanarLink
    femur: PlanarLink
    tibia: PlanarLink
    hip: PlanarJoint
    knee: PlanarJoint
    coordinates: dict[str, Coordinate]
    plane: Array
    root: str
    frame: Array
    middle: Array
    lean: float
    feet: tuple[tuple[str, Array], tuple[str, Array]]
    rounded: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What a file does not say.

    Attributes:
        torque: Torque limits of hips and knees in [N.m].
        even_legs: Whether legs that differ a little are made equal.
        tibia_length: From knee to foot in [m].
        names: Link of the torso, and joints of the four roles, by role.
    """

    torque: tuple[float, float] | None = None
    even_legs: bool = False
    tibia_length: float | None = None
    names: Mapping[str, str] = field(default_factory=dict)


def placement(walker: PlanarWalker, q: Array, dq: Array) -> tuple[Array, Array, Array, Array]:
    """Where the file's torso is when ours is at q, in a world of x forward, y left, z up.

    Args:
        walker: The walker.
        q: Hip x, z in [m], torso angle in [rad], (3,).
        dq: Their rates, (3,).

    Returns:
        Rotation (3, 3) and origin (3,) of its root link; derivatives of (origin's velocity, angular velocity in the
        link's frame) by the three rates, (6, 3); and the origin's acceleration at zero second derivatives, (3,).
    """
    s, c = math.sin(q[2] - walker.lean), math.cos(q[2] - walker.lean)
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])  # about (0, -1, 0)
    rotation = turn @ walker.plane @ walker.frame[:3, :3]
    arm = turn @ walker.plane @ (walker.frame[:3, 3] - walker.middle)  # from the hips to the origin
    axis = np.array([0.0, -1.0, 0.0])
    jacobian = np.zeros((6, 3))
    jacobian[0, 0] = jacobian[2, 1] = 1.0
    jacobian[:3, 2] = np.cross(axis, arm)
    jacobian[3:, 2] = rotation.T @ axis
    centripetal = -arm.copy()
    centripetal[1] = 0.0
    return rotation, np.array([q[0], 0.0, q[1]]) + arm, jacobian, centripetal * dq[2] ** 2
