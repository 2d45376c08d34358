"""The ZD+PD closed loop's exact derivatives, in output coordinates z = (y, dy, theta, dtheta).

In these coordinates the closed loop is linear but for the clock: ddy = -K_D dy - K_P y, and ddtheta follows from the
one equation of motion that no torque enters. Every derivative below is a product of the derivatives of the link torques
tau(phi, dphi, ddphi) = D ddphi + C dphi + G, which are closed, with those of phi, dphi, ddphi in z (`coordinates`).
"""

from typing import NamedTuple

import numpy as np

from controller.belief import kernels
from controller.belief.closed_loop import GaitTable, Loop, clock_of
from controller.belief.kernels import Walker
from controller.belief.linalg import cholesky5_solve_all
from controller.common.compiled import Array, compiled, nested
from controller.ltv.coordinates import DTHETA, DY, N_Z, THETA, Y, times_J


class Derivatives(NamedTuple):
    """Of the closed loop at one state.

    Attributes:
        clock: d ddtheta/dz, (10,).
        clock_u: d ddtheta/du, (4,).
        output_u: d ddy/du, L_g L_f h, (4, 4).
        output_z: d ddy/d(y, theta) at a held MPC torque, beyond -K_P and -K_D, (4, 5).
        torque: du/dz of the ZD+PD torque in [N.m per unit of z], (4, 10).
        force: dF/dz of the stance force under that torque, (2, 10).
        force_u: dF/du in [1/m], (2, 4).
        P, R, D: Derivatives of the five link torques and the two force components by phi, dphi, ddphi, (7, 5); scratch.
        by_z: Derivatives of the same seven by z, (7, 10); scratch.
        by_torque: The same five and two by phi under a held torque's acceleration, (7, 5); scratch.
        columns: How that moves the links, by (y, theta), (5, 5); scratch.
        links: Vectors of the five links, (5, 5); scratch.
        outputs: Vectors of the four outputs, (6, 4); scratch.
        sums: One number for each of the seven, (7,); scratch.
    """

    clock: Array
    clock_u: Array
    output_u: Array
    output_z: Array
    torque: Array
    force: Array
    force_u: Array
    P: Array
    R: Array
    D: Array
    by_z: Array
    by_torque: Array
    columns: Array
    links: Array
    outputs: Array
    sums: Array


@compiled
def new_derivatives() -> Derivatives:
    """Allocate."""
    e = np.empty
    return Derivatives(
        e(10), e(4), e((4, 4)), e((4, 5)), e((4, 10)), e((2, 10)), e((2, 4)), e((7, 5)), e((7, 5)), e((7, 5)),
        e((7, 10)), e((7, 5)), e((5, 5)), e((5, 5)), e((6, 4)), e(7),
    )  # fmt: skip


@nested
def third_derivative(gait: GaitTable, theta: float, h3: Array) -> None:
    """d3h_d/dtheta3, (4,)."""
    s = (theta - gait.theta_start) / gait.theta_span
    inside = gait.s_first <= s <= gait.s_last
    degree = gait.poly.shape[1] - 1 if inside else 0
    for i in range(4):
        v = 0.0
        for k in range(degree, 2, -1):
            v = v * s + k * (k - 1) * (k - 2) * gait.poly[i, k]
        h3[i] = v / gait.theta_span**3


@nested
def by_links(walker: Walker, stage: kernels.Stage, P: Array, R: Array, D: Array) -> None:
    """Derivatives of link torques tau_i = sum_j A_ij (cos_ij ddphi_j + sin_ij dphi_j^2) - g b_i sin phi_i and force."""
    for i in range(5):
        own = -walker.gravity * walker.b[i] * stage.cos[i]
        if walker.extended:
            own -= walker.gravity * walker.b_across[i] * stage.sin[i]
        for k in range(5):
            a = walker.A[i, k]
            cosine = a * (stage.cos[i] * stage.cos[k] + stage.sin[i] * stage.sin[k])
            sine = a * (stage.sin[i] * stage.cos[k] - stage.cos[i] * stage.sin[k])
            rotor = 0.0
            if walker.extended:
                across = walker.A_across[i, k]
                cosine += across * (stage.sin[i] * stage.cos[k] - stage.cos[i] * stage.sin[k])
                sine -= across * (stage.cos[i] * stage.cos[k] + stage.sin[i] * stage.sin[k])
                rotor = walker.rotor[i, k]
            D[i, k] = cosine + rotor
            R[i, k] = 2.0 * sine * stage.dphi[k]
            P[i, k] = 0.0
            if k != i:
                P[i, k] = sine * stage.ddphi[k] - cosine * stage.dphi[k] * stage.dphi[k]
                own -= P[i, k]
        P[i, i] = own
    for i in range(5):
        b, sine, cosine = walker.b[i], stage.sin[i], stage.cos[i]
        square = stage.dphi[i] * stage.dphi[i]
        P[5, i] = b * (cosine * square + sine * stage.ddphi[i])
        P[6, i] = b * (sine * square - cosine * stage.ddphi[i])
        R[5, i] = 2.0 * b * sine * stage.dphi[i]
        R[6, i] = -2.0 * b * cosine * stage.dphi[i]
        D[5, i] = -b * cosine
        D[6, i] = -b * sine
        if walker.extended:
            b = walker.b_across[i]
            P[5, i] += b * (sine * square - cosine * stage.ddphi[i])
            P[6, i] -= b * (cosine * square + sine * stage.ddphi[i])
            R[5, i] -= 2.0 * b * cosine * stage.dphi[i]
            R[6, i] -= 2.0 * b * sine * stage.dphi[i]
            D[5, i] -= b * sine
            D[6, i] += b * cosine


@nested
def derive(loop: Loop, theta: float, dtheta: float, u_mpc: Array, stage: kernels.Stage, out: Derivatives) -> None:
    """All derivatives at the stage's state under ZD+PD and a held u_mpc (4,), after `motion.accelerate`."""
    walker, gait, gains = loop
    P, R, D, by_z = out.P, out.R, out.D, out.by_z
    Jh1, Jh2, Jacc, Dj = out.links[0], out.links[1], out.links[2], out.sums
    h3, rate, acceleration = out.outputs[0], out.outputs[1], out.outputs[2]
    PJ, RJ, DJ = out.outputs[3], out.outputs[4], out.outputs[5]
    third_derivative(gait, theta, h3)
    ddtheta = clock_of(gait, stage.ddq)
    inverse = 1.0 / gait.clock[4]
    torso1, torso2, torso3 = inverse, 0.0, 0.0
    for k in range(4):
        rate[k] = stage.h2[k] * dtheta
        acceleration[k] = h3[k] * dtheta * dtheta + stage.h2[k] * ddtheta
        torso1 -= gait.clock[k] * inverse * stage.h1[k]
        torso2 -= gait.clock[k] * inverse * rate[k]
        torso3 -= gait.clock[k] * inverse * acceleration[k]
    spread(stage.h1, torso1, Jh1)  # j = dphi/dtheta
    spread(rate, torso2, Jh2)  # dj/dt
    spread(acceleration, torso3, Jacc)  # dddphi/dtheta at a given ddtheta
    by_links(walker, stage, P, R, D)
    for i in range(7):
        times_J(gait, P[i], PJ)
        times_J(gait, R[i], RJ)
        times_J(gait, D[i], DJ)
        for k in range(4):
            by_z[i, Y + k] = PJ[k] - DJ[k] * gains.kp[k]
            by_z[i, DY + k] = RJ[k] - DJ[k] * gains.kd[k]
        by_theta, by_dtheta, total = 0.0, 0.0, 0.0
        for k in range(5):
            by_theta += P[i, k] * Jh1[k] + R[i, k] * Jh2[k] + D[i, k] * Jacc[k]
            by_dtheta += R[i, k] * Jh1[k] + 2.0 * D[i, k] * Jh2[k]
            total += D[i, k] * Jh1[k]
        by_z[i, THETA] = by_theta
        by_z[i, DTHETA] = by_dtheta
        Dj[i] = total
    # No torque enters the sum of the link equations: it gives ddtheta.
    denominator = Dj[0] + Dj[1] + Dj[2] + Dj[3] + Dj[4]
    for m in range(N_Z):
        clock = -(by_z[0, m] + by_z[1, m] + by_z[2, m] + by_z[3, m] + by_z[4, m]) / denominator
        out.clock[m] = clock
        for i in range(7):
            by_z[i, m] += Dj[i] * clock
        out.torque[0, m] = by_z[0, m] + by_z[2, m]
        out.torque[1, m] = by_z[1, m] + by_z[3, m]
        out.torque[2, m] = by_z[2, m]
        out.torque[3, m] = by_z[3, m]
        out.force[0, m] = by_z[5, m]
        out.force[1, m] = by_z[6, m]
    for i in range(4):
        out.torque[i, DY + i] += walker.damping[i]
        out.torque[i, THETA] += walker.damping[i] * rate[i]
        out.torque[i, DTHETA] += walker.damping[i] * stage.h1[i]
        if walker.resists:
            per_rate, per_angle = kernels.resistance_slopes(walker, i, stage.dy[i] + stage.h1[i] * dtheta)
            out.torque[i, Y + i] += per_angle
            out.torque[i, DY + i] += per_rate
            out.torque[i, THETA] += per_rate * rate[i] + per_angle * stage.h1[i]
            out.torque[i, DTHETA] += per_rate * stage.h1[i]
    kernels.responses(stage)
    kernels.stance_force_per_torque(walker, stage, out.force_u)
    for k in range(4):
        clock = clock_of(gait, stage.BtDinv[k])
        out.clock_u[k] = clock
        for i in range(4):
            out.output_u[i, k] = stage.BtDinv[k, i] - stage.h1[i] * clock
    add_held_torque(walker, gait, u_mpc, Jh1, stage, out)


@nested
def spread(joints: Array, torso: float, links: Array) -> None:
    """Link angles (or rates) of joint angles (4,) and a torso angle."""
    links[0] = joints[0] + torso
    links[1] = joints[1] + torso
    links[2] = joints[0] + joints[2] + torso
    links[3] = joints[1] + joints[3] + torso
    links[4] = torso


@nested
def add_held_torque(
    walker: Walker, gait: GaitTable, u_mpc: Array, j: Array, stage: kernels.Stage, out: Derivatives
) -> None:
    """What the inertia's dependence on posture adds: D a = B u_mpc gives D a_z = -(D_phi phi_z) a."""
    a = out.links[3]  # acceleration by u_mpc
    clock_a = 0.0
    for i in range(5):
        a[i] = 0.0
        for k in range(4):
            a[i] += stage.link_BtDinv[k, i] * u_mpc[k]
    for k in range(4):
        clock_a += out.clock_u[k] * u_mpc[k]
    change = out.by_torque  # of -D a and of the force, per link angle
    for i in range(5):
        own = 0.0
        for k in range(5):
            sine = walker.A[i, k] * (stage.sin[i] * stage.cos[k] - stage.cos[i] * stage.sin[k])
            if walker.extended:
                sine -= walker.A_across[i, k] * (stage.cos[i] * stage.cos[k] + stage.sin[i] * stage.sin[k])
            change[i, k] = -sine * a[k]
            own -= change[i, k]
        change[i, i] += own
        change[5, i] = walker.b[i] * stage.sin[i] * a[i]
        change[6, i] = -walker.b[i] * stage.cos[i] * a[i]
        if walker.extended:
            change[5, i] -= walker.b_across[i] * stage.cos[i] * a[i]
            change[6, i] -= walker.b_across[i] * stage.sin[i] * a[i]
    by_z = out.by_z  # columns y, theta
    ddq = out.links[4]
    x = out.columns
    for i in range(7):
        times_J(gait, change[i], by_z[i])
        by_z[i, 4] = 0.0
        for k in range(5):
            by_z[i, 4] += change[i, k] * j[k]
    for i in range(5):
        for column in range(5):
            x[i, column] = by_z[i, column]
    cholesky5_solve_all(stage.L, x)
    for column in range(5):
        m = Y + column if column < 4 else THETA
        moved = out.links[3]
        for i in range(5):
            moved[i] = x[i, column]
        tangential, normal = by_z[5, column], by_z[6, column]
        for i in range(5):
            tangential -= walker.b[i] * stage.cos[i] * moved[i]
            normal -= walker.b[i] * stage.sin[i] * moved[i]
            if walker.extended:
                tangential -= walker.b_across[i] * stage.sin[i] * moved[i]
                normal += walker.b_across[i] * stage.cos[i] * moved[i]
        out.force[0, m] += tangential
        out.force[1, m] += normal
        kernels.from_links(moved, ddq)
        clock = clock_of(gait, ddq)
        out.clock[m] += clock
        for i in range(4):
            out.output_z[i, column] = ddq[i] - stage.h1[i] * clock
    for i in range(4):
        out.output_z[i, 4] -= stage.h2[i] * clock_a
