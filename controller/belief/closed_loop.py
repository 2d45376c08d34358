"""The closed loop in compiled arithmetic: a gait's outputs, and the ZD+PD law that drives them to zero."""

from typing import NamedTuple

import numpy as np

from controller.belief.kernels import (
    N_Q,
    N_U,
    Stage,
    Walker,
    link_inertia,
    new_stage,
    place,
    resistance,
    stance_force,
    to_links,
)
from controller.belief.polynomial import horner
from controller.common.compiled import Array, compiled, inlined


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


class Loop(NamedTuple):
    """What the closed loop consists of: a walker, the gait it follows, and the gains that hold it there."""

    walker: Walker
    gait: GaitTable
    gains: Gains


class ZeroDynamicsStep(NamedTuple):
    """The ZD+PD law at one state, stance order.

    Attributes:
        u: Torque of Eq. (7) in [N.m], (4,), not saturated.
        y: Outputs in [rad], (4,).
        dy: Output rates in [rad/s], (4,).
        theta: Clock in [rad].
        dtheta: Clock rate in [rad/s].
        ddq: Acceleration under u in [rad/s^2], (5,).
        contact_force: Stance force under u, (tangential, normal) in [N], (2,).
    """

    u: Array
    y: Array
    dy: Array
    theta: float
    dtheta: float
    ddq: Array
    contact_force: Array


@inlined
def clock_of(gait: GaitTable, q: Array) -> float:
    """The clock theta = c q in [rad], or its rate or acceleration."""
    theta = 0.0
    for i in range(N_Q):
        theta += gait.clock[i] * q[i]
    return theta


@inlined
def desired(gait: GaitTable, i: int, theta: float) -> tuple[float, float, float]:
    """h_d,i in [rad] and its first and second derivative in s; a tangent beyond the ends of the table."""
    s_unclamped = (theta - gait.theta_start) / gait.theta_span
    s = min(max(s_unclamped, gait.s_first), gait.s_last)
    h, h1, h2 = horner(gait.poly, i, s)
    if s != s_unclamped:
        h += h1 * (s_unclamped - s)
        h2 = 0.0
    return h, h1, h2


@inlined
def outputs(gait: GaitTable, q: Array, dq: Array, stage: Stage) -> tuple[float, float]:
    """Outputs y = h_0(q) - h_d(theta) and rates, Eq. (5); returns theta and its rate."""
    theta, dtheta = clock_of(gait, q), clock_of(gait, dq)
    for i in range(N_U):
        h, h1, h2 = desired(gait, i, theta)
        stage.h1[i] = h1 / gait.theta_span
        stage.h2[i] = h2 / (gait.theta_span * gait.theta_span)
        stage.y[i] = q[i] - h
        stage.dy[i] = dq[i] - stage.h1[i] * dtheta
    return theta, dtheta


@inlined
def closed_loop(loop: Loop, q: Array, dq: Array, stage: Stage) -> tuple[float, float]:
    """ZD+PD torque and the acceleration under it, Eqs. (5)-(9), after `place`; returns theta and its rate.

    The torque of Eq. (7) makes ddy = v. With one unactuated degree of freedom its 4 x 4 system reduces to a scalar
    one: ddq_a = v + h'' dtheta^2 + h' ddtheta for the actuated joints, and the equation of motion of the torso
    angle, which no torque enters, gives ddtheta. The other equations of motion then give the torque.
    """
    walker, gait, gains = loop
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


@compiled
def zero_dynamics(loop: Loop, q: Array, dq: Array) -> ZeroDynamicsStep:
    """The closed loop at one state."""
    stage = new_stage()
    force = np.empty(2)
    place(q, dq, stage)
    theta, dtheta = closed_loop(loop, q, dq, stage)
    stance_force(loop.walker, stage, force)
    return ZeroDynamicsStep(stage.u, stage.y, stage.dy, theta, dtheta, stage.ddq, force)
