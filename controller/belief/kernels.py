"""Compiled arithmetic of the planar five-link walker, and nothing else.

The walker is a tree of rigid links pinned at the stance foot. In absolute link angles phi its equations are
closed: with d(phi) = (-sin phi, cos phi) the direction of a link, every point of the walker is a constant
combination of the d(phi_i), so that

    D_ij = A_ij cos(phi_i - phi_j),  (C dphi)_i = sum_j A_ij sin(phi_i - phi_j) dphi_j^2,  G_i = -g b_i sin phi_i

with constants A (5, 5) and b (5,) that `model.py` derives from the URDF. What walkers may have beyond that (centres of
mass off their links' axes, rotor inertia, springs, dry friction) has constants of its own and costs the others nothing.
Links are ordered stance femur, swing femur, stance tibia, swing tibia, torso; `phi = H q` maps the paper's coordinates
onto them. Everything is in SI units. Small loops are written out because LAPACK calls cost more than the arithmetic at
this size, and no `fastmath`: results must be the same bytes everywhere.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.compiled import Array, compiled, inlined

N_Q = 5  # coordinates: stance hip, swing hip, stance knee, swing knee, torso
N_U = 4  # actuated joints
STICK = 0.05  # [rad/s] below which a joint counts as sticking, in the belief's smooth friction
SMALL_ANGLE = 0.05  # [rad] the series of `turn` are good to rounding below it
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
        extended: Whether any of the next four is not zero; they are read only then.
        A_across, A_impact_across: What centres of mass off their links' axes add to A and A_impact, of the sine of
            phi_i - phi_j instead of the cosine, in [kg m^2], (5, 5), the first antisymmetric.
        b_across: What they add to b, at right angles to the links, in [kg m], (5,).
        rotor: Rotor inertia seen by the links, the same in every posture, in [kg m^2], (5, 5).
        resists: Whether any of the next two is not zero; the last three are read only then.
        friction: Dry friction of the joints in [N.m], (4,).
        stiffness: Of springs in the joints in [N.m/rad], (4,).
        rest: Angles at which the springs are slack in [rad], (4,).
    """

    A: Array
    A_impact: Array
    b: Array
    reach: Array
    damping: Array
    mass: float
    gravity: float
    extended: bool
    A_across: Array
    A_impact_across: Array
    b_across: Array
    rotor: Array
    resists: bool
    friction: Array
    stiffness: Array
    rest: Array


class GaitTable(NamedTuple):
    """A gait's outputs as polynomials of the normalised clock s.

    Attributes:
        poly: Power-basis coefficients of h_d,i(s), lowest power first, in [rad], (4, M + 1).
        clock: Clock vector c of theta = c q, (5,).
        theta_start: Clock at the start of a step in [rad].
        theta_span: Clock travelled in a step in [rad].
        s_first, s_last: Beyond these the outputs go on along their tangents; by default the polynomials never end.
    """

    poly: Array
    clock: Array
    theta_start: float
    theta_span: float
    s_first: float = -np.inf
    s_last: float = np.inf


class Gains(NamedTuple):
    """Diagonals of K_P in [1/s^2] and K_D in [1/s], each (4,)."""

    kp: Array
    kd: Array


class Stage(NamedTuple):
    """Scratch of one stage: what the closed loop needs to know about one state. "Link" means per link angle phi.

    Attributes:
        phi, dphi, ddphi: Link angles, rates and accelerations, (5,).
        sin, cos: Of the link angles, (5,).
        D: Link inertia matrix, (5, 5).
        L: Its Cholesky factor, (5, 5).
        bias: Link C dphi + G, (5,).
        link_BtDinv: Link acceleration per torque, a row a torque, (4, 5).
        BtDinv: The same in the paper's coordinates, (D^-1 B)', (4, 5).
        y, dy: Outputs and rates, (4,).
        h1: dh_d/dtheta, (4,).
        h2: d2h_d/dtheta2, (4,).
        u: Torque, (4,).
        ddq: Acceleration in the paper's coordinates, (5,).
    """

    phi: Array
    dphi: Array
    ddphi: Array
    sin: Array
    cos: Array
    D: Array
    L: Array
    bias: Array
    link_BtDinv: Array
    BtDinv: Array
    y: Array
    dy: Array
    h1: Array
    h2: Array
    u: Array
    ddq: Array


@compiled
def new_stage() -> Stage:
    """Allocate the scratch of one stage."""
    e = np.empty
    return Stage(
        e(5), e(5), e(5), e(5), e(5), e((5, 5)), e((5, 5)), e(5), e((4, 5)), e((4, 5)),
        e(4), e(4), e(4), e(4), e(4), e(5),
    )  # fmt: skip


@inlined
def to_links(q: Array, phi: Array) -> None:
    """Phi = H q: absolute link angles (or rates) from the paper's coordinates."""
    phi[0] = q[0] + q[4]
    phi[1] = q[1] + q[4]
    phi[2] = q[0] + q[2] + q[4]
    phi[3] = q[1] + q[3] + q[4]
    phi[4] = q[4]


@inlined
def from_links(phi: Array, q: Array) -> None:
    """Q = H^-1 phi, also for rates and accelerations."""
    q[0] = phi[0] - phi[4]
    q[1] = phi[1] - phi[4]
    q[2] = phi[2] - phi[0]
    q[3] = phi[3] - phi[1]
    q[4] = phi[4]


def _cholesky(n: int) -> tuple[Callable[[Array], None], Callable[[Array, Array], None]]:
    """Factorisation and solve for n x n; with n known to the compiler the loops are unrolled, four times as fast."""

    @inlined
    def factorise(D: Array) -> None:
        """Overwrite the lower triangle of a symmetric positive definite matrix by its Cholesky factor.

        The diagonal gets the reciprocals of the factor's: a solve then multiplies where it would divide.
        """
        for j in range(n):
            d = D[j, j]
            for k in range(j):
                d -= D[j, k] * D[j, k]
            d = 1.0 / np.sqrt(d)
            D[j, j] = d
            for i in range(j + 1, n):
                v = D[i, j]
                for k in range(j):
                    v -= D[i, k] * D[j, k]
                D[i, j] = v * d

    @inlined
    def solve(L: Array, x: Array) -> None:
        """Solve L L' x = rhs in place, L from the factorisation."""
        for i in range(n):
            v = x[i]
            for k in range(i):
                v -= L[i, k] * x[k]
            x[i] = v * L[i, i]
        for i in range(n - 1, -1, -1):
            v = x[i]
            for k in range(i + 1, n):
                v -= L[k, i] * x[k]
            x[i] = v * L[i, i]

    return factorise, solve


cholesky4, cholesky4_solve = _cholesky(4)
cholesky5, cholesky5_solve = _cholesky(5)


@inlined
def place(q: Array, dq: Array, stage: Stage) -> None:
    """Put the walker into a state: link angles, their rates, sines and cosines. All that follows starts from here."""
    to_links(q, stage.phi)
    to_links(dq, stage.dphi)
    for i in range(N_Q):
        stage.sin[i] = np.sin(stage.phi[i])
        stage.cos[i] = np.cos(stage.phi[i])


@inlined
def turn(q: Array, dq: Array, stage: Stage) -> None:
    """`place` for a state near the last one: its sines and cosines turned by the small change of every angle.

    A series is a fifth of the cost of `np.sin` and `np.cos`; it is good to rounding up to `SMALL_ANGLE`.
    """
    delta = stage.ddphi
    for i in range(N_Q):
        delta[i] = -stage.phi[i]
    to_links(q, stage.phi)
    to_links(dq, stage.dphi)
    small = True
    for i in range(N_Q):
        delta[i] += stage.phi[i]
        small = small and abs(delta[i]) < SMALL_ANGLE
    if not small:  # NaN, too
        place(q, dq, stage)
        return
    for i in range(N_Q):
        d, s, c = delta[i], stage.sin[i], stage.cos[i]
        dd = d * d
        sine = d - d * dd * (1 / 6 - dd * (1 / 120 - dd * (1 / 5040)))
        less = dd * (1 / 2 - dd * (1 / 24 - dd * (1 / 720)))  # 1 - cos d
        stage.sin[i] = s + (c * sine - s * less)
        stage.cos[i] = c - (s * sine + c * less)


@compiled
def extend_inertia(walker: Walker, stage: Stage) -> None:
    """What rotors and centres of mass off their links' axes add to D and C dphi + G."""
    for i in range(N_Q):
        stage.bias[i] += walker.gravity * walker.b_across[i] * stage.cos[i]
        for j in range(N_Q):
            across = walker.A_across[i, j]
            sine = stage.sin[i] * stage.cos[j] - stage.cos[i] * stage.sin[j]
            cosine = stage.cos[i] * stage.cos[j] + stage.sin[i] * stage.sin[j]
            stage.D[i, j] += walker.rotor[i, j] + across * sine
            stage.bias[i] -= across * cosine * stage.dphi[j] * stage.dphi[j]


@compiled
def resistance(walker: Walker, i: int, q: float, dq: float) -> float:
    """Torque of spring and dry friction against joint i at angle q [rad] and rate dq [rad/s], in [N.m].

    Friction is smooth about standstill: the sign of the rate as tanh(dq / `STICK`).
    """
    return walker.friction[i] * np.tanh(dq / STICK) + walker.stiffness[i] * (q - walker.rest[i])


@compiled
def resistance_slopes(walker: Walker, i: int, dq: float) -> tuple[float, float]:
    """Derivatives of `resistance` by rate in [N.m.s/rad] and by angle in [N.m/rad]."""
    stick = np.tanh(dq / STICK)
    return walker.friction[i] * (1.0 - stick * stick) / STICK, walker.stiffness[i]


@inlined
def link_inertia(walker: Walker, stage: Stage) -> None:
    """D and C dphi + G in link coordinates."""
    for i in range(N_Q):
        stage.bias[i] = -walker.gravity * walker.b[i] * stage.sin[i]
        stage.D[i, i] = walker.A[i, i]
    for i in range(N_Q):
        for j in range(i):
            a = walker.A[i, j]
            d = a * (stage.cos[i] * stage.cos[j] + stage.sin[i] * stage.sin[j])
            stage.D[i, j] = d
            stage.D[j, i] = d
            coriolis = a * (stage.sin[i] * stage.cos[j] - stage.cos[i] * stage.sin[j])
            stage.bias[i] += coriolis * stage.dphi[j] * stage.dphi[j]
            stage.bias[j] -= coriolis * stage.dphi[i] * stage.dphi[i]
    if walker.extended:
        extend_inertia(walker, stage)


@inlined
def factor_inertia(stage: Stage) -> None:
    """Cholesky factor of the link inertia matrix, after `link_inertia`."""
    for i in range(N_Q):
        for j in range(i + 1):
            stage.L[i, j] = stage.D[i, j]
    cholesky5(stage.L)


@compiled
def accelerate(walker: Walker, dq: Array, u: Array, stage: Stage) -> None:
    """Acceleration under a torque u, Eqs. (1)-(2) with joint damping, after `place`."""
    link_inertia(walker, stage)
    factor_inertia(stage)
    tau = np.zeros(N_Q)
    for i in range(N_U):
        tau[i] = u[i] - walker.damping[i] * dq[i]
    if walker.resists:
        q = stage.ddq
        from_links(stage.phi, q)
        for i in range(N_U):
            tau[i] -= resistance(walker, i, q[i], dq[i])
    # Joint torques act on links as H^-T B tau.
    x = stage.ddphi
    x[0] = tau[0] - tau[2] - stage.bias[0]
    x[1] = tau[1] - tau[3] - stage.bias[1]
    x[2] = tau[2] - stage.bias[2]
    x[3] = tau[3] - stage.bias[3]
    x[4] = -tau[0] - tau[1] - stage.bias[4]
    cholesky5_solve(stage.L, x)
    from_links(x, stage.ddq)


@inlined
def responses(stage: Stage) -> None:
    """Acceleration per torque, D^-1 B of Eqs. (2) and (12), after `factor_inertia`."""
    for j in range(N_U):
        x = stage.link_BtDinv[j]
        for i in range(N_Q):
            x[i] = 0.0
        x[j] = 1.0
        x[4 if j < 2 else j - 2] = -1.0
        cholesky5_solve(stage.L, x)
        from_links(x, stage.BtDinv[j])


@inlined
def outputs(gait: GaitTable, q: Array, dq: Array, stage: Stage) -> tuple[float, float]:
    """Outputs y = h_0(q) - h_d(theta) and rates, Eq. (5); returns theta and its rate."""
    theta = 0.0
    dtheta = 0.0
    for i in range(N_Q):
        theta += gait.clock[i] * q[i]
        dtheta += gait.clock[i] * dq[i]
    wished = (theta - gait.theta_start) / gait.theta_span
    s = min(max(wished, gait.s_first), gait.s_last)
    degree = gait.poly.shape[1] - 1
    for i in range(N_U):
        h = gait.poly[i, degree]
        h1 = 0.0
        h2 = 0.0
        for k in range(degree - 1, -1, -1):
            h2 = h2 * s + 2.0 * h1
            h1 = h1 * s + h
            h = h * s + gait.poly[i, k]
        if s != wished:
            h += h1 * (wished - s)
            h2 = 0.0
        stage.h1[i] = h1 / gait.theta_span
        stage.h2[i] = h2 / (gait.theta_span * gait.theta_span)
        stage.y[i] = q[i] - h
        stage.dy[i] = dq[i] - stage.h1[i] * dtheta
    return theta, dtheta


@inlined
def closed_loop(
    walker: Walker, gait: GaitTable, gains: Gains, q: Array, dq: Array, stage: Stage
) -> tuple[float, float]:
    """ZD+PD torque and the acceleration under it, Eqs. (5)-(9), after `place`; returns theta and its rate.

    The torque of Eq. (7) makes ddy = v. With one unactuated degree of freedom its 4 x 4 system reduces to a scalar
    one: ddq_a = v + h'' dtheta^2 + h' ddtheta for the actuated joints, and the equation of motion of the torso
    angle, which no torque enters, gives ddtheta. The other equations of motion then give the torque.
    """
    link_inertia(walker, stage)
    theta, dtheta = outputs(gait, q, dq, stage)
    # Row of the torso angle in the paper's coordinates: H' sums the link equations.
    D, c, bias = stage.D, gait.clock, stage.bias
    s0, s1 = D[0, 0] + D[1, 0] + D[2, 0] + D[3, 0] + D[4, 0], D[0, 1] + D[1, 1] + D[2, 1] + D[3, 1] + D[4, 1]
    s2, s3 = D[0, 2] + D[1, 2] + D[2, 2] + D[3, 2] + D[4, 2], D[0, 3] + D[1, 3] + D[2, 3] + D[3, 3] + D[4, 3]
    s4 = D[0, 4] + D[1, 4] + D[2, 4] + D[3, 4] + D[4, 4]
    total = s0 + s1 + s2 + s3 + s4
    row = (s0 + s2, s1 + s3, s2, s3)
    # row . ddq_a + total * ddq_5 + bias = 0 with ddq_a = free + h' ddtheta, ddq_5 = (ddtheta - c_a . ddq_a) / c_5
    constant = bias[0] + bias[1] + bias[2] + bias[3] + bias[4]
    slope, clock_free, clock_slope = 0.0, 0.0, 0.0
    ddq, square = stage.ddq, dtheta * dtheta
    for i in range(N_U):
        v = -gains.kd[i] * stage.dy[i] - gains.kp[i] * stage.y[i]  # Eq. (9)
        free = v + stage.h2[i] * square
        ddq[i] = free
        constant += row[i] * free
        slope += row[i] * stage.h1[i]
        clock_free += c[i] * free
        clock_slope += c[i] * stage.h1[i]
    per_torso = 1.0 / c[4]
    ratio = total * per_torso
    ddtheta = (ratio * clock_free - constant) / (slope + ratio * (1.0 - clock_slope))
    for i in range(N_U):
        ddq[i] += stage.h1[i] * ddtheta
    ddq[4] = (ddtheta * (1.0 - clock_slope) - clock_free) * per_torso
    to_links(ddq, stage.ddphi)
    a0, a1, a2, a3, a4 = stage.ddphi[0], stage.ddphi[1], stage.ddphi[2], stage.ddphi[3], stage.ddphi[4]
    knee_stance = bias[2] + D[2, 0] * a0 + D[2, 1] * a1 + D[2, 2] * a2 + D[2, 3] * a3 + D[2, 4] * a4
    knee_swing = bias[3] + D[3, 0] * a0 + D[3, 1] * a1 + D[3, 2] * a2 + D[3, 3] * a3 + D[3, 4] * a4
    hip_stance = bias[0] + D[0, 0] * a0 + D[0, 1] * a1 + D[0, 2] * a2 + D[0, 3] * a3 + D[0, 4] * a4
    hip_swing = bias[1] + D[1, 0] * a0 + D[1, 1] * a1 + D[1, 2] * a2 + D[1, 3] * a3 + D[1, 4] * a4
    stage.u[0] = hip_stance + knee_stance + walker.damping[0] * dq[0]
    stage.u[1] = hip_swing + knee_swing + walker.damping[1] * dq[1]
    stage.u[2] = knee_stance + walker.damping[2] * dq[2]
    stage.u[3] = knee_swing + walker.damping[3] * dq[3]
    if walker.resists:
        for i in range(N_U):
            stage.u[i] += resistance(walker, i, q[i], dq[i])
    return theta, dtheta


@inlined
def stance_force(walker: Walker, stage: Stage, force: Array) -> None:
    """Stance contact force, Eq. (18), at the stage's link accelerations; (tangential, normal) in [N], (2,).

    Written as the momentum balance of the pinned walker, F = m (ddp_com + g), which is what Eq. (18) says of a
    foot that does not move.
    """
    tangential = 0.0
    normal = walker.mass * walker.gravity
    for i in range(N_Q):
        square = stage.dphi[i] * stage.dphi[i]
        tangential += walker.b[i] * (stage.sin[i] * square - stage.cos[i] * stage.ddphi[i])
        normal -= walker.b[i] * (stage.cos[i] * square + stage.sin[i] * stage.ddphi[i])
        if walker.extended:
            tangential -= walker.b_across[i] * (stage.cos[i] * square + stage.sin[i] * stage.ddphi[i])
            normal -= walker.b_across[i] * (stage.sin[i] * square - stage.cos[i] * stage.ddphi[i])
    force[0] = tangential
    force[1] = normal


@compiled
def zero_dynamics(
    walker: Walker, gait: GaitTable, gains: Gains, q: Array, dq: Array
) -> tuple[float, float, Array, Array, Array, Array, Array]:
    """The closed loop at one state: theta and its rate, u, y, dy, ddq, and the stance force under u."""
    stage = new_stage()
    force = np.empty(2)
    place(q, dq, stage)
    theta, dtheta = closed_loop(walker, gait, gains, q, dq, stage)
    stance_force(walker, stage, force)
    return theta, dtheta, stage.u, stage.y, stage.dy, stage.ddq, force


@inlined
def stance_force_per_torque(walker: Walker, stage: Stage, per_torque: Array) -> None:
    """dF/du = -S_MPC of Eq. (20) in [1/m], (2, 4), after `responses`."""
    for j in range(N_U):
        tangential = 0.0
        normal = 0.0
        for i in range(N_Q):
            tangential -= walker.b[i] * stage.cos[i] * stage.link_BtDinv[j, i]
            normal -= walker.b[i] * stage.sin[i] * stage.link_BtDinv[j, i]
            if walker.extended:
                tangential -= walker.b_across[i] * stage.sin[i] * stage.link_BtDinv[j, i]
                normal += walker.b_across[i] * stage.cos[i] * stage.link_BtDinv[j, i]
        per_torque[0, j] = tangential
        per_torque[1, j] = normal


@inlined
def swing_foot(walker: Walker, stage: Stage) -> tuple[float, float, float]:
    """Swing foot from the stance foot, after `place`: p_2^h, p_2^v in [m] and the rate of p_2^v in [m/s]."""
    horizontal = 0.0
    vertical = 0.0
    rate = 0.0
    for i in range(N_Q):
        horizontal -= walker.reach[i] * stage.sin[i]
        vertical += walker.reach[i] * stage.cos[i]
        rate -= walker.reach[i] * stage.sin[i] * stage.dphi[i]
    return horizontal, vertical, rate


@compiled
def impact(walker: Walker, q: Array, dq: Array, stage: Stage) -> None:
    """Rigid impact and leg exchange in place, x+ = Delta(x-) of Eq. (3), after `place`; places the new state.

    Momentum about the new stance foot is kept for every link: D(phi) dphi+ = D_impact(phi) dphi-. This is the
    unpinned impact of the literature with the multipliers of the landing foot eliminated.
    """
    momentum = stage.ddphi
    for i in range(N_Q):
        p = 0.0
        for j in range(N_Q):
            cosine = stage.cos[i] * stage.cos[j] + stage.sin[i] * stage.sin[j]
            p += walker.A_impact[i, j] * cosine * stage.dphi[j]
            if walker.extended:
                sine = stage.sin[i] * stage.cos[j] - stage.cos[i] * stage.sin[j]
                p += (walker.A_impact_across[i, j] * sine + walker.rotor[i, j]) * stage.dphi[j]
        momentum[MIRROR[i]] = p
        stage.ddq[MIRROR[i]] = q[i]
    for i in range(N_Q):
        q[i] = stage.ddq[i]
    place(q, dq, stage)
    link_inertia(walker, stage)
    factor_inertia(stage)
    cholesky5_solve(stage.L, momentum)
    from_links(momentum, dq)
    to_links(dq, stage.dphi)


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
    place(q, dq, stage)
    _, height, _ = swing_foot(walker, stage)
    for k in range(N):
        for i in range(N_Q):
            out.x[k, i] = q[i]
            out.x[k, N_Q + i] = dq[i]
        theta, dtheta = closed_loop(walker, gait, gains, q, dq, stage)
        if k == 0:
            theta0, dtheta0 = theta, dtheta
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
        # x reaches S, Eq. (4). A foot measured in the air below S does not land: the ground is lower than believed,
        # and an impact predicted for the next stage, tick after tick, would have the MPC lift the foot again.
        out.exchange[k] = ahead > 0.0 and before > 0.0 and height <= 0.0 and rate < 0.0
        if out.exchange[k]:
            impact(walker, q, dq, stage)
            _, height, _ = swing_foot(walker, stage)
    outputs(gait, q, dq, stage)
    for i in range(N_Q):
        out.x[N, i] = q[i]
        out.x[N, N_Q + i] = dq[i]
    for i in range(N_U):
        out.y[N, i] = stage.y[i]
        out.dy[N, i] = stage.dy[i]
    return theta0, dtheta0
