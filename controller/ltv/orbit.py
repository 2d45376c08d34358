"""The nominal orbit: how fast the clock runs on the gait, which is the energy that the zero dynamics carry."""

import functools
from typing import NamedTuple

import numpy as np

from controller.belief import Gains, Gait, Loop, WalkerModel, kernels
from controller.belief.closed_loop import closed_loop
from controller.belief.ground import lands
from controller.common import polynomials
from controller.common.compiled import Array, compiled

STEPS = 60  # to settle on the periodic orbit
DT = 2e-4  # [s]
DEGREE = 8  # of the polynomial; it fits the paper's gait to 1e-4 rad/s


class Orbit(NamedTuple):
    """dtheta*(theta) as a polynomial of the normalised clock, continued linearly outside [0, 1].

    Attributes:
        poly: Coefficients, lowest power first, in [rad/s], (DEGREE + 1,).
        theta_start: As in the gait's table, in [rad].
        theta_span: As in the gait's table, in [rad].
    """

    poly: Array
    theta_start: float
    theta_span: float


@compiled
def nominal_rate(orbit: Orbit, theta: float) -> tuple[float, float]:
    """dtheta* in [rad/s] and its derivative in theta in [1/s]."""
    s = (theta - orbit.theta_start) / orbit.theta_span
    inside = min(max(s, 0.0), 1.0)
    value = 0.0
    slope = 0.0
    for k in range(orbit.poly.shape[0] - 1, -1, -1):
        slope = slope * inside + value
        value = value * inside + orbit.poly[k]
    return value + slope * (s - inside), slope / orbit.theta_span


@functools.lru_cache(maxsize=4)
def find_orbit(model: WalkerModel, gait: Gait) -> Orbit:
    """Let the walker settle on the gait under ZD+PD and rigid impacts, and fit the clock's rate.

    Found once for a model and a gait: a campaign builds thousands of controllers on the same two.

    Args:
        model: The walker believed in.
        gait: A gait that is stable on its zero dynamics.
    """
    gains = Gains(kp=np.full(4, 400.0), kd=np.full(4, 40.0))
    q, dq = gait.post_impact(model)
    for _ in range(STEPS):
        q, dq, samples = _step(Loop(model.lumped, gait.table, gains), q, dq)
    s = (samples[:, 0] - gait.table.theta_start) / gait.table.theta_span
    poly = polynomials.fit(s, samples[:, 1], DEGREE)
    return Orbit(poly=poly, theta_start=gait.table.theta_start, theta_span=gait.table.theta_span)


@compiled
def _step(loop: Loop, q: Array, dq: Array) -> tuple[Array, Array, Array]:
    """One step from after impact to after the next; the last part of the result is (theta, dtheta) along it."""
    stage = kernels.new_stage()
    limit = 20000
    samples = np.empty((limit, 2))
    q, dq = q.copy(), dq.copy()
    for k in range(limit):
        kernels.place(q, dq, stage)
        ahead, height, rate = kernels.swing_foot(loop.walker, stage)
        if k > 0 and lands(ahead, height, rate):
            kernels.impact(loop.walker, q, dq, stage)
            return q, dq, samples[:k]
        samples[k] = closed_loop(loop, q, dq, stage)
        for i in range(5):
            q[i] += DT * dq[i] + 0.5 * DT * DT * stage.ddq[i]
            dq[i] += DT * stage.ddq[i]
    return q, dq, samples
