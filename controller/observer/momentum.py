"""A push and a load from the angular momentum about the stance foot, compiled.

Joint torques are internal forces and do not change the momentum sigma about the foot; gravity, a force on the torso
and a load on it do (forward positive):

    d(sigma)/dt = g sum_i m_i x_i + F z + m (g x - d/dt (z dx - x dz - k^2 dphi))

with the torso's centre of mass at (x, z) from the foot, phi its angle, k its radius of gyration, a horizontal force F
[N] there, and a load m [kg] that is spread as the torso's own mass is. So the observer needs no torque, and no friction
of a joint or error of a motor disturbs it. F and m are told apart by how they enter: z hardly changes in a step, while
what belongs to m changes its sign. A Kalman filter with the state (sigma, F, m) does that: F
walks fast, m slowly, and sigma is measured through the model's inertia. The momentum observer of the literature
(A. De Luca, R. Mattone, Proc. IEEE ICRA 2005, Eq. (12)) is the same filter with constant gains and F alone.
"""

from typing import Any, NamedTuple

import numpy as np

from controller.belief.kernels import N_Q, Stage, Walker, swing_foot
from controller.common.compiled import Array, compiled, inlined

MEMORY = np.dtype(
    [
        ("any", np.int64),  # whether there was a tick before
        ("leg", np.int64),  # that stood at it, 0 left, 1 right
        ("t", float),  # [s] of it
        ("until", float),  # [s] the end of an impact
        ("air", np.int64),  # ticks in a row without contact of the stance foot
        ("sigma", float),  # [kg m^2/s] momentum about the foot, load included
        ("push", float),  # [N] horizontal, forward, at the torso's centre of mass
        ("load", float),  # [kg] on the torso, spread as its own mass
        ("moment", float),  # [N.m] of push and load about the foot, forward
        ("slope", float),  # tangent of the ground's slope, uphill positive
        ("gravity_moment", float),  # [N.m] of the walker about the foot at the last tick
        ("height", float),  # [m] of the torso's centre of mass above the foot
        ("ahead", float),  # [m] it is ahead of the foot
        ("per_load", float),  # [m^2/s] momentum per kilogram of load
        ("P", float, (3, 3)),  # covariance of (sigma, push, load)
    ],
    align=True,
)
"""What an observer keeps from tick to tick, in one row, where compiled code finds it."""


class Body(NamedTuple):
    """A walker and where its torso is pushed.

    Attributes:
        walker: The walker believed in.
        lever: Of the torso's centre of mass: its height is sum lever_i cos(phi_i), in [m], (5,).
        across: Of it off the torso's axis in [m].
        gyration: Square of the torso's radius of gyration in [m^2].
    """

    walker: Walker
    lever: Array
    across: float
    gyration: float


class Tuning(NamedTuple):
    """Of the filter.

    Attributes:
        noise: Standard deviation of the momentum measured at a tick in [kg m^2/s].
        walk: Intensity of the push's random walk in [N^2/s].
        load_walk: Intensity of the load's random walk in [kg^2/s].
        load_doubt: Standard deviation of the load at the start in [kg]; 0 believes in none.
        slope_memory: Share of the old slope kept at a touch-down.
        impact_time: How long rates say nothing after a landing in [s].
    """

    noise: float
    walk: float
    load_walk: float
    load_doubt: float
    slope_memory: float
    impact_time: float


AIR = 3  # ticks in a row that a contact flag must be down to be believed


@inlined
def momentum(body: Body, stage: Stage) -> tuple[float, float, float, float, float]:
    """Of a placed walker, about its stance foot, forward.

    Returns:
        Angular momentum in [kg m^2/s]; moment of gravity in [N.m]; the torso's centre of mass, ahead and above, in
        [m]; angular momentum per kilogram of load in [m^2/s].
    """
    walker = body.walker
    sigma = gravity = x = z = dx = dz = 0.0
    for i in range(N_Q):
        s, c, rate = stage.sin[i], stage.cos[i], stage.dphi[i]
        gravity -= walker.b[i] * s
        x -= body.lever[i] * s
        z += body.lever[i] * c
        dx -= body.lever[i] * c * rate
        dz -= body.lever[i] * s * rate
        if walker.extended:
            gravity += walker.b_across[i] * c
        for j in range(N_Q):
            cosine = c * stage.cos[j] + s * stage.sin[j]
            sigma -= walker.A[i, j] * cosine * stage.dphi[j]
            if walker.extended:
                sine = s * stage.cos[j] - c * stage.sin[j]
                sigma -= walker.A_across[i, j] * sine * stage.dphi[j]
    s, c, rate = stage.sin[4], stage.cos[4], stage.dphi[4]
    x += body.across * c
    z += body.across * s
    dx -= body.across * s * rate
    dz += body.across * c * rate
    return sigma, walker.gravity * gravity, x, z, z * dx - x * dz - body.gyration * rate


@compiled
def forget(tuning: Tuning, memory: Any) -> None:
    """Nothing is known of push, load and slope."""
    m = memory[0]
    m.any, m.leg, m.t, m.sigma, m.push, m.load, m.moment, m.slope = 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    m.gravity_moment, m.height, m.ahead, m.per_load = 0.0, 0.0, 0.0, 0.0
    m.until, m.air = -np.inf, 0
    for i in range(3):
        for j in range(3):
            m.P[i, j] = 0.0


@compiled
def observe(body: Body, tuning: Tuning, memory: Any, stage: Stage, t: float, leg: int, stands: bool) -> None:
    """Take in a tick, after `place`; allocates nothing.

    Args:
        body: The walker.
        tuning: Of the filter.
        memory: What is known, (1,) of `MEMORY`; changed.
        stage: The walker's state, stance order.
        t: Time in [s].
        leg: That stands, 0 left, 1 right.
        stands: Whether the stance foot touches the ground. In the air, and while an impact lasts, the estimates stay.
    """
    m = memory[0]
    P, gravity = m.P, body.walker.gravity
    sigma, moment, x, z, per_load = momentum(body, stage)
    m.air = 0 if stands else m.air + 1
    exchanged = m.any != 0 and leg != m.leg
    if exchanged or m.air >= AIR:
        m.until = t + tuning.impact_time
    if exchanged and P[2, 2] == 0.0:  # what pushes from the first tick on is told from a load in the second step
        P[2, 2] = tuning.load_doubt * tuning.load_doubt
    if exchanged:  # the old stance foot is behind: the ground is the line between the feet
        behind, height, _ = swing_foot(body.walker, stage)
        if behind < -0.05:
            m.slope = tuning.slope_memory * m.slope + (1.0 - tuning.slope_memory) * height / behind
    if not m.any or exchanged or t < m.until:
        # About another foot, or through an impact: the momentum is what is measured now.
        m.sigma = sigma + m.load * per_load
        P[0, 0] = tuning.noise * tuning.noise + P[2, 2] * per_load * per_load
        P[0, 1] = P[1, 0] = P[1, 2] * per_load
        P[0, 2] = P[2, 0] = P[2, 2] * per_load
        m.per_load = per_load
    else:
        dt = t - m.t
        z_mean, x_mean = 0.5 * (z + m.height), 0.5 * gravity * (x + m.ahead)
        # Predict: (sigma, push, load) -> F (sigma, push, load) + gravity.
        f, g = dt * z_mean, dt * x_mean
        m.sigma += dt * 0.5 * (moment + m.gravity_moment) + f * m.push + g * m.load
        p01 = P[0, 1] + f * P[1, 1] + g * P[1, 2]
        p02 = P[0, 2] + f * P[1, 2] + g * P[2, 2]
        P[0, 0] += f * (P[0, 1] + p01) + g * (P[0, 2] + p02)
        P[0, 1], P[0, 2] = p01, p02
        P[1, 1] += dt * tuning.walk
        if P[2, 2] > 0.0:
            P[2, 2] += dt * tuning.load_walk
        # Correct: measured is sigma - per_load * load, that of the last tick: its noise has nothing to do with sigma's.
        per_load, m.per_load = m.per_load, per_load
        a0 = P[0, 0] - per_load * P[0, 2]
        a1 = P[0, 1] - per_load * P[1, 2]
        a2 = P[0, 2] - per_load * P[2, 2]
        spread = a0 - per_load * a2 + tuning.noise * tuning.noise
        error = (sigma - (m.sigma - per_load * m.load)) / spread
        m.sigma += a0 * error
        m.push += a1 * error
        m.load += a2 * error
        P[0, 0] -= a0 * a0 / spread
        P[0, 1] -= a0 * a1 / spread
        P[0, 2] -= a0 * a2 / spread
        P[1, 1] -= a1 * a1 / spread
        P[1, 2] -= a1 * a2 / spread
        P[2, 2] -= a2 * a2 / spread
        P[1, 0], P[2, 0], P[2, 1] = P[0, 1], P[0, 2], P[1, 2]
    m.any, m.leg, m.t = 1, leg, t
    m.gravity_moment, m.height, m.ahead = moment, z, x
    m.moment = m.push * z + m.load * gravity * x
