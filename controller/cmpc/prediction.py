"""Partial prediction: the closed loop under ZD+PD alone, simulated ahead through predicted impacts."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.belief import Gait, WalkerModel, kernels
from controller.compiled import compiled
from controller.records import StanceState, Vector

ABSURD = 1e7  # [N] no walker presses so hard on the ground; solvers stumble over such numbers


@compiled
def _within(a, bound):  # type: ignore[no-untyped-def]
    """Whether every magnitude is below a bound, which NaN is not."""
    for value in a:
        if not abs(value) < bound:
            return False
    return True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Horizon:
    """What the closed loop does over N stages if the MPC stays silent, each stage in its own stance order.

    Attributes:
        T: Sampling time in [s].
        x: States (q, dq) in [rad], [rad/s], (N + 1, 10).
        u: ZD+PD torque in [N.m], (N, 4), not saturated.
        y: Outputs in [rad], (N + 1, 4): the position rows of e_k in Eq. (14).
        dy: Output rates in [rad/s], (N + 1, 4): its velocity rows.
        rate_per_torque: Velocity rows of T g_k for the controlled coordinates, T (D^-1 B)_k, in
            [rad/s/(N.m)], (N, 4, 4). By Eq. (12) the position rows are T/2 times these.
        force: Stance contact force F_f of Eq. (20), (tangential, normal) in [N], (N, 2).
        force_per_torque: -S_MPC of Eq. (20) in [1/m], (N, 2, 4).
        exchange: Whether the legs are exchanged by an impact after stage k, (N,).
        theta: Clock at stage 0 in [rad].
        dtheta: Its rate in [rad/s].
    """

    T: float
    x: Vector
    u: Vector
    y: Vector
    dy: Vector
    rate_per_torque: Vector
    force: Vector
    force_per_torque: Vector
    exchange: NDArray[np.bool_]
    theta: float
    dtheta: float

    @property
    def is_finite(self) -> bool:
        """Whether the prediction stayed finite and within reason; that of a fallen walker need not."""
        return bool(_within(self.x[-1], np.inf) and _within(self.force.ravel(), ABSURD))

    def outputs_under(self, u: Vector) -> Vector:
        """Outputs y_k + T/2 w_k under MPC torques, Eq. (15), in [rad], (N + 1, 4).

        Args:
            u: MPC torques in [N.m], (N, 4), stance order of each stage.
        """
        w = np.cumsum(np.einsum("kij,kj->ki", self.rate_per_torque, u), axis=0)
        return self.y + 0.5 * self.T * np.vstack((np.zeros(4), w))

    def forces_under(self, u: Vector) -> Vector:
        """Stance contact forces under MPC torques, Eq. (20), (tangential, normal) in [N], (N, 2).

        Args:
            u: MPC torques in [N.m], (N, 4), stance order of each stage.
        """
        return self.force + np.einsum("kij,kj->ki", self.force_per_torque, u)

    @property
    def impact_in(self) -> int:
        """Stages to the first predicted impact, -1 if there is none."""
        first = int(self.exchange.argmax())
        return first + 1 if self.exchange[first] else -1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CorrectedHorizon:
    """A horizon and the MPC's torques over it; worked out only when somebody looks.

    Attributes:
        horizon: Partial prediction.
        u_mpc: MPC torques in [N.m], (N, 4), stance order of each stage.
    """

    horizon: Horizon
    u_mpc: Vector

    def outputs(self) -> Vector:
        """Predicted outputs in [rad], (N + 1, 4), stance order."""
        return self.horizon.outputs_under(self.u_mpc)

    def contact_forces(self) -> Vector:
        """Predicted stance contact forces, (tangential, normal) in [N], (N, 2)."""
        return self.horizon.forces_under(self.u_mpc)


def predict(model: WalkerModel, gait: Gait, gains: kernels.Gains, state: StanceState, N: int, T: float) -> Horizon:
    """Simulate the closed loop under ZD+PD from the measured state, u_tilde = 0.

    Implements: Eqs. (4), (10)-(13).

    Args:
        model: The walker believed in.
        gait: The outputs.
        gains: ZD+PD gains.
        state: Measured state.
        N: Stages.
        T: Sampling time in [s].

    Returns:
        The horizon; an impact is found from the predicted state (swing foot at or below the stance foot, ahead of
        it and going down), never from time.
    """
    arrays = kernels.Rollout(
        x=np.empty((N + 1, 10)),
        u=np.empty((N, 4)),
        y=np.empty((N + 1, 4)),
        dy=np.empty((N + 1, 4)),
        rate_per_torque=np.empty((N, 4, 4)),
        force=np.empty((N, 2)),
        force_per_torque=np.empty((N, 2, 4)),
        exchange=np.empty(N, dtype=np.bool_),
    )
    theta, dtheta = kernels.rollout(model.lumped, gait.table, gains, T, state.q, state.dq, arrays)
    return Horizon(T=T, theta=theta, dtheta=dtheta, **arrays._asdict())
