"""The full closed loop's Poincare map around a gait: from one state before impact to the next, Eq. (24).

The section is S, where the swing foot meets the ground. Deviations on it have nine coordinates: the four
outputs' angles less one (the feet stay on the ground) and five rates. The map is differenced in an orthonormal basis
of the section's tangent space, so that none of its eigenvalues is an artefact.
"""

from dataclasses import dataclass

import numpy as np

from controller.belief import Gains, Gait, Loop, WalkerModel, kernels
from controller.common.records import Vector
from controller.design.orbit_kernels import Step, full_step

STEP = 2.5e-4  # [s] integration: the orbit's error after a step is below 1e-11
DIFFERENCE = 1e-5  # [rad], [rad/s]
TIME_LIMIT = 2.0  # [s]
NEWTON_STEPS = 12


class NoReturn(ValueError):
    """The walker does not come back to the section."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReturnMap:
    """The linearised map at its fixed point.

    Attributes:
        x_minus: Fixed point (q, dq) in [rad], [rad/s], (10,).
        residual: Largest |P(x) - x| there in [rad], [rad/s].
        eigenvalues: Of the Jacobian, by decreasing magnitude, (9,), complex.
        step_time: In [s].
        peak_torque: Largest torque asked for in the step in [N.m], (4,), stance order.
        friction: Largest |F_T / F_N| in the step.
    """

    x_minus: Vector
    residual: float
    eigenvalues: np.ndarray
    step_time: float
    peak_torque: Vector
    friction: float

    @property
    def largest(self) -> float:
        """Magnitude of the largest eigenvalue."""
        return float(abs(self.eigenvalues[0]))


def step(
    model: WalkerModel, gait: Gait, gains: Gains, x_minus: Vector, *, hold: float = 0.0, substeps: int = 4
) -> Step:
    """One step of the full closed loop under ZD+PD; see `orbit_kernels.full_step`.

    Args:
        model: The walker.
        gait: Its outputs.
        gains: ZD+PD gains.
        x_minus: State before impact, (10,).
        hold: Time a torque is held in [s], counted from the impact, saturated at the walker's limits; 0 for
            continuous time without saturation.
        substeps: Integration steps in a hold; one is enough for 1e-6.

    Raises:
        NoReturn: no impact within `TIME_LIMIT`.
    """
    substeps = substeps if hold else 0
    h = hold / substeps if hold else STEP
    loop = Loop(model.lumped, gait.table, gains)
    taken: Step = full_step(loop, model.torque_limits, x_minus, h, substeps, TIME_LIMIT)
    if not np.isfinite(taken.x).all():
        raise NoReturn(f"no impact within {TIME_LIMIT:g} s")
    return taken


def tangent(model: WalkerModel, q: Vector) -> Vector:
    """Orthonormal basis of the section's tangent space at a posture, (10, 9)."""
    stage = kernels.new_stage()
    gradient = np.zeros(10)
    for i in range(5):
        rate = np.zeros(5)
        rate[i] = 1.0
        kernels.place(q, rate, stage)
        gradient[i] = kernels.swing_foot(model.lumped, stage)[2]
    return np.linalg.svd(gradient[None, :])[2][1:].T


def return_map(
    model: WalkerModel,
    gait: Gait,
    gains: Gains,
    *,
    hold: float = 0.0,
    substeps: int = 4,
) -> ReturnMap:
    """Fixed point of the closed loop near a gait, and the eigenvalues there.

    Implements: Eq. (24).

    Args:
        model: The walker.
        gait: Its outputs.
        gains: ZD+PD gains.
        hold: As in `step`; a held torque moves the fixed point, so it is found by Newton's method.
        substeps: As in `step`.

    Raises:
        NoReturn: the walker does not come back.
    """
    x = np.r_[gait.q_minus, gait.dq_minus]
    for _ in range(NEWTON_STEPS):
        basis = tangent(model, x[:5])
        now = step(model, gait, gains, x, hold=hold, substeps=substeps)
        miss = basis.T @ (now.x - x)
        jacobian = np.empty((9, 9))
        for i in range(9):
            ahead = step(model, gait, gains, x + DIFFERENCE * basis[:, i], hold=hold, substeps=substeps)
            behind = step(model, gait, gains, x - DIFFERENCE * basis[:, i], hold=hold, substeps=substeps)
            jacobian[:, i] = basis.T @ (ahead.x - behind.x) / (2.0 * DIFFERENCE)
        residual = float(np.abs(now.x - x).max())
        if hold == 0.0 or residual < 1e-9:
            break
        x = x + basis @ np.linalg.solve(np.eye(9) - jacobian, miss)
        x = _on_section(model, x)
    values = np.linalg.eigvals(jacobian)
    return ReturnMap(
        x_minus=x,
        residual=residual,
        eigenvalues=values[np.argsort(-np.abs(values), kind="stable")],
        step_time=now.time,
        peak_torque=now.peak,
        friction=now.friction,
    )


def _on_section(model: WalkerModel, x: Vector) -> Vector:
    """The state moved along the gradient of the swing foot's height until that is zero."""
    for _ in range(5):
        height = model.swing_foot(x[:5], x[5:])[1]
        normal = np.zeros(5)
        for i in range(5):
            rate = np.zeros(5)
            rate[i] = 1.0
            normal[i] = model.swing_foot(x[:5], rate)[2]
        x = np.r_[x[:5] - height * normal / (normal @ normal), x[5:]]
    return x
