"""What a gait must keep, and by how much an orbit keeps it: one table for the optimiser, the check and the messages."""

from dataclasses import dataclass

import numpy as np

from controller.belief import Gains, Gait, WalkerModel
from controller.common.records import (
    ACTUATED,
    NORMAL,
    STANCE_KNEE,
    SWING_KNEE,
    TANGENTIAL,
    TORSO,
    Vector,
)
from controller.design.orbit import Orbit
from controller.design.transverse import transverse_eigenvalues

KNEES = [STANCE_KNEE, SWING_KNEE]
HIGH, RATE = 1, 2  # columns of `Orbit.foot`


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirements:
    """Limits of a gait; those of the walker itself come with the model.

    Attributes:
        step_length: In [m].
        speed: Mean forward speed in [m/s].
        clearance: Height in mid-step of the bump 16 s^2 (1 - s)^2 that the swing foot stays above, in [m].
        friction: Largest |F_T / F_N| in stance and |impulse_T / impulse_N| at impact.
        normal_share: Smallest stance force as a share of the walker's weight.
        torque_share: Largest torque as a share of each joint's limit.
        knee_min: Most bent knee in [rad].
        knee_max: Straightest knee in [rad].
        torso_max: Largest lean of the torso either way in [rad].
        touch_down: Slowest vertical rate of the swing foot before the impact, downward, in [m/s].
        eigenvalue_max: Largest delta^2.
        transverse_max: Largest magnitude of the Poincare map's other eigenvalues, those of the output errors.
        kp: Gains K_P in [1/s^2] that decide them, (4,); those of the paper.
        kd: Gains K_D in [1/s], (4,).
        reserve: Smallest zeta along the step as a share of that before impact: how far from stopping.
    """

    step_length: float
    speed: float
    clearance: float = 0.02
    friction: float = 0.4
    normal_share: float = 0.3
    torque_share: float = 0.85
    knee_min: float = -1.5
    knee_max: float = -0.05
    torso_max: float = 0.6
    touch_down: float = 0.1
    eigenvalue_max: float = 0.85
    transverse_max: float = 0.5
    kp: tuple[float, ...] = (60.0, 90.0, 90.0, 50.0)
    kd: tuple[float, ...] = (10.0, 20.0, 20.0, 10.0)
    reserve: float = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Margin:
    """How far a requirement is kept; below 0 it is violated.

    Attributes:
        name: In words.
        unit: Of `scale` and of what messages print.
        scale: What counts as 1 for the optimiser, in the unit.
        values: Margins in the unit, (k,), one for each node or joint.
        legal: The limit in words.
        reserve: How much of the optimiser's reserve each value keeps, (k,) or one number for all.
    """

    name: str
    unit: str
    scale: float
    values: Vector
    legal: str
    reserve: float | Vector = 1.0

    @property
    def worst(self) -> float:
        """Smallest margin in the unit."""
        return float(self.values.min())


def margins(model: WalkerModel, gait: Gait, orbit: Orbit, need: Requirements) -> tuple[Margin, ...]:
    """All margins but the speed, always in the same order and of the same length."""
    weight = model.lumped.mass * model.lumped.gravity
    normal, tangential = orbit.force[:, NORMAL], orbit.force[:, TANGENTIAL]
    # Flat at both ends: there any step is as low as its rates make it, and only the ground itself counts.
    bump = (16.0 * (orbit.s * (1.0 - orbit.s)) ** 2)[1:-1]
    height = orbit.foot[1:-1, HIGH] - need.clearance * bump
    limit = need.torque_share * model.torque_limits
    share = need.reserve * abs(orbit.zeta[-1])
    knees = orbit.q[:, KNEES]
    torso = orbit.q[:, TORSO]
    impulse_n, impulse_t = orbit.impulse[NORMAL], orbit.impulse[TANGENTIAL]
    momentum = model.lumped.mass * 1.0  # [N.s]

    def one(value: float) -> Vector:
        return np.array([value])

    return (
        Margin(
            name="energy along the step (zeta)",
            unit="of zeta before impact",
            scale=1.0,
            values=(orbit.zeta - share) / max(abs(orbit.zeta[-1]), 1e-9),
            legal=f"{need.reserve:g} of zeta before impact or more",
        ),
        Margin(
            name="growth of the clock (I(theta) / I(theta-))",
            unit="ratio",
            scale=1.0,
            values=orbit.inertia / orbit.inertia[-1] - 0.1,
            legal="0.1 or above",
        ),
        Margin(
            name="length of the clock's path",
            unit="rad",
            scale=0.1,
            values=one(gait.table.theta_span - 0.05),
            legal="0.05 rad or more in a step",
        ),
        Margin(
            name="restricted Poincare eigenvalue delta^2",
            unit="",
            scale=0.2,
            values=one(need.eigenvalue_max - orbit.delta**2),
            legal=f"up to {need.eigenvalue_max:g}",
        ),
        Margin(
            name="largest eigenvalue of the output errors from step to step",
            unit="",
            scale=0.5,
            values=one(need.transverse_max - largest_transverse(model, gait, orbit, need)),
            legal=f"up to {need.transverse_max:g} under K_P = {list(need.kp)}, K_D = {list(need.kd)}",
        ),
        Margin(
            name="torque",
            unit="N.m",
            scale=float(limit.max()),
            values=np.concatenate([limit - orbit.u, limit + orbit.u]).ravel(),
            legal=f"up to {limit[0]:g} N.m at the hips, {limit[2]:g} N.m at the knees",
        ),
        Margin(
            name="stance foot's normal force",
            unit="N",
            scale=weight,
            values=normal - need.normal_share * weight,
            legal=f"{need.normal_share * weight:.1f} N or more",
        ),
        Margin(
            name="stance foot's friction",
            unit="N inside the cone",
            scale=weight,
            values=np.concatenate([need.friction * normal - tangential, need.friction * normal + tangential]),
            legal=f"|F_T / F_N| up to {need.friction:g}",
        ),
        Margin(
            name="swing foot's clearance",
            unit="m",
            scale=0.02,
            values=height,
            legal=f"above a bump of {need.clearance:g} m over the step",
            reserve=bump,
        ),
        Margin(
            name="knee angle",
            unit="rad",
            scale=0.5,
            values=np.concatenate([need.knee_max - knees, knees - need.knee_min]).ravel(),
            legal=f"{need.knee_min:g} to {need.knee_max:g} rad",
        ),
        Margin(
            name="torso angle",
            unit="rad",
            scale=0.5,
            values=np.concatenate([need.torso_max - torso, need.torso_max + torso]),
            legal=f"{-need.torso_max:g} to {need.torso_max:g} rad",
        ),
        Margin(
            name="swing foot's rate at touch-down",
            unit="m/s",
            scale=0.5,
            values=one(-orbit.foot[-1, RATE] - need.touch_down),
            legal=f"{need.touch_down:g} m/s downward or faster",
        ),
        Margin(
            name="impact on the landing foot",
            unit="N.s inside the cone",
            scale=momentum,
            values=np.array([impulse_n, need.friction * impulse_n - impulse_t, need.friction * impulse_n + impulse_t]),
            legal=f"|impulse_T / impulse_N| up to {need.friction:g}",
        ),
        Margin(
            name="lift-off of the old stance foot",
            unit="m/s",
            scale=0.5,
            values=one(orbit.lift_off),
            legal="0 m/s or upward",
        ),
        *_stops(model, orbit),
    )


def _stops(model: WalkerModel, orbit: Orbit) -> tuple[Margin, ...]:
    """The walker's joint stops, where it has any."""
    q = orbit.q[:, ACTUATED]
    gaps = np.concatenate([(q - model.low).ravel(), (model.high - q).ravel()])
    gaps = gaps[np.isfinite(gaps)]
    if not gaps.size:
        return ()
    hips, knees = (f"{model.low[k]:.4g} to {model.high[k]:.4g} rad" for k in (0, 2))
    legal = f"hips {hips}, knees {knees}"
    return (Margin(name="joint stops", unit="rad", scale=0.5, values=gaps, legal=legal),)


def largest_transverse(model: WalkerModel, gait: Gait, orbit: Orbit, need: Requirements) -> float:
    """Largest magnitude of the eigenvalues of the output errors under the gains asked for."""
    gains = Gains(kp=np.array(need.kp), kd=np.array(need.kd))
    return float(np.abs(transverse_eigenvalues(model, gait, orbit, gains)).max())
