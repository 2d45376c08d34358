"""One integration step of the closed loop under a held MPC torque, and its tangent."""

import numpy as np

from controller.belief import kernels
from controller.belief.closed_loop import Gains, Loop, clock_of
from controller.belief.linalg import cholesky5_solve
from controller.common.compiled import Array, nested
from controller.ltv.coordinates import DTHETA, DY, N_Z, THETA, Y
from controller.ltv.linearisation import Derivatives

COLUMNS = N_Z + 4  # derivatives by z and by a torque held over the stage


@nested
def accelerate(loop: Loop, dtheta: float, u_mpc: Array, stage: kernels.Stage, f: Array) -> None:
    """dz/dt of the closed loop under a held u_mpc, (10,), after `closed_loop`; factorises the inertia."""
    gait, gains = loop.gait, loop.gains
    kernels.factor_inertia(stage)
    x, ddq = np.empty(5), np.empty(5)
    x[0] = u_mpc[0] - u_mpc[2]
    x[1] = u_mpc[1] - u_mpc[3]
    x[2] = u_mpc[2]
    x[3] = u_mpc[3]
    x[4] = -u_mpc[0] - u_mpc[1]
    cholesky5_solve(stage.L, x)
    kernels.from_links(x, ddq)
    by_zd, by_mpc = clock_of(gait, stage.ddq), clock_of(gait, ddq)
    for i in range(4):
        f[Y + i] = stage.dy[i]
        f[DY + i] = -gains.kp[i] * stage.y[i] - gains.kd[i] * stage.dy[i] + ddq[i] - stage.h1[i] * by_mpc
    f[THETA] = dtheta
    f[DTHETA] = by_zd + by_mpc


@nested
def advance(f: Array, h: float, z: Array) -> None:
    """One step of length h in place, second-order in the positions, as Eq. (10)."""
    for i in range(4):
        z[Y + i] += h * z[DY + i] + 0.5 * h * h * f[DY + i]
        z[DY + i] += h * f[DY + i]
    z[THETA] += h * z[DTHETA] + 0.5 * h * h * f[DTHETA]
    z[DTHETA] += h * f[DTHETA]


@nested
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
