"""Compiled arithmetic of the planar five-link walker, and nothing else.

The walker is a tree of rigid links pinned at the stance foot. In absolute link angles phi its equations are
closed: with d(phi) = (-sin phi, cos phi) the direction of a link, every point of the walker is a constant
combination of the d(phi_i), so that

    D_ij = A_ij cos(phi_i - phi_j),  (C dphi)_i = sum_j A_ij sin(phi_i - phi_j) dphi_j^2,  G_i = -g b_i sin phi_i

with constants A (5, 5) and b (5,) that `model.py` derives from the URDF. Links are ordered stance femur, swing
femur, stance tibia, swing tibia, torso; `phi = H q` maps the paper's coordinates onto them. Everything is in SI
units. Small loops are written out because LAPACK calls cost more than the arithmetic at this size, and no
`fastmath`: results must be the same bytes everywhere.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

compiled = njit(cache=True, error_model="numpy")
"""Compile, keep on disk, and divide as NumPy does: a walker that falls gives inf, not an exception."""

N_Q = 5  # coordinates: stance hip, swing hip, stance knee, swing knee, torso
N_U = 4  # actuated joints
MIRROR = (1, 0, 3, 2, 4)  # leg exchange R as a permutation, the same for q and for phi


class Walker(NamedTuple):
    """Lumped constants of the pinned walker.

    Attributes:
        A: Inertia constants pinned at the stance foot in [kg m^2], (5, 5).
        A_impact: Inertia constants between motion about the new and about the old stance foot in [kg m^2], (5, 5).
        b: First mass moments about the stance foot in [kg m], (5,).
        reach: Link lengths from stance foot to swing foot, signed, in [m], (5,).
        damping: Joint damping in [N.m.s/rad], (4,).
        mass: Total mass in [kg].
        gravity: Gravitational acceleration in [m/s^2].
    """

    A: Array
    A_impact: Array
    b: Array
    reach: Array
    damping: Array
    mass: float
    gravity: float


class GaitTable(NamedTuple):
    """A gait's outputs as polynomials of the normalised clock s.

    Attributes:
        poly: Power-basis coefficients of h_d,i(s), lowest power first, in [rad], (4, M + 1).
        clock: Clock vector c of theta = c q, (5,).
        theta_start: Clock at the start of a step in [rad].
        theta_span: Clock travelled in a step in [rad].
    """

    poly: Array
    clock: Array
    theta_start: float
    theta_span: float


class Gains(NamedTuple):
    """Diagonals of K_P in [1/s^2] and K_D in [1/s], each (4,)."""

    kp: Array
    kd: Array


class Stage(NamedTuple):
    """Scratch of one stage: what the closed loop needs to know about one state.

    Attributes:
        phi, dphi: Link angles and rates, (5,).
        sin, cos: Of the link angles, (5,).
        D: Inertia matrix in link coordinates, overwritten by its Cholesky factor, (5, 5).
        bias: C dphi + G in link coordinates, (5,).
        DinvB: Acceleration per torque in the paper's coordinates, D^-1 B, (5, 4).
        drift: Acceleration without torque in the paper's coordinates, (5,).
        link_DinvB: D^-1 B in link coordinates, (5, 4).
        link_drift: Drift in link coordinates, (5,).
        y, dy: Outputs and rates, (4,).
        h1: dh_d/dtheta, (4,).
        h2: d2h_d/dtheta2, (4,).
        decoupling: L_g L_f h, overwritten by elimination, (4, 4).
        u: ZD+PD torque, (4,).
        ddq: Acceleration under u, (5,).
    """

    phi: Array
    dphi: Array
    sin: Array
    cos: Array
    D: Array
    bias: Array
    DinvB: Array
    drift: Array
    link_DinvB: Array
    link_drift: Array
    y: Array
    dy: Array
    h1: Array
    h2: Array
    decoupling: Array
    u: Array
    ddq: Array


@compiled
def new_stage() -> Stage:
    """Allocate the scratch of one stage."""
    e = np.empty
    return Stage(
        e(5), e(5), e(5), e(5), e((5, 5)), e(5), e((5, 4)), e(5), e((5, 4)), e(5),
        e(4), e(4), e(4), e(4), e((4, 4)), e(4), e(5),
    )  # fmt: skip


@compiled
def to_links(q: Array, phi: Array) -> None:
    """Phi = H q: absolute link angles (or rates) from the paper's coordinates."""
    phi[0] = q[0] + q[4]
    phi[1] = q[1] + q[4]
    phi[2] = q[0] + q[2] + q[4]
    phi[3] = q[1] + q[3] + q[4]
    phi[4] = q[4]


@compiled
def from_links(phi: Array, q: Array) -> None:
    """Q = H^-1 phi, also for rates and accelerations."""
    q[0] = phi[0] - phi[4]
    q[1] = phi[1] - phi[4]
    q[2] = phi[2] - phi[0]
    q[3] = phi[3] - phi[1]
    q[4] = phi[4]


@compiled
def cholesky(D: Array) -> None:
    """Overwrite the lower triangle of a symmetric positive definite matrix by its Cholesky factor."""
    n = D.shape[0]
    for j in range(n):
        d = D[j, j]
        for k in range(j):
            d -= D[j, k] * D[j, k]
        d = np.sqrt(d)
        D[j, j] = d
        for i in range(j + 1, n):
            v = D[i, j]
            for k in range(j):
                v -= D[i, k] * D[j, k]
            D[i, j] = v / d


@compiled
def cholesky_solve(L: Array, x: Array) -> None:
    """Solve L L' x = rhs in place."""
    n = L.shape[0]
    for i in range(n):
        v = x[i]
        for k in range(i):
            v -= L[i, k] * x[k]
        x[i] = v / L[i, i]
    for i in range(n - 1, -1, -1):
        v = x[i]
        for k in range(i + 1, n):
            v -= L[k, i] * x[k]
        x[i] = v / L[i, i]


@compiled
def eliminate(A: Array, x: Array) -> None:
    """Solve A x = rhs in place by Gaussian elimination with partial pivoting; A is overwritten."""
    n = A.shape[0]
    for j in range(n):
        p = j
        for i in range(j + 1, n):
            if abs(A[i, j]) > abs(A[p, j]):
                p = i
        if p != j:
            for k in range(n):
                A[j, k], A[p, k] = A[p, k], A[j, k]
            x[j], x[p] = x[p], x[j]
        for i in range(j + 1, n):
            m = A[i, j] / A[j, j]
            for k in range(j + 1, n):
                A[i, k] -= m * A[j, k]
            x[i] -= m * x[j]
    for i in range(n - 1, -1, -1):
        v = x[i]
        for k in range(i + 1, n):
            v -= A[i, k] * x[k]
        x[i] = v / A[i, i]


@compiled
def link_inertia(walker: Walker, stage: Stage) -> None:
    """D and C dphi + G in link coordinates at the stage's phi, dphi."""
    for i in range(N_Q):
        stage.sin[i] = np.sin(stage.phi[i])
        stage.cos[i] = np.cos(stage.phi[i])
    for i in range(N_Q):
        bias = -walker.gravity * walker.b[i] * stage.sin[i]
        for j in range(N_Q):
            a = walker.A[i, j]
            stage.D[i, j] = a * (stage.cos[i] * stage.cos[j] + stage.sin[i] * stage.sin[j])
            sine = stage.sin[i] * stage.cos[j] - stage.cos[i] * stage.sin[j]
            bias += a * sine * stage.dphi[j] * stage.dphi[j]
        stage.bias[i] = bias


@compiled
def accelerations(walker: Walker, q: Array, dq: Array, stage: Stage) -> None:
    """Drift f and input map D^-1 B of the stance dynamics, Eqs. (1)-(2), with joint damping in the drift."""
    to_links(q, stage.phi)
    to_links(dq, stage.dphi)
    link_inertia(walker, stage)
    cholesky(stage.D)
    damp = walker.damping
    # Joint torques act on links as B_phi tau = H^-T B tau.
    x = stage.link_drift
    x[0] = -stage.bias[0] - damp[0] * dq[0] + damp[2] * dq[2]
    x[1] = -stage.bias[1] - damp[1] * dq[1] + damp[3] * dq[3]
    x[2] = -stage.bias[2] - damp[2] * dq[2]
    x[3] = -stage.bias[3] - damp[3] * dq[3]
    x[4] = -stage.bias[4] + damp[0] * dq[0] + damp[1] * dq[1]
    cholesky_solve(stage.D, x)
    from_links(x, stage.drift)
    for j in range(N_U):
        column = stage.link_DinvB[:, j]
        for i in range(N_Q):
            column[i] = 0.0
        column[j] = 1.0
        if j < 2:
            column[4] = -1.0
        else:
            column[j - 2] = -1.0
        cholesky_solve(stage.D, column)
        from_links(column, stage.DinvB[:, j])


@compiled
def outputs(gait: GaitTable, q: Array, dq: Array, stage: Stage) -> tuple[float, float]:
    """Outputs y = h_0(q) - h_d(theta) and rates, Eq. (5); returns theta and its rate."""
    theta = 0.0
    dtheta = 0.0
    for i in range(N_Q):
        theta += gait.clock[i] * q[i]
        dtheta += gait.clock[i] * dq[i]
    s = (theta - gait.theta_start) / gait.theta_span
    degree = gait.poly.shape[1] - 1
    for i in range(N_U):
        h = gait.poly[i, degree]
        h1 = 0.0
        h2 = 0.0
        for k in range(degree - 1, -1, -1):
            h2 = h2 * s + 2.0 * h1
            h1 = h1 * s + h
            h = h * s + gait.poly[i, k]
        stage.h1[i] = h1 / gait.theta_span
        stage.h2[i] = h2 / (gait.theta_span * gait.theta_span)
        stage.y[i] = q[i] - h
        stage.dy[i] = dq[i] - stage.h1[i] * dtheta
    return theta, dtheta


@compiled
def closed_loop(
    walker: Walker, gait: GaitTable, gains: Gains, q: Array, dq: Array, stage: Stage
) -> tuple[float, float]:
    """ZD+PD torque and the acceleration under it, Eqs. (5)-(9); returns theta and its rate."""
    accelerations(walker, q, dq, stage)
    theta, dtheta = outputs(gait, q, dq, stage)
    drift_theta = 0.0
    for i in range(N_Q):
        drift_theta += gait.clock[i] * stage.drift[i]
    for i in range(N_U):
        v = -gains.kd[i] * stage.dy[i] - gains.kp[i] * stage.y[i]  # Eq. (9)
        lie2 = stage.drift[i] - stage.h1[i] * drift_theta - stage.h2[i] * dtheta * dtheta  # L_f^2 h
        stage.u[i] = v - lie2
    for j in range(N_U):
        theta_j = 0.0
        for i in range(N_Q):
            theta_j += gait.clock[i] * stage.DinvB[i, j]
        for i in range(N_U):
            stage.decoupling[i, j] = stage.DinvB[i, j] - stage.h1[i] * theta_j  # L_g L_f h
    eliminate(stage.decoupling, stage.u)  # Eq. (7)
    for i in range(N_Q):
        a = stage.drift[i]
        for j in range(N_U):
            a += stage.DinvB[i, j] * stage.u[j]
        stage.ddq[i] = a
    return theta, dtheta


@compiled
def stance_force(walker: Walker, u: Array, stage: Stage, force: Array, per_torque: Array) -> None:
    """Stance contact force F_f under torque u and its change per torque, -S_MPC, Eqs. (18) and (20).

    Written as the momentum balance of the pinned walker, F = m (ddp_com + g), which is what Eq. (18) says of a
    foot that does not move. `accelerations` must have run.

    Args:
        walker: Lumped constants.
        u: Torque in [N.m], (4,), stance order.
        stage: Scratch.
        force: Filled with (tangential, normal) in [N], (2,).
        per_torque: Filled with dF/du in [1/m], (2, 4).
    """
    tangential = 0.0
    normal = walker.mass * walker.gravity
    for i in range(N_Q):
        square = stage.dphi[i] * stage.dphi[i]
        tangential += walker.b[i] * (stage.sin[i] * square - stage.cos[i] * stage.link_drift[i])
        normal += walker.b[i] * (-stage.cos[i] * square - stage.sin[i] * stage.link_drift[i])
    for j in range(N_U):
        t = 0.0
        n = 0.0
        for i in range(N_Q):
            t -= walker.b[i] * stage.cos[i] * stage.link_DinvB[i, j]
            n -= walker.b[i] * stage.sin[i] * stage.link_DinvB[i, j]
        per_torque[0, j] = t
        per_torque[1, j] = n
        tangential += t * u[j]
        normal += n * u[j]
    force[0] = tangential
    force[1] = normal


@compiled
def swing_foot(walker: Walker, q: Array, dq: Array, stage: Stage) -> tuple[float, float, float]:
    """Swing foot relative to the stance foot: p_2^h, p_2^v in [m] and the rate of p_2^v in [m/s]."""
    to_links(q, stage.phi)
    to_links(dq, stage.dphi)
    horizontal = 0.0
    vertical = 0.0
    rate = 0.0
    for i in range(N_Q):
        sine = np.sin(stage.phi[i])
        horizontal -= walker.reach[i] * sine
        vertical += walker.reach[i] * np.cos(stage.phi[i])
        rate -= walker.reach[i] * sine * stage.dphi[i]
    return horizontal, vertical, rate


@compiled
def impact(walker: Walker, q: Array, dq: Array, stage: Stage) -> None:
    """Rigid impact and leg exchange in place, x+ = Delta(x-) of Eq. (3).

    Momentum about the new stance foot is kept for every link: D(phi) dphi+ = D_impact(phi) dphi-. This is the
    unpinned impact of the literature with the multipliers of the landing foot eliminated.
    """
    to_links(q, stage.phi)
    to_links(dq, stage.dphi)
    for i in range(N_Q):
        stage.sin[i] = np.sin(stage.phi[i])
        stage.cos[i] = np.cos(stage.phi[i])
    momentum = stage.link_drift
    for i in range(N_Q):
        p = 0.0
        for j in range(N_Q):
            cosine = stage.cos[i] * stage.cos[j] + stage.sin[i] * stage.sin[j]
            p += walker.A_impact[i, j] * cosine * stage.dphi[j]
        momentum[MIRROR[i]] = p
    for i in range(N_Q):
        stage.ddq[i] = q[i]
    for i in range(N_Q):
        q[MIRROR[i]] = stage.ddq[i]
    to_links(q, stage.phi)
    link_inertia(walker, stage)
    cholesky(stage.D)
    cholesky_solve(stage.D, momentum)
    from_links(momentum, dq)


class Rollout(NamedTuple):
    """Arrays of a horizon of N stages, filled by `rollout`; see `prediction.Horizon` for their meaning."""

    x: Array  # (N + 1, 10)
    u: Array  # (N, 4)
    y: Array  # (N + 1, 4)
    dy: Array  # (N + 1, 4)
    rate_per_torque: Array  # (N, 4, 4)
    force: Array  # (N, 2)
    force_per_torque: Array  # (N, 2, 4)
    exchange: NDArray[np.bool_]  # (N,)


@compiled
def rollout(
    walker: Walker, gait: GaitTable, gains: Gains, T: float, q0: Array, dq0: Array, out: Rollout
) -> tuple[float, float]:
    """Closed loop under ZD+PD over N stages with impacts, Eqs. (10)-(13); returns theta and its rate at stage 0."""
    stage = new_stage()
    q = q0.copy()
    dq = dq0.copy()
    theta0 = 0.0
    dtheta0 = 0.0
    N = out.u.shape[0]
    for k in range(N):
        out.x[k, :N_Q] = q
        out.x[k, N_Q:] = dq
        theta, dtheta = closed_loop(walker, gait, gains, q, dq, stage)
        if k == 0:
            theta0, dtheta0 = theta, dtheta
        stance_force(walker, stage.u, stage, out.force[k], out.force_per_torque[k])
        for i in range(N_U):
            out.y[k, i] = stage.y[i]
            out.dy[k, i] = stage.dy[i]
            out.u[k, i] = stage.u[i]
            for j in range(N_U):
                out.rate_per_torque[k, i, j] = T * stage.DinvB[i, j]  # velocity rows of T g_k, Eq. (12)
        for i in range(N_Q):
            q[i] += T * dq[i] + 0.5 * T * T * stage.ddq[i]  # Eq. (10)
            dq[i] += T * stage.ddq[i]
        ahead, height, rate = swing_foot(walker, q, dq, stage)
        out.exchange[k] = ahead > 0.0 and height <= 0.0 and rate < 0.0  # x in S, Eq. (4)
        if out.exchange[k]:
            impact(walker, q, dq, stage)
    outputs(gait, q, dq, stage)
    out.x[N, :N_Q] = q
    out.x[N, N_Q:] = dq
    out.y[N, :] = stage.y
    out.dy[N, :] = stage.dy
    return theta0, dtheta0
