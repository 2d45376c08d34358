"""The Poincare section: states just before an impact, in stance order, from any plant.

A section state is x = (q, dq), (10,): stance hip, swing hip, stance knee, swing knee, torso, then their rates,
the legs named as they are just before the impact. It lies on S of Eq. (4): the swing foot touches the ground.
"""

import math

import numpy as np

from sim.interface import LEGS, PlantState, Vector
from sim.loop import NoTape, Ticks
from sim.plant.kinematics import LegGeometry

_SWAPPED = np.array([1, 0, 3, 2, 4])
_NEWTON_STEPS = 8


def to_stance_order(q: Vector, dq: Vector, stance: str) -> Vector:
    """State (10,) in stance order from body order; `stance` is "left" or "right"."""
    return np.concatenate((q, dq) if stance == "left" else (q[_SWAPPED], dq[_SWAPPED]))


class Surface:
    """The switching surface S of a walker on an even, possibly inclined, ground.

    Attributes:
        legs: Lengths of the legs.
        slope: Inclination of the ground in [rad], positive uphill.
    """

    def __init__(self, legs: LegGeometry, slope: float = 0.0) -> None:
        """Args are the attributes."""
        self.legs, self.slope = legs, slope
        self._normal = np.array([-math.sin(slope), math.cos(slope)])

    def height(self, q: Vector) -> float:
        """Height of the swing foot over the ground through the stance foot in [m]; q in stance order, (5,)."""
        return float(self._normal @ self.legs.swing_foot(q, 0))

    def gradient(self, q: Vector) -> Vector:
        """Its change per angle in [m/rad], (5,)."""
        return self._normal @ self.legs.swing_foot_jacobian(q, 0)

    def project(self, x: Vector) -> Vector:
        """The nearest state on S, found along the gradient of the height."""
        x = x.copy()
        for _ in range(_NEWTON_STEPS):
            gradient = self.gradient(x[:5])
            x[:5] -= gradient * (self.height(x[:5]) / (gradient @ gradient))
        return x

    def basis(self, x: Vector) -> Vector:
        """Orthonormal directions along S at x, (10, 9): four in the angles, then the five rates."""
        gradient = self.gradient(x[:5])
        _, _, rows = np.linalg.svd(gradient[None, :])
        V = np.zeros((10, 9))
        V[:5, :4] = rows[1:].T
        V[5:, 4:] = np.eye(5)
        return V

    def reached_from(self, earlier: PlantState, later: PlantState, stance: str) -> Vector:
        """State on S that follows two ticks before an impact, by extrapolation at constant acceleration.

        Args:
            earlier: The tick before the last.
            later: The last tick without contact of the swing foot.
            stance: The foot that stood.
        """
        x0, x1 = (to_stance_order(s.q, s.dq, stance) for s in (earlier, later))
        q, dq = x1[:5], x1[5:]
        ddq = (dq - x0[5:]) / (later.t - earlier.t)
        tau = 0.0  # [s]
        for _ in range(_NEWTON_STEPS):
            there = q + tau * dq + 0.5 * tau * tau * ddq
            tau -= self.height(there) / float(self.gradient(there) @ (dq + tau * ddq))
        return np.concatenate((q + tau * dq + 0.5 * tau * tau * ddq, dq + tau * ddq))


class SectionTape(NoTape):
    """A tape that keeps the section state of every impact (`sim.loop.tape.Tape`).

    A plant that locates its impacts itself (the rigid one, by its attribute `impact`) is asked; for any other
    one the state is extrapolated from the last two ticks before contact.

    Attributes:
        states: Section states, (10,) each, in order of time. A touch-down in the very first tick leaves none.
    """

    def __init__(self, surface: Surface, plant: object, stance: str) -> None:
        """Args: surface: S; plant: whose impacts they are; stance: the foot that stands at the start."""
        self.states: list[Vector] = []
        self._surface, self._plant = surface, plant
        self._stance = stance
        self._earlier: PlantState | None = None
        self._later: PlantState | None = None

    def ticks(self, ticks: Ticks) -> None:
        """Remember the last two ticks."""
        last = [PlantState.of(row) for row in ticks.state[-2:]]
        self._earlier, self._later = last if len(last) == 2 else (self._later, last[0])

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Keep the section state when a foot has landed."""
        if name != "impact":
            return
        impact = getattr(self._plant, "impact", None)
        if impact is not None:
            self.states.append(to_stance_order(impact.q, impact.dq, impact.stance))
        elif self._earlier is not None and self._later is not None:
            self.states.append(self._surface.reached_from(self._earlier, self._later, self._stance))
        self._earlier = self._later = None
        self._stance = LEGS[1 - LEGS.index(self._stance)]
