"""The closed loop ahead, stage by stage, linearised along itself through predicted impacts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller import kernels
from controller.kernels import Array, Gains, GaitTable, Walker, compiled
from controller.ltv.linearisation import (
    DTHETA,
    DY,
    N_Z,
    THETA,
    Derivatives,
    Y,
    derive,
    from_output,
    impact_jacobian,
    new_derivatives,
    to_output,
)


class LtvHorizon(NamedTuple):
    """N stages of the closed loop under ZD+PD, each in the stance order of its own beginning.

    Attributes:
        z: Output state at the beginning of each stage and at the end, (N + 1, 10).
        A: Over each stage, (N, 10, 10).
        B: Of an MPC torque held over the stage, (N, 10, 4).
        u: ZD+PD torque at the beginning in [N.m], (N, 4).
        u_z: Its derivative, (N, 4, 10).
        force: Stance force under it in [N], (N, 2).
        force_z: Its derivative, (N, 2, 10).
        force_u: Change per torque in [1/m], (N, 2, 4).
        exchange: Whether an impact happens in the stage, (N,).
    """

    z: Array
    A: Array
    B: Array
    u: Array
    u_z: Array
    force: Array
    force_z: Array
    force_u: Array
    exchange: NDArray[np.bool_]


def new_horizon(N: int) -> LtvHorizon:
    """Room for N stages."""
    e = np.empty
    return LtvHorizon(
        e((N + 1, 10)), e((N, 10, 10)), e((N, 10, 4)), e((N, 4)), e((N, 4, 10)), e((N, 2)), e((N, 2, 10)),
        e((N, 2, 4)), np.empty(N, dtype=np.bool_),
    )  # fmt: skip


@compiled
def advance(gains: Gains, d: Derivatives, ddtheta: float, h: float, z: Array, A: Array, B: Array) -> None:
    """One step of length h in place: second-order in z, its linearisation into A and B from the left."""
    half = 0.5 * h * h
    column = np.empty(N_Z)
    for m in range(N_Z + 4):
        clock = 0.0
        for i in range(N_Z):
            column[i] = A[i, m] if m < N_Z else B[i, m - N_Z]
            clock += d.clock[i] * column[i]
        if m >= N_Z:
            clock += d.clock_u[m - N_Z]
        for i in range(4):
            ddy = -gains.kp[i] * column[Y + i] - gains.kd[i] * column[DY + i]
            if m >= N_Z:
                ddy += d.output_u[i, m - N_Z]
            y, dy = column[Y + i] + h * column[DY + i] + half * ddy, column[DY + i] + h * ddy
            if m < N_Z:
                A[Y + i, m], A[DY + i, m] = y, dy
            else:
                B[Y + i, m - N_Z], B[DY + i, m - N_Z] = y, dy
        theta, dtheta = column[THETA] + h * column[DTHETA] + half * clock, column[DTHETA] + h * clock
        if m < N_Z:
            A[THETA, m], A[DTHETA, m] = theta, dtheta
        else:
            B[THETA, m - N_Z], B[DTHETA, m - N_Z] = theta, dtheta
    for i in range(4):
        ddy = -gains.kp[i] * z[Y + i] - gains.kd[i] * z[DY + i]
        z[Y + i] += h * z[DY + i] + half * ddy
        z[DY + i] += h * ddy
    z[THETA] += h * z[DTHETA] + half * ddtheta
    z[DTHETA] += h * ddtheta


@compiled
def rates(gains: Gains, z: Array, ddtheta: float, f: Array) -> None:
    """dz/dt of the closed loop, (10,)."""
    for i in range(4):
        f[Y + i] = z[DY + i]
        f[DY + i] = -gains.kp[i] * z[Y + i] - gains.kd[i] * z[DY + i]
    f[THETA] = z[DTHETA]
    f[DTHETA] = ddtheta


@compiled
def land(
    walker: Walker, gait: GaitTable, gains: Gains, z: Array, A: Array, B: Array, q: Array, dq: Array,
    stage: kernels.Stage,
) -> None:  # fmt: skip
    """The impact at z, in place, and its saltation matrix into A and B from the left."""
    before, after = np.empty(N_Z), np.empty(N_Z)
    jacobian = np.empty((N_Z, N_Z))
    height_z = np.zeros(N_Z)
    from_output(gait, z, q, dq)
    kernels.place(q, dq, stage)
    kernels.closed_loop(walker, gait, gains, q, dq, stage)
    ddtheta = 0.0
    for i in range(5):
        ddtheta += gait.clock[i] * stage.ddq[i]
    rates(gains, z, ddtheta, before)
    inverse = 1.0 / gait.clock[4]
    _, _, descent = kernels.swing_foot(walker, stage)
    by_q = np.zeros(5)  # of the swing foot's height
    slope = np.empty(5)
    for i in range(5):
        slope[i] = -walker.reach[i] * stage.sin[i]
    by_q[0] = slope[0] + slope[2]
    by_q[1] = slope[1] + slope[3]
    by_q[2] = slope[2]
    by_q[3] = slope[3]
    by_q[4] = slope[0] + slope[1] + slope[2] + slope[3] + slope[4]
    height_z[THETA] = by_q[4] * inverse
    for k in range(4):
        height_z[Y + k] = by_q[k] - by_q[4] * gait.clock[k] * inverse
        height_z[THETA] += height_z[Y + k] * stage.h1[k]
    impact_jacobian(walker, gait, q, dq, stage, jacobian)
    to_output(gait, q, dq, stage, z)
    kernels.place(q, dq, stage)
    kernels.closed_loop(walker, gait, gains, q, dq, stage)
    ddtheta = 0.0
    for i in range(5):
        ddtheta += gait.clock[i] * stage.ddq[i]
    rates(gains, z, ddtheta, after)
    for i in range(N_Z):
        jump = after[i]
        for m in range(N_Z):
            jump -= jacobian[i, m] * before[m]
        for m in range(N_Z):
            before[m] = before[m]
        after[i] = jump / descent
    for i in range(N_Z):
        for m in range(N_Z):
            jacobian[i, m] += after[i] * height_z[m]
    left = jacobian @ A
    A[:] = left
    right = jacobian @ B
    B[:] = right


@compiled
def look_ahead(
    walker: Walker, gait: GaitTable, gains: Gains, h: float, substeps: NDArray[np.int64], q0: Array, dq0: Array,
    out: LtvHorizon,
) -> None:  # fmt: skip
    """Fill the horizon.

    Args:
        walker: Lumped constants.
        gait: Outputs.
        gains: ZD+PD gains.
        h: Length of a substep in [s].
        substeps: Of each stage, (N,).
        q0: Measured coordinates in [rad], (5,).
        dq0: Measured rates in [rad/s], (5,).
        out: Filled.
    """
    stage = kernels.new_stage()
    d = new_derivatives()
    q, dq = q0.copy(), dq0.copy()
    z, kept = np.empty(N_Z), np.empty(N_Z)
    kernels.place(q, dq, stage)
    to_output(gait, q, dq, stage, z)
    _, height, _ = kernels.swing_foot(walker, stage)
    N = substeps.shape[0]
    A_kept, B_kept = np.empty((N_Z, N_Z)), np.empty((N_Z, 4))
    for k in range(N):
        A, B = out.A[k], out.B[k]
        A[:] = 0.0
        B[:] = 0.0
        for i in range(N_Z):
            A[i, i] = 1.0
            out.z[k, i] = z[i]
        out.exchange[k] = False
        for sub in range(substeps[k]):
            from_output(gait, z, q, dq)
            kernels.place(q, dq, stage)
            theta, dtheta = kernels.closed_loop(walker, gait, gains, q, dq, stage)
            if sub == 0:
                out.u[k] = stage.u
                kernels.stance_force(walker, stage, out.force[k])
            ddtheta = derive(walker, gait, gains, theta, dtheta, stage, d)
            if sub == 0:
                out.u_z[k] = d.torque
                out.force_z[k] = d.force
                out.force_u[k] = d.force_u
            kept[:] = z
            A_kept[:] = A
            B_kept[:] = B
            advance(gains, d, ddtheta, h, z, A, B)
            from_output(gait, z, q, dq)
            kernels.place(q, dq, stage)
            ahead, lower, descent = kernels.swing_foot(walker, stage)
            if ahead > 0.0 and lower <= 0.0 and descent < 0.0 and not out.exchange[k]:
                out.exchange[k] = True
                share = min(max(height / (height - lower), 0.0), 1.0) if height > 0.0 else 0.0
                z[:] = kept
                A[:] = A_kept
                B[:] = B_kept
                advance(gains, d, ddtheta, share * h, z, A, B)
                land(walker, gait, gains, z, A, B, q, dq, stage)
                theta, dtheta = kernels.closed_loop(walker, gait, gains, q, dq, stage)
                ddtheta = derive(walker, gait, gains, theta, dtheta, stage, d)
                advance(gains, d, ddtheta, (1.0 - share) * h, z, A, B)
                from_output(gait, z, q, dq)
                kernels.place(q, dq, stage)
                _, lower, _ = kernels.swing_foot(walker, stage)
            height = lower
    for i in range(N_Z):
        out.z[N, i] = z[i]
