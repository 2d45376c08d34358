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

from typing import NamedTuple

import numpy as np

from controller.belief.linalg import cholesky5, cholesky5_solve
from controller.common.compiled import Array, compiled, inlined, nested

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
    """phi = H q: absolute link angles (or rates) from the paper's coordinates."""
    phi[0] = q[0] + q[4]
    phi[1] = q[1] + q[4]
    phi[2] = q[0] + q[2] + q[4]
    phi[3] = q[1] + q[3] + q[4]
    phi[4] = q[4]


@inlined
def from_links(phi: Array, q: Array) -> None:
    """q = H^-1 phi, also for rates and accelerations."""
    q[0] = phi[0] - phi[4]
    q[1] = phi[1] - phi[4]
    q[2] = phi[2] - phi[0]
    q[3] = phi[3] - phi[1]
    q[4] = phi[4]


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


@nested
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


@nested
def resistance(walker: Walker, i: int, q: float, dq: float) -> float:
    """Torque of spring and dry friction against joint i at angle q [rad] and rate dq [rad/s], in [N.m].

    Friction is smooth about standstill: the sign of the rate as tanh(dq / `STICK`).
    """
    return walker.friction[i] * np.tanh(dq / STICK) + walker.stiffness[i] * (q - walker.rest[i])


@nested
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
def swing_foot_of(walker: Walker, q: Array, dq: Array) -> tuple[float, float, float]:
    """The same of a state."""
    stage = new_stage()
    place(q, dq, stage)
    return swing_foot(walker, stage)


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
