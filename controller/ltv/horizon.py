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

COLUMNS = N_Z + 4  # derivatives by z and by a torque held over the stage


class LtvHorizon(NamedTuple):
    """N stages under ZD+PD and a plan of MPC torques, each in the stance order of its own beginning.

    Attributes:
        z: Output state at the beginning of each stage and at the end, (N + 1, 10).
        AB: Derivative of the stage's end by its beginning and by its MPC torque, (N, 10, 14).
        u: ZD+PD torque at the beginning in [N.m], (N, 4).
        u_z: Its derivative, (N, 4, 10).
        force: Stance force under it and the plan in [N], (N, 2).
        force_z: Its derivative, (N, 2, 10).
        force_u: Change per torque in [1/m], (N, 2, 4).
        exchange: Whether an impact happens in the stage, (N,).
    """

    z: Array
    AB: Array
    u: Array
    u_z: Array
    force: Array
    force_z: Array
    force_u: Array
    exchange: NDArray[np.bool_]


class Ground(NamedTuple):
    """The ground believed in: a line through height `level` at the stance foot.

    Attributes:
        tangent: Of its slope, uphill positive.
        level: In [m].
    """

    tangent: float
    level: float


def new_horizon(N: int) -> LtvHorizon:
    """Room for N stages."""
    e = np.empty
    return LtvHorizon(
        e((N + 1, 10)), e((N, 10, COLUMNS)), e((N, 4)), e((N, 4, 10)), e((N, 2)), e((N, 2, 10)),
        e((N, 2, 4)), np.empty(N, dtype=np.bool_),
    )  # fmt: skip


@compiled
def accelerate(gait: GaitTable, gains: Gains, dtheta: float, u_mpc: Array, stage: kernels.Stage, f: Array) -> None:
    """dz/dt of the closed loop under a held u_mpc, (10,), after `kernels.closed_loop`; factorises the inertia."""
    kernels.factor_inertia(stage)
    x, ddq = np.empty(5), np.empty(5)
    x[0] = u_mpc[0] - u_mpc[2]
    x[1] = u_mpc[1] - u_mpc[3]
    x[2] = u_mpc[2]
    x[3] = u_mpc[3]
    x[4] = -u_mpc[0] - u_mpc[1]
    kernels.cholesky5_solve(stage.L, x)
    kernels.from_links(x, ddq)
    by_zd, by_mpc = 0.0, 0.0
    for i in range(5):
        by_zd += gait.clock[i] * stage.ddq[i]
        by_mpc += gait.clock[i] * ddq[i]
    for i in range(4):
        f[Y + i] = stage.dy[i]
        f[DY + i] = -gains.kp[i] * stage.y[i] - gains.kd[i] * stage.dy[i] + ddq[i] - stage.h1[i] * by_mpc
    f[THETA] = dtheta
    f[DTHETA] = by_zd + by_mpc


@compiled
def advance(f: Array, h: float, z: Array) -> None:
    """One step of length h in place, second-order in the positions, as Eq. (10)."""
    for i in range(4):
        z[Y + i] += h * z[DY + i] + 0.5 * h * h * f[DY + i]
        z[DY + i] += h * f[DY + i]
    z[THETA] += h * z[DTHETA] + 0.5 * h * h * f[DTHETA]
    z[DTHETA] += h * f[DTHETA]


@compiled
def advance_tangent(gains: Gains, d: Derivatives, h: float, AB: Array) -> None:
    """The derivative of `advance` applied to AB (10, 14) from the left; rows are contiguous, for the vector units."""
    half = 0.5 * h * h
    dd = np.empty((5, COLUMNS))
    for i in range(4):
        kp, kd = gains.kp[i], gains.kd[i]
        for m in range(COLUMNS):
            dd[i, m] = -kp * AB[Y + i, m] - kd * AB[DY + i, m] + d.output_z[i, 4] * AB[THETA, m]
        for k in range(4):
            v = d.output_z[i, k]
            for m in range(COLUMNS):
                dd[i, m] += v * AB[Y + k, m]
        for k in range(4):
            dd[i, N_Z + k] += d.output_u[i, k]
    for m in range(COLUMNS):
        dd[4, m] = 0.0
    for k in range(N_Z):
        v = d.clock[k]
        for m in range(COLUMNS):
            dd[4, m] += v * AB[k, m]
    for k in range(4):
        dd[4, N_Z + k] += d.clock_u[k]
    for i in range(4):
        for m in range(COLUMNS):
            AB[Y + i, m] += h * AB[DY + i, m] + half * dd[i, m]
            AB[DY + i, m] += h * dd[i, m]
    for m in range(COLUMNS):
        AB[THETA, m] += h * AB[DTHETA, m] + half * dd[4, m]
        AB[DTHETA, m] += h * dd[4, m]


@compiled
def clearance(walker: Walker, ground: Ground, stage: kernels.Stage) -> tuple[bool, float, float]:
    """Whether the swing foot is ahead, its height above the ground in [m] and the rate of that in [m/s]."""
    ahead, height, rate = kernels.swing_foot(walker, stage)
    for i in range(5):
        rate += ground.tangent * walker.reach[i] * stage.cos[i] * stage.dphi[i]
    return ahead > 0.0, height - ground.tangent * ahead - ground.level, rate


@compiled
def clearance_gradient(walker: Walker, gait: GaitTable, ground: Ground, stage: kernels.Stage, by_z: Array) -> None:
    """Derivative of the height above the ground by z, (10,)."""
    link, by_q = np.empty(5), np.empty(5)
    inverse = 1.0 / gait.clock[4]
    for i in range(5):
        link[i] = -walker.reach[i] * (stage.sin[i] - ground.tangent * stage.cos[i])
    by_q[0] = link[0] + link[2]
    by_q[1] = link[1] + link[3]
    by_q[2] = link[2]
    by_q[3] = link[3]
    by_q[4] = link[0] + link[1] + link[2] + link[3] + link[4]
    by_z[:] = 0.0
    by_z[THETA] = by_q[4] * inverse
    for k in range(4):
        by_z[Y + k] = by_q[k] - by_q[4] * gait.clock[k] * inverse
        by_z[THETA] += by_z[Y + k] * stage.h1[k]


@compiled
def land(
    walker: Walker, gait: GaitTable, gains: Gains, ground: Ground, u_mpc: Array, z: Array, AB: Array, q: Array,
    dq: Array, stage: kernels.Stage, linearise: bool,
) -> None:  # fmt: skip
    """The impact at z, in place, and its saltation matrix into AB from the left."""
    from_output(gait, z, q, dq)
    kernels.place(q, dq, stage)
    if not linearise:
        kernels.impact(walker, q, dq, stage)
        to_output(gait, q, dq, stage, z)
        return
    before, after, height_z = np.empty(N_Z), np.empty(N_Z), np.empty(N_Z)
    jacobian = np.empty((N_Z, N_Z))
    _, dtheta = kernels.closed_loop(walker, gait, gains, q, dq, stage)
    accelerate(gait, gains, dtheta, u_mpc, stage, before)
    _, _, descent = clearance(walker, ground, stage)
    clearance_gradient(walker, gait, ground, stage, height_z)
    impact_jacobian(walker, gait, q, dq, stage, jacobian)
    to_output(gait, q, dq, stage, z)
    _, dtheta = kernels.closed_loop(walker, gait, gains, q, dq, stage)
    accelerate(gait, gains, dtheta, u_mpc, stage, after)
    for i in range(N_Z):
        jump = after[i]
        for m in range(N_Z):
            jump -= jacobian[i, m] * before[m]
        after[i] = jump / descent
    for i in range(N_Z):
        for m in range(N_Z):
            jacobian[i, m] += after[i] * height_z[m]
    old = AB.copy()
    for i in range(N_Z):
        for m in range(COLUMNS):
            AB[i, m] = 0.0
        for k in range(N_Z):
            v = jacobian[i, k]
            for m in range(COLUMNS):
                AB[i, m] += v * old[k, m]


@compiled
def look_ahead(
    walker: Walker, gait: GaitTable, gains: Gains, limit: Array, ground: Ground, h: float, substeps: int, q0: Array,
    dq0: Array, plan: Array, linearise: bool, out: LtvHorizon,
) -> None:  # fmt: skip
    """Fill the horizon, and make the plan possible: ZD+PD and plan together stay within the torque limits.

    Args:
        walker: Lumped constants.
        gait: Outputs.
        gains: ZD+PD gains.
        limit: Torque limits in [N.m], (4,).
        ground: Where the swing foot lands.
        h: Length of a substep in [s].
        substeps: Of each stage.
        q0: Measured coordinates in [rad], (5,).
        dq0: Measured rates in [rad/s], (5,).
        plan: MPC torque of each stage in [N.m], (N, 4); clipped so that the total at a stage's beginning is legal.
        linearise: Whether to fill the derivatives too.
        out: Filled.
    """
    stage = kernels.new_stage()
    d = new_derivatives()
    q, dq = q0.copy(), dq0.copy()
    u_mpc = np.empty(4)
    z, kept, f = np.empty(N_Z), np.empty(N_Z), np.empty(N_Z)
    AB, AB_kept = np.zeros((N_Z, COLUMNS)), np.empty((N_Z, COLUMNS))
    kernels.place(q, dq, stage)
    to_output(gait, q, dq, stage, z)
    _, height, _ = clearance(walker, ground, stage)
    N = plan.shape[0]
    for k in range(N):
        if linearise:
            AB[:] = 0.0
            for i in range(N_Z):
                AB[i, i] = 1.0
        out.z[k] = z
        out.exchange[k] = False
        for sub in range(substeps):
            theta, dtheta = kernels.closed_loop(walker, gait, gains, q, dq, stage)
            for i in range(4):
                u_mpc[i] = min(max(plan[k, i], -limit[i] - stage.u[i]), limit[i] - stage.u[i])
            if sub == 0:
                plan[k] = u_mpc
            accelerate(gait, gains, dtheta, u_mpc, stage, f)
            if sub == 0:
                out.u[k] = stage.u
                kernels.stance_force(walker, stage, out.force[k])
                if not linearise:
                    kernels.responses(stage)
                    kernels.stance_force_per_torque(walker, stage, out.force_u[k])
            if linearise:
                derive(walker, gait, gains, theta, dtheta, u_mpc, stage, d)
                if sub == 0:
                    out.u_z[k] = d.torque
                    out.force_z[k] = d.force
                    out.force_u[k] = d.force_u
                AB_kept[:] = AB
                advance_tangent(gains, d, h, AB)
            if sub == 0:
                for i in range(2):
                    for m in range(4):
                        out.force[k, i] += out.force_u[k, i, m] * u_mpc[m]
            kept[:] = z
            advance(f, h, z)
            from_output(gait, z, q, dq)
            kernels.place(q, dq, stage)
            ahead, lower, descent = clearance(walker, ground, stage)
            if ahead and lower <= 0.0 and descent < 0.0 and not out.exchange[k]:
                out.exchange[k] = True
                share = min(max(height / (height - lower), 0.0), 1.0) if height > 0.0 else 0.0
                z[:] = kept
                advance(f, share * h, z)
                if linearise:
                    AB[:] = AB_kept
                    advance_tangent(gains, d, share * h, AB)
                land(walker, gait, gains, ground, u_mpc, z, AB, q, dq, stage, linearise)
                theta, dtheta = kernels.closed_loop(walker, gait, gains, q, dq, stage)
                accelerate(gait, gains, dtheta, u_mpc, stage, f)
                if linearise:
                    derive(walker, gait, gains, theta, dtheta, u_mpc, stage, d)
                    advance_tangent(gains, d, (1.0 - share) * h, AB)
                advance(f, (1.0 - share) * h, z)
                from_output(gait, z, q, dq)
                kernels.place(q, dq, stage)
                _, lower, _ = clearance(walker, ground, stage)
            height = lower
        if linearise:
            out.AB[k] = AB
    out.z[N] = z
