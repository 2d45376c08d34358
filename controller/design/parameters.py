"""Gaits by free numbers: whatever they are, the outputs are hybrid invariant and the feet stand on level ground.

The posture before impact comes from two knees, the torso and the step length; it is the last column of alpha, and its
mirror image the first. The last but one column is the slope before impact; the impact map turns it into the slope
after, which is the second column (book, Section 6.2). Everything between is free. So is nothing else: the
velocity on the orbit follows from the zero dynamics (`orbit.py`), which closes it.
"""

from dataclasses import dataclass

import numpy as np

from controller.belief import Gait, WalkerModel, kernels
from controller.common.records import (
    STANCE_HIP,
    STANCE_KNEE,
    SWING_HIP,
    SWING_KNEE,
    TORSO,
    Vector,
    swap_legs,
)
from controller.design import orbit_kernels
from controller.design.orbit import Orbit, periodic_orbit

CLOCK = np.array([-1.0, 0.0, -0.5, 0.0, -1.0])
"""c of theta = c q: minus the angle of the virtual leg, exactly so for thigh and shin of equal length."""

LOWEST = 4
"""Degree of the polynomials, whose two coefficients at each end are not free."""

SPAN_FLOOR = 1e-3  # [rad] a clock that does not grow gives no gait; keeps the arithmetic finite


class NoPosture(ValueError):
    """The feet cannot stand a step length apart with these knees."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parametrisation:
    """Which numbers are free, and how they become a gait.

    The vector p is (stance knee, swing knee, torso before impact [rad]; slopes dq_a/ds before impact [rad], 4;
    alpha_2 .. alpha_M-2 [rad] by columns, each as its distance from the straight line between the ends; the step
    length [m] if it is not given).

    Attributes:
        model: The walker.
        degree: M of the Bezier polynomials, `LOWEST` or above.
        step_length: In [m]; None makes it the last free number.
    """

    model: WalkerModel
    degree: int
    step_length: float | None

    @property
    def size(self) -> int:
        """How many numbers are free."""
        return 7 + 4 * (self.degree - 3) + (self.step_length is None)

    def gait(self, p: Vector, name: str = "", source: str = "") -> Gait:
        """The gait of a vector, its rates before impact left at zero.

        Raises:
            NoPosture: no legs of these lengths stand so.
        """
        M = self.degree
        length = float(p[-1]) if self.step_length is None else self.step_length
        q_minus = posture(self.model, p[0], p[1], p[2], length)
        first, last = swap_legs(q_minus)[:4], q_minus[:4]
        alpha = np.empty((4, M + 1))
        alpha[:, 0], alpha[:, M] = first, last
        alpha[:, M - 1] = last - p[3:7] / M
        span = max(float(CLOCK @ q_minus - CLOCK @ swap_legs(q_minus)), SPAN_FLOOR)
        slope = np.empty(5)
        slope[:4] = p[3:7] / span
        slope[TORSO] = (1.0 - CLOCK[:4] @ slope[:4]) / CLOCK[TORSO]
        _, slope_plus, _, _ = orbit_kernels.strike(self.model.lumped, q_minus, slope, kernels.new_stage())
        alpha[:, 1] = first + span / M * slope_plus[:4] / _away_from_zero(float(CLOCK @ slope_plus))
        for column in range(2, M - 1):
            at = 7 + 4 * (column - 2)
            alpha[:, column] = first + (last - first) * column / M + p[at : at + 4]
        return Gait.of(name=name, source=source, alpha=alpha, clock=CLOCK, q_minus=q_minus, dq_minus=np.zeros(5))

    def vector(self, gait: Gait) -> Vector:
        """The vector nearest to a gait of any degree and step length: what warm starts and polishing begin with."""
        M, q, alpha = self.degree, gait.q_minus, elevate(gait.alpha, self.degree)
        p = np.zeros(self.size)
        p[:3] = q[STANCE_KNEE], q[SWING_KNEE], q[TORSO]
        p[3:7] = M * (alpha[:, M] - alpha[:, M - 1])
        for column in range(2, M - 1):
            at = 7 + 4 * (column - 2)
            p[at : at + 4] = alpha[:, column] - (alpha[:, 0] + (alpha[:, M] - alpha[:, 0]) * column / M)
        if self.step_length is None:
            p[-1] = self.model.swing_foot(q, np.zeros(5))[0]
        return p


def with_rates(gait: Gait, orbit: Orbit) -> Gait:
    """The same gait with the rates before impact of its periodic orbit."""
    return Gait.of(
        name=gait.name,
        source=gait.source,
        alpha=gait.alpha,
        clock=gait.clock,
        q_minus=gait.q_minus,
        dq_minus=orbit.dq[-1].copy(),
    )


def closed(model: WalkerModel, gait: Gait) -> Gait:
    """The gait with the rates of its periodic orbit."""
    return with_rates(gait, periodic_orbit(model, gait))


def posture(model: WalkerModel, stance_knee: float, swing_knee: float, torso: float, length: float) -> Vector:
    """Both feet on level ground, the swing foot ahead.

    Args:
        model: The walker.
        stance_knee: In [rad].
        swing_knee: In [rad].
        torso: Absolute, in [rad].
        length: Distance between the feet in [m].

    Returns:
        q in [rad], (5,), hips near pi.

    Raises:
        NoPosture: legs so bent differ in length by more than the step, or are too short for it.
    """
    stance, stance_lean = _leg(model, stance_knee)
    swing, swing_lean = _leg(model, swing_knee)
    # Hip above the line between the feet, at distance `along` from the stance foot.
    along = (stance**2 - swing**2 + length**2) / (2.0 * length)
    height = stance**2 - along**2
    if not height > 0.0:
        raise NoPosture(f"legs of {stance:.3f} and {swing:.3f} m cannot stand {length:.3f} m apart")
    height = np.sqrt(height)
    q = np.empty(5)
    # From hip to foot: (x, z) = r (-sin phi, cos phi); the virtual leg's angle less its lean is the femur's.
    q[STANCE_HIP] = np.arctan2(along, -height) % (2.0 * np.pi) - stance_lean - torso
    q[SWING_HIP] = np.arctan2(along - length, -height) % (2.0 * np.pi) - swing_lean - torso
    q[STANCE_KNEE], q[SWING_KNEE], q[TORSO] = stance_knee, swing_knee, torso
    return q


def _leg(model: WalkerModel, knee: float) -> tuple[float, float]:
    """Length of the virtual leg in [m], and its angle from the femur in [rad]."""
    x = model.tibia.length * np.sin(knee)
    z = model.femur.length + model.tibia.length * np.cos(knee)
    return float(np.hypot(x, z)), float(np.arctan2(x, z))


def elevate(alpha: Vector, degree: int) -> Vector:
    """The same polynomials in Bezier form of another degree: exact upward, a least-squares fit downward."""
    while alpha.shape[1] - 1 < degree:
        M = alpha.shape[1]
        k = np.arange(1, M) / M
        inner = k * alpha[:, :-1] + (1.0 - k) * alpha[:, 1:]
        alpha = np.hstack([alpha[:, :1], inner, alpha[:, -1:]])
    if alpha.shape[1] - 1 > degree:
        up = elevate(np.eye(degree + 1), alpha.shape[1] - 1)
        alpha = np.asarray(np.linalg.lstsq(up.T, alpha.T, rcond=None)[0].T, dtype=np.float64)
    return alpha


def _away_from_zero(value: float) -> float:
    return value if abs(value) > 1e-6 else 1e-6
