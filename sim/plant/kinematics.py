"""Where hip, knees and feet of the planar walker are: closed forms over angles measured from "up".

A link at absolute angle phi points along (-sin phi, cos phi). Joint vectors are ordered as
`sim.interface.COORDINATES`; points are (x, z) in [m] relative to the hip.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.interface import LEGS, Vector
from sim.scenario.per_link import LimbFactors

TORSO = 4
HIP_OF = (0, 1)
"""Index of each leg's hip angle in a joint vector."""
KNEE_OF = (2, 3)
"""Index of each leg's knee angle."""


def absolute_angles(q: Sequence[float]) -> tuple[float, ...]:
    """Absolute angles of the links in [rad], torso, left femur and tibia, right ones; rates from rates.

    Args:
        q: Joint angles and torso angle in [rad], (5,).
    """
    left_hip, right_hip, left_knee, right_knee, torso = q
    left, right = torso + left_hip, torso + right_hip
    return torso, left, left + left_knee, right, right + right_knee


@dataclass(frozen=True, slots=True, kw_only=True)
class LegGeometry:
    """Lengths of the legs.

    Attributes:
        lengths: (hip to knee, knee to foot point) in [m] of the left, then of the right leg.
    """

    lengths: tuple[tuple[float, float], tuple[float, float]]

    @classmethod
    def of(cls, model: Any) -> "LegGeometry":
        """The lengths in a compiled MuJoCo model of the walker."""
        left, right = (
            (float(model.body(f"{leg}_tibia").pos[2]), float(model.geom(f"{leg}_foot").pos[2])) for leg in LEGS
        )
        return cls(lengths=(left, right))

    def nominal_length(self, errors: LimbFactors) -> float:
        """Length of a leg in [m] before the plant's errors in length: what the walker is said to have."""
        femur, tibia = self.lengths[0]
        return femur / errors.left_femur + tibia / errors.left_tibia

    @property
    def alike(self) -> bool:
        """Whether both legs have the same lengths."""
        left, right = self.lengths
        return left == right

    def feet(self, q: Sequence[float]) -> tuple[tuple[float, float], tuple[float, float]]:
        """Foot points (x, z) of the left and the right leg from the hip in [m], from `q` in [rad], (5,)."""
        _, a, b, c, d = absolute_angles(q)
        (femur, tibia), (other_femur, other_tibia) = self.lengths
        sin, cos = math.sin, math.cos  # written out: a generator costs as much again
        return (
            (-femur * sin(a) - tibia * sin(b), femur * cos(a) + tibia * cos(b)),
            (-other_femur * sin(c) - other_tibia * sin(d), other_femur * cos(c) + other_tibia * cos(d)),
        )

    def feet_velocity(self, q: Sequence[float], dq: Sequence[float]) -> tuple[tuple[float, float], ...]:
        """Their velocities from the hip in [m/s], from `q` in [rad] and `dq` in [rad/s], (5,) each."""
        _, *legs = absolute_angles(q)
        _, *rates = absolute_angles(dq)
        return tuple(
            (
                -femur * da * math.cos(a) - tibia * db * math.cos(b),
                -femur * da * math.sin(a) - tibia * db * math.sin(b),
            )
            for (a, b), (da, db), (femur, tibia) in zip(
                (legs[:2], legs[2:]), (rates[:2], rates[2:]), self.lengths, strict=True
            )
        )

    def foot(self, q: Vector, leg: int) -> Vector:
        """Foot point of a leg from the hip in [m], (2,)."""
        return np.array(self.feet(q.tolist())[leg])

    def foot_jacobian(self, q: Vector, leg: int) -> Vector:
        """Change of the foot point from the hip per joint angle in [m/rad], (2, 5)."""
        a = float(q[TORSO] + q[HIP_OF[leg]])
        b = a + float(q[KNEE_OF[leg]])
        femur, tibia = self.lengths[leg]
        shin = np.array([-tibia * math.cos(b), -tibia * math.sin(b)])
        whole = shin + np.array([-femur * math.cos(a), -femur * math.sin(a)])
        J = np.zeros((2, 5))
        J[:, HIP_OF[leg]] = J[:, TORSO] = whole
        J[:, KNEE_OF[leg]] = shin
        return J

    def swing_foot(self, q: Vector, stance: int) -> tuple[float, float]:
        """Swing foot from stance foot: p_2^h and p_2^v of Eq. (4) in [m]."""
        x, z = self.foot(q, 1 - stance) - self.foot(q, stance)
        return float(x), float(z)

    def swing_foot_jacobian(self, q: Vector, stance: int) -> Vector:
        """Its change per joint angle in [m/rad], (2, 5)."""
        return self.foot_jacobian(q, 1 - stance) - self.foot_jacobian(q, stance)
