"""Compiled arithmetic of `orbit.py` and `poincare.py`: a gait on its zero dynamics, and one step of the full model."""

from typing import NamedTuple

import numpy as np

from controller.belief import kernels
from controller.belief.closed_loop import Gains, GaitTable, Loop, closed_loop, outputs
from controller.belief.ground import lands
from controller.belief.kernels import N_Q, N_U, Stage, Walker
from controller.belief.polynomial import horner
from controller.common.compiled import Array, compiled, nested


class Nodes(NamedTuple):
    """A walker along a gait at K values of the normalised clock s, columns as `orbit.Orbit` describes them."""

    q: Array  # (K, 5)
    slope: Array  # dq/dtheta, (K, 5)
    inertia: Array  # I(theta) of sigma = I dtheta/dt, (K,)
    gravity: Array  # moment of gravity about the stance foot, G_5, (K,)
    dtheta: Array  # (K,)
    dq: Array  # (K, 5)
    u: Array  # (K, 4)
    force: Array  # (K, 2)
    foot: Array  # swing foot x, z, dz/dt, (K, 3)


@compiled
def on_the_gait(gait: GaitTable, theta: float, q: Array, slope: Array) -> None:
    """Posture and dq/dtheta where the outputs are zero and the clock shows theta."""
    c = gait.clock
    s = (theta - gait.theta_start) / gait.theta_span
    value = theta
    rate = 1.0
    for i in range(N_U):
        h, h1, _ = horner(gait.poly, i, s)
        q[i] = h
        slope[i] = h1 / gait.theta_span
        value -= c[i] * h
        rate -= c[i] * slope[i]
    q[N_U] = value / c[N_U]
    slope[N_U] = rate / c[N_U]


@compiled
def shape(walker: Walker, gait: GaitTable, s: Array, stage: Stage, out: Nodes) -> None:
    """What needs no velocity: posture, dq/dtheta, I and G_5 of the zero dynamics."""
    rest = np.zeros(N_Q)
    for k in range(s.shape[0]):
        on_the_gait(gait, gait.theta_start + s[k] * gait.theta_span, out.q[k], out.slope[k])
        kernels.place(out.q[k], rest, stage)
        kernels.link_inertia(walker, stage)
        kernels.to_links(out.slope[k], stage.ddphi)
        inertia = 0.0
        gravity = 0.0
        for i in range(N_Q):
            gravity += stage.bias[i]
            for j in range(N_Q):
                inertia += stage.D[i, j] * stage.ddphi[j]
        out.inertia[k] = inertia
        out.gravity[k] = gravity


@compiled
def motion(walker: Walker, gait: GaitTable, dtheta: Array, stage: Stage, out: Nodes) -> None:
    """What the clock's rate adds: dq, torque and stance force on the zero dynamics, swing foot."""
    loop = Loop(walker, gait, Gains(np.zeros(N_U), np.zeros(N_U)))  # the outputs are zero, so no gain matters
    for k in range(dtheta.shape[0]):
        out.dtheta[k] = dtheta[k]
        for i in range(N_Q):
            out.dq[k, i] = out.slope[k, i] * dtheta[k]
        kernels.place(out.q[k], out.dq[k], stage)
        closed_loop(loop, out.q[k], out.dq[k], stage)
        kernels.stance_force(walker, stage, out.force[k])
        for i in range(N_U):
            out.u[k, i] = stage.u[i]
        x, z, dz = kernels.swing_foot(walker, stage)
        out.foot[k, 0] = x
        out.foot[k, 1] = z
        out.foot[k, 2] = dz


@compiled
def momentum(walker: Walker, stage: Stage, out: Array) -> None:
    """Linear momentum (x, z) of the pinned walker in [kg m/s], after `place`."""
    out[0] = 0.0
    out[1] = 0.0
    for i in range(N_Q):
        out[0] -= walker.b[i] * stage.cos[i] * stage.dphi[i]
        out[1] -= walker.b[i] * stage.sin[i] * stage.dphi[i]
        if walker.extended:
            out[0] -= walker.b_across[i] * stage.sin[i] * stage.dphi[i]
            out[1] += walker.b_across[i] * stage.cos[i] * stage.dphi[i]


@compiled
def strike(walker: Walker, q: Array, dq: Array, stage: Stage) -> tuple[Array, Array, Array, float]:
    """Rigid impact of a state: q+, dq+, impulse on the landing foot in [N.s], (2,), and lift-off rate in [m/s]."""
    q_plus, dq_plus = q.copy(), dq.copy()
    before, impulse = np.empty(2), np.empty(2)
    kernels.place(q_plus, dq_plus, stage)
    momentum(walker, stage, before)
    kernels.impact(walker, q_plus, dq_plus, stage)
    momentum(walker, stage, impulse)
    impulse -= before
    _, _, lift = kernels.swing_foot(walker, stage)
    return q_plus, dq_plus, impulse, lift


@compiled
def errors_after(walker: Walker, gait: GaitTable, dtheta: float, error: Array, stage: Stage) -> Array:
    """(y, dy) after an impact that happens with (y, dy) = error, both (8,), at a clock rate dtheta.

    The clock at the impact is where the swing foot meets the ground with those errors.
    """
    q, slope, dq, after = np.empty(N_Q), np.empty(N_Q), np.empty(N_Q), np.empty(2 * N_U)
    theta = gait.theta_start + gait.theta_span
    c = gait.clock
    for _ in range(8):
        on_the_gait(gait, theta, q, slope)
        for i in range(N_U):
            q[i] += error[i]
            q[N_U] -= c[i] * error[i] / c[N_U]
        kernels.place(q, slope, stage)
        _, height, per_theta = kernels.swing_foot(walker, stage)
        theta -= height / per_theta
        if abs(height) < 1e-14:
            break
    for i in range(N_Q):
        dq[i] = slope[i] * dtheta
    for i in range(N_U):
        dq[i] += error[N_U + i]
        dq[N_U] -= c[i] * error[N_U + i] / c[N_U]
    q_plus, dq_plus, _, _ = strike(walker, q, dq, stage)
    outputs(gait, q_plus, dq_plus, stage)
    after[:N_U] = stage.y
    after[N_U:] = stage.dy
    return after


@compiled
def impact_of_errors(walker: Walker, gait: GaitTable, dtheta: float) -> Array:
    """Central differences of `errors_after` about zero error, (8, 8)."""
    stage = kernels.new_stage()
    n = 2 * N_U
    found = np.empty((n, n))
    step = 1e-5
    for j in range(n):
        error = np.zeros(n)
        error[j] = step
        ahead = errors_after(walker, gait, dtheta, error, stage)
        error[j] = -step
        behind = errors_after(walker, gait, dtheta, error, stage)
        for i in range(n):
            found[i, j] = (ahead[i] - behind[i]) / (2.0 * step)
    return found


@compiled
def decay(gains: Gains, t: float) -> Array:
    """exp(A t) of ddy = -K_D dy - K_P y for (y, dy), t in [s], (8, 8)."""
    found = np.zeros((2 * N_U, 2 * N_U))
    for i in range(N_U):
        half = 0.5 * gains.kd[i]
        square = half * half - gains.kp[i]
        root = np.sqrt(abs(square))
        if root * t < 1e-6:
            even, odd = 1.0, t  # cosh and sinh / root near zero; critically damped
        elif square > 0.0:
            even, odd = np.cosh(root * t), np.sinh(root * t) / root
        else:
            even, odd = np.cos(root * t), np.sin(root * t) / root
        scale = np.exp(-half * t)
        found[i, i] = scale * (even + half * odd)
        found[i, N_U + i] = scale * odd
        found[N_U + i, i] = -scale * gains.kp[i] * odd
        found[N_U + i, N_U + i] = scale * (even - half * odd)
    return found


class Drive(NamedTuple):
    """What moves the full model.

    Attributes:
        loop: Closed loop under ZD+PD.
        u: Torque in [N.m], (4,), if it is held.
        held: Whether it is; else the law acts in continuous time.
        stage: Scratch.
        k: Scratch: slopes of a Runge-Kutta step, (4, 10).
    """

    loop: Loop
    u: Array
    held: bool
    stage: Stage
    k: Array


@nested
def _rate(drive: Drive, x: Array, dx: Array) -> None:
    """dx/dt of the full model."""
    q, dq = x[:N_Q], x[N_Q:]
    kernels.place(q, dq, drive.stage)
    if drive.held:
        kernels.accelerate(drive.loop.walker, dq, drive.u, drive.stage)
    else:
        closed_loop(drive.loop, q, dq, drive.stage)
    for i in range(N_Q):
        dx[i] = dq[i]
        dx[N_Q + i] = drive.stage.ddq[i]


@nested
def _advance(drive: Drive, x: Array, h: float, out: Array) -> None:
    """One step of the classical Runge-Kutta method of fourth order from x over h [s] into out."""
    k = drive.k
    _rate(drive, x, k[0])
    _rate(drive, x + 0.5 * h * k[0], k[1])
    _rate(drive, x + 0.5 * h * k[1], k[2])
    _rate(drive, x + h * k[2], k[3])
    for i in range(2 * N_Q):
        out[i] = x[i] + h / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])


class Step(NamedTuple):
    """One step of the full model.

    Attributes:
        x: State before the next impact, (10,); NaN if there was none.
        time: Step time in [s].
        peak: Largest torque asked for in [N.m], (4,).
        friction: Largest |F_T / F_N|.
    """

    x: Array
    time: float
    peak: Array
    friction: float


@compiled
def full_step(loop: Loop, limits: Array, x_minus: Array, h: float, substeps: int, time_limit: float) -> Step:
    """One step of the full closed loop: impact, then stance until the swing foot meets the ground ahead.

    Args:
        loop: Closed loop under ZD+PD.
        limits: Where the torque saturates in [N.m], (4,), stance order.
        x_minus: State before the impact, (10,).
        h: Integration step in [s].
        substeps: Integration steps for which a torque is held, counted from the impact; 0 for a law in
            continuous time, which does not saturate.
        time_limit: Give up after it, in [s].
    """
    walker, stage = loop.walker, kernels.new_stage()
    q, dq, _, _ = strike(walker, x_minus[:N_Q], x_minus[N_Q:], stage)
    x, nxt = np.empty(2 * N_Q), np.empty(2 * N_Q)
    x[:N_Q] = q
    x[N_Q:] = dq
    u, peak, force = np.zeros(N_U), np.zeros(N_U), np.empty(2)
    held = substeps > 0
    drive = Drive(loop, u, held, stage, np.empty((4, 2 * N_Q)))
    ratio = 0.0
    time = 0.0
    n = 0
    while time < time_limit:
        if not held or n % substeps == 0:
            kernels.place(x[:N_Q], x[N_Q:], stage)
            closed_loop(loop, x[:N_Q], x[N_Q:], stage)
            kernels.stance_force(walker, stage, force)
            ratio = max(ratio, abs(force[0]) / max(force[1], 1e-9))
            for i in range(N_U):
                peak[i] = max(peak[i], abs(stage.u[i]))
                u[i] = min(max(stage.u[i], -limits[i]), limits[i])
        _advance(drive, x, h, nxt)
        kernels.place(nxt[:N_Q], nxt[N_Q:], stage)
        ahead, height, rate = kernels.swing_foot(walker, stage)
        if not np.isfinite(height):
            break
        if lands(ahead, height, rate):
            # Where within this step the foot meets the ground: safeguarded secant on the length of the step.
            low, high = 0.0, h
            kernels.place(x[:N_Q], x[N_Q:], stage)
            _, z_low, _ = kernels.swing_foot(walker, stage)
            z_high = height
            for trial in range(60):
                part = low - z_low * (high - low) / (z_high - z_low) if trial % 3 != 2 else 0.5 * (low + high)
                if not low < part < high:
                    part = 0.5 * (low + high)
                _advance(drive, x, part, nxt)
                kernels.place(nxt[:N_Q], nxt[N_Q:], stage)
                _, z, _ = kernels.swing_foot(walker, stage)
                if abs(z) < 1e-14 or high - low < 1e-16:
                    break
                if z > 0.0:
                    low, z_low = part, z
                else:
                    high, z_high = part, z
            return Step(nxt, time + part, peak, ratio)
        for i in range(2 * N_Q):
            x[i] = nxt[i]
        time += h
        n += 1
    nxt[:] = np.nan
    return Step(nxt, time, peak, ratio)
