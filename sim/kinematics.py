"""Where hip, knees and feet of the planar walker are: closed forms over angles measured from "up".

A link at absolute angle phi points along (-sin phi, cos phi). Joint vectors are ordered as
`sim.interface.COORDINATES`; points are (x, z) in [m] relative to the hip.
"""

import math
from dataclasses import dataclass

import numpy as np

from sim.interface import Vector

LEFT, RIGHT = range(2)
LEGS = ("left", "right")
TORSO = 4
HIP_OF = (0, 1)
"""Index of each leg's hip angle in a joint vector."""
KNEE_OF = (2, 3)
"""Index of each leg's knee angle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LegGeometry:
    """Lengths of a leg; both legs are alike.

    Attributes:
        femur: Hip to knee in [m].
        tibia: Knee to foot point in [m].
    """

    femur: float
    tibia: float

    def knee(self, q: Vector, leg: int) -> Vector:
        """Knee of a leg from the hip in [m], (2,)."""
        a = float(q[TORSO] + q[HIP_OF[leg]])
        return np.array([-self.femur * math.sin(a), self.femur * math.cos(a)])

    def foot(self, q: Vector, leg: int) -> Vector:
        """Foot point of a leg from the hip in [m], (2,)."""
        b = float(q[TORSO] + q[HIP_OF[leg]] + q[KNEE_OF[leg]])
        return self.knee(q, leg) + np.array([-self.tibia * math.sin(b), self.tibia * math.cos(b)])

    def foot_jacobian(self, q: Vector, leg: int) -> Vector:
        """Change of the foot point from the hip per joint angle in [m/rad], (2, 5)."""
        a = float(q[TORSO] + q[HIP_OF[leg]])
        b = a + float(q[KNEE_OF[leg]])
        shin = np.array([-self.tibia * math.cos(b), -self.tibia * math.sin(b)])
        whole = shin + np.array([-self.femur * math.cos(a), -self.femur * math.sin(a)])
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
