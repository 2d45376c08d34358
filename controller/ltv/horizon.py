"""The closed loop ahead, stage by stage, linearised along itself through predicted impacts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.belief import kernels
from controller.belief.closed_loop import Loop, closed_loop
from controller.belief.ground import Ground, clearance, lands
from controller.common.compiled import Array, nested
from controller.ltv.coordinates import N_Z, from_output, to_output
from controller.ltv.landing import land
from controller.ltv.linearisation import derive, new_derivatives
from controller.ltv.motion import COLUMNS, accelerate, advance, advance_tangent


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


def new_horizon(N: int) -> LtvHorizon:
    """Room for N stages."""
    e = np.empty
    return LtvHorizon(
        e((N + 1, 10)), e((N, 10, COLUMNS)), e((N, 4)), e((N, 4, 10)), e((N, 2)), e((N, 2, 10)),
        e((N, 2, 4)), np.empty(N, dtype=np.bool_),
    )  # fmt: skip


class Outlook(NamedTuple):
    """What a motion under a plan begins with and obeys.

    Attributes:
        loop: Closed loop under ZD+PD.
        limit: Torque limits in [N.m], (4,).
        ground: Where the swing foot lands.
        h: Length of a substep in [s].
        substeps: Of each stage.
        q: Measured coordinates in [rad], (5,).
        dq: Measured rates in [rad/s], (5,).
    """

    loop: Loop
    limit: Array
    ground: Ground
    h: float
    substeps: int
    q: Array
    dq: Array


@nested
def look_ahead(outlook: Outlook, plan: Array, linearise: bool, out: LtvHorizon) -> None:
    """Fill the horizon, and make the plan possible: ZD+PD and plan together stay within the torque limits.

    Args:
        outlook: Where the motion begins and what it obeys.
        plan: MPC torque of each stage in [N.m], (N, 4); clipped so that the total at a stage's beginning is legal.
        linearise: Whether to fill the derivatives too.
        out: Filled.
    """
    loop, limit, ground, h, substeps, q0, dq0 = outlook
    walker, gait, gains = loop
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
            theta, dtheta = closed_loop(loop, q, dq, stage)
            for i in range(4):
                u_mpc[i] = min(max(plan[k, i], -limit[i] - stage.u[i]), limit[i] - stage.u[i])
            if sub == 0:
                plan[k] = u_mpc
            accelerate(loop, dtheta, u_mpc, stage, f)
            if sub == 0:
                out.u[k] = stage.u
                kernels.stance_force(walker, stage, out.force[k])
                if not linearise:
                    kernels.responses(stage)
                    kernels.stance_force_per_torque(walker, stage, out.force_u[k])
            if linearise:
                derive(loop, theta, dtheta, u_mpc, stage, d)
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
            if lands(ahead, lower, descent) and not out.exchange[k]:
                out.exchange[k] = True
                share = min(max(height / (height - lower), 0.0), 1.0) if height > 0.0 else 0.0
                z[:] = kept
                advance(f, share * h, z)
                if linearise:
                    AB[:] = AB_kept
                    advance_tangent(gains, d, share * h, AB)
                land(loop, ground, u_mpc, z, AB, q, dq, stage, linearise)
                theta, dtheta = closed_loop(loop, q, dq, stage)
                accelerate(loop, dtheta, u_mpc, stage, f)
                if linearise:
                    derive(loop, theta, dtheta, u_mpc, stage, d)
                    advance_tangent(gains, d, (1.0 - share) * h, AB)
                advance(f, (1.0 - share) * h, z)
                from_output(gait, z, q, dq)
                kernels.place(q, dq, stage)
                _, lower, _ = clearance(walker, ground, stage)
            height = lower
        if linearise:
            out.AB[k] = AB
    out.z[N] = z
