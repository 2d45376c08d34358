"""Partial prediction: the closed loop under ZD+PD alone, simulated ahead through predicted impacts."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.belief.closed_loop import Loop, closed_loop, outputs
from controller.belief.ground import crosses
from controller.belief.kernels import (
    N_Q,
    N_U,
    factor_inertia,
    impact,
    new_stage,
    place,
    responses,
    stance_force,
    stance_force_per_torque,
    swing_foot,
    turn,
)
from controller.common.compiled import Array, nested
from controller.common.records import StanceState, Vector

ABSURD = 1e7  # [N] no walker presses so hard on the ground; solvers stumble over such numbers
TOUCHING = 1e-9  # [m] above the ground, from where a foot that goes down lands


@nested
def _within(a, bound):  # type: ignore[no-untyped-def]
    """Whether every magnitude is below a bound, which NaN is not."""
    for value in a:
        if not abs(value) < bound:
            return False
    return True


@nested
def within_reason(x: Array, force: Array) -> bool:
    """Whether states and forces of a prediction stayed finite and within reason; those of a fallen walker need not."""
    return _within(x[-1], np.inf) and _within(force.ravel(), ABSURD)


class Horizon(NamedTuple):
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
        clock: Clock at stage 0 in [rad] and its rate in [rad/s], (2,).
    """

    T: float
    x: Array
    u: Array
    y: Array
    dy: Array
    rate_per_torque: Array
    force: Array
    force_per_torque: Array
    exchange: NDArray[np.bool_]
    clock: Array

    @property
    def theta(self) -> float:
        """Clock at stage 0 in [rad]."""
        return float(self.clock[0])

    @property
    def dtheta(self) -> float:
        """Its rate in [rad/s]."""
        return float(self.clock[1])

    @property
    def is_finite(self) -> bool:
        """Whether the prediction stayed finite and within reason; that of a fallen walker need not."""
        return bool(within_reason(self.x, self.force))

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


def new_horizon(N: int, T: float) -> Horizon:
    """Room for N stages of T [s]."""
    e = np.empty
    return Horizon(
        T, e((N + 1, 10)), e((N, 4)), e((N + 1, 4)), e((N + 1, 4)), e((N, 4, 4)), e((N, 2)), e((N, 2, 4)),
        np.empty(N, dtype=np.bool_), e(2),
    )  # fmt: skip


def predict(loop: Loop, state: StanceState, N: int, T: float) -> Horizon:
    """Simulate the closed loop under ZD+PD from the measured state, u_tilde = 0.

    Implements: Eqs. (4), (10)-(13).

    Args:
        loop: The walker believed in, its gait and the ZD+PD gains.
        state: Measured state.
        N: Stages.
        T: Sampling time in [s].

    Returns:
        The horizon; an impact is found from the predicted state (swing foot at or below the stance foot, ahead of
        it and going down), never from time.
    """
    horizon = new_horizon(N, T)
    roll_out(loop, state.q, state.dq, horizon)
    return horizon


@nested
def roll_out(loop: Loop, q0: Array, dq0: Array, out: Horizon) -> None:
    """Fill a horizon with the closed loop under ZD+PD from a state (5,), (5,), through impacts, Eqs. (10)-(13)."""
    walker, T = loop.walker, out.T
    stage = new_stage()
    q = q0.copy()
    dq = dq0.copy()
    N = out.u.shape[0]
    place(q, dq, stage)
    _, height, rate = swing_foot(walker, stage)
    if T * rate < height <= 0.0:
        height = TOUCHING  # it reached the ground within this tick, so its contact flag is not up yet: it lands next
    for k in range(N):
        for i in range(N_Q):
            out.x[k, i] = q[i]
            out.x[k, N_Q + i] = dq[i]
        theta, dtheta = closed_loop(loop, q, dq, stage)
        if k == 0:
            out.clock[0], out.clock[1] = theta, dtheta
        factor_inertia(stage)
        responses(stage)
        stance_force(walker, stage, out.force[k])
        stance_force_per_torque(walker, stage, out.force_per_torque[k])
        for i in range(N_U):
            out.y[k, i] = stage.y[i]
            out.dy[k, i] = stage.dy[i]
            out.u[k, i] = stage.u[i]
            for j in range(N_U):
                out.rate_per_torque[k, i, j] = T * stage.BtDinv[j, i]  # velocity rows of T g_k, Eq. (12)
        for i in range(N_Q):
            q[i] += T * dq[i] + 0.5 * T * T * stage.ddq[i]  # Eq. (10)
            dq[i] += T * stage.ddq[i]
        turn(q, dq, stage)
        before = height
        ahead, height, rate = swing_foot(walker, stage)
        out.exchange[k] = crosses(ahead, before, height, rate)  # x reaches S, Eq. (4)
        if out.exchange[k]:
            impact(walker, q, dq, stage)
            _, height, _ = swing_foot(walker, stage)
    outputs(loop.gait, q, dq, stage)
    for i in range(N_Q):
        out.x[N, i] = q[i]
        out.x[N, N_Q + i] = dq[i]
    for i in range(N_U):
        out.y[N, i] = stage.y[i]
        out.dy[N, i] = stage.dy[i]
