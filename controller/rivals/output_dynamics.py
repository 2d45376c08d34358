"""The dynamics of the outputs, which both rivals control in place of the walker's: ddy = L_f^2 h + L_g L_f h u."""

from typing import NamedTuple

import numpy as np

from controller.belief import kernels
from controller.belief.closed_loop import GaitTable, outputs
from controller.belief.kernels import Walker
from controller.common.compiled import Array, compiled
from controller.common.records import Vector


class OutputDynamics(NamedTuple):
    """Eq. (6) at one state, and the stance force that goes with it; stance order.

    Attributes:
        theta: Clock in [rad].
        dtheta: Its rate in [rad/s].
        y: Outputs in [rad], (4,).
        dy: Their rates in [rad/s], (4,).
        drift: L_f^2 h in [rad/s^2], (4,).
        decoupling: L_g L_f h in [rad/s^2/(N.m)], (4, 4).
        force: Stance force under no torque, (tangential, normal) in [N], (2,).
        force_per_torque: Its change per torque in [1/m], (2, 4).
    """

    theta: float
    dtheta: float
    y: Array
    dy: Array
    drift: Array
    decoupling: Array
    force: Array
    force_per_torque: Array

    def torque(self, v: Vector) -> Vector:
        """The torque in [N.m], (4,), that makes ddy = v in [rad/s^2], (4,); Eq. (7)."""
        return np.linalg.solve(self.decoupling, v - self.drift).astype(float)

    @property
    def is_finite(self) -> bool:
        """Whether no number has overflowed."""
        return bool(np.isfinite(self.drift).all() and np.isfinite(self.decoupling).all())


@compiled
def output_dynamics(walker: Walker, gait: GaitTable, q: Array, dq: Array) -> OutputDynamics:
    """Eq. (6) at a state.

    Args:
        walker: The walker believed in.
        gait: The outputs.
        q: Coordinates in [rad], (5,).
        dq: Rates in [rad/s], (5,).
    """
    stage = kernels.new_stage()
    kernels.place(q, dq, stage)
    theta, dtheta = outputs(gait, q, dq, stage)
    kernels.accelerate(walker, dq, np.zeros(4), stage)
    kernels.responses(stage)
    force, force_per_torque = np.empty(2), np.empty((2, 4))
    kernels.stance_force(walker, stage, force)
    kernels.stance_force_per_torque(walker, stage, force_per_torque)
    # dh/dq = [I 0] - h_d' c, as h_0(q) is the four actuated coordinates
    drift, decoupling = np.empty(4), np.empty((4, 4))
    for i in range(4):
        drift[i] = stage.ddq[i] - stage.h1[i] * np.dot(gait.clock, stage.ddq) - stage.h2[i] * dtheta * dtheta
        for j in range(4):
            per_torque = stage.BtDinv[j]
            decoupling[i, j] = per_torque[i] - stage.h1[i] * np.dot(gait.clock, per_torque)
    return OutputDynamics(theta, dtheta, stage.y, stage.dy, drift, decoupling, force, force_per_torque)
