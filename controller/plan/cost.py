"""What a planned motion costs: torque, limits of contact and posture, and how far each landing is from the gait's."""

from typing import NamedTuple

import numpy as np

from controller.belief import kernels
from controller.belief.friction import Friction, cone, excess
from controller.belief.kernels import Walker
from controller.common.compiled import Array, compiled
from controller.plan.dynamics import N_U, N_X, Rates, Terrain, place

ROWS = 9  # contact (3), clearance, knees (2), torso (2), hip
LANDING_ROWS = 14  # state (10), height, descent, length (2)

HEIGHT = 0.004  # [m] that the swing foot is too low; a violation of the size of each of these scales costs about 1/2
KNEE = 0.02  # [rad] that a knee keeps from being straight, and its scale
LEAN, LEAN_SCALE = 0.7, 0.1  # [rad] most lean of the torso
HIP, HIP_SCALE = 0.69, 0.02  # least height of the hip over the leg's length; [m]
DESCENT, DESCENT_SCALE = 0.2, 0.05  # [m/s] least with which a foot comes down
SHORTEST, LONGEST, LENGTH_SCALE = 0.125, 0.875, 0.02  # length of a step over the leg's; [m]


class Price(NamedTuple):
    """Weights, scales and limits.

    Attributes:
        torque: On u^2 of an interval in [1/(N.m)^2].
        angle: Distance of a landing posture from the nominal one that costs 1/2, in [rad].
        speed: The same for the links' rates in [rad/s].
        last: Factor on the last landing.
        height: Distance of a landing foot from the ground that costs 1/2, in [m].
        force: Violation of a contact limit that costs 1/2, in [N].
        clearance: Least height of the swing foot in mid-step in [m].
        limit: Torque limits in [N.m], (4,).
        friction: Contact-force limits.
        nominal: State before the gait's landing, (10,).
        time: Nominal step time in [s].
        spread: Distance from it that costs 1/2 in [s].
        shortest, longest: Step times allowed in [s].
    """

    torque: float
    angle: float
    speed: float
    last: float
    height: float
    force: float
    clearance: float
    limit: Array
    friction: Friction
    nominal: Array
    time: float
    spread: float
    shortest: float
    longest: float


@compiled
def foot(walker: Walker, terrain: Terrain, stage: kernels.Stage) -> tuple[float, float, float]:
    """Swing foot: ahead of the stance foot and above the ground in [m], and the tangent of the ground's slope there."""
    ahead, above = 0.0, 0.0
    for i in range(5):
        ahead -= walker.reach[i] * stage.sin[i]
        above += walker.reach[i] * stage.cos[i]
    above = above - terrain.tangent * ahead - terrain.level
    if terrain.rise == 0.0:
        return ahead, above, terrain.tangent
    height, slope = ledge(terrain, ahead)
    return ahead, above - height, terrain.tangent + slope


@compiled
def ledge(terrain: Terrain, ahead: float) -> tuple[float, float]:
    """What a ledge adds to the ground in [m] at a place ahead of the stance foot, and its slope; smooth before it."""
    part = min(max((ahead - terrain.edge) / terrain.ramp + 1.0, 0.0), 1.0)
    return terrain.rise * part * part * (3.0 - 2.0 * part), terrain.rise * 6.0 * part * (1.0 - part) / terrain.ramp


@compiled
def next_terrain(walker: Walker, terrain: Terrain, x: Array, stage: kernels.Stage) -> Terrain:
    """The ground as the step has it that begins with the landing at a state, (10,)."""
    if terrain.rise == 0.0:
        return terrain
    place(x, stage)
    ahead, _, _ = foot(walker, terrain, stage)
    height, _ = ledge(terrain, ahead)
    return Terrain(terrain.tangent, -height, terrain.edge - ahead, terrain.rise, terrain.ramp)


@compiled
def stage_rows(
    price: Price, walker: Walker, terrain: Terrain, x: Array, least: float, rates: Rates, stage: kernels.Stage,
    linearise: bool, r: Array, r_x: Array, r_u: Array,
) -> None:  # fmt: skip
    """Residuals of an interval's soft limits at its beginning, (9,), and where asked for their derivatives.

    Args:
        price: Scales.
        walker: Lumped constants.
        terrain: The ground of its step.
        x: State, (10,).
        least: Height the swing foot must have over the ground in [m].
        rates: Force, and its derivatives, at x.
        stage: Scratch.
        linearise: Whether to fill the derivatives.
        r: Filled: negative where a limit is kept.
        r_x: Filled, (9, 10).
        r_u: Filled, (9, 4).
    """
    place(x, stage)
    sine, cosine = terrain.tangent, 1.0 / np.sqrt(1.0 + terrain.tangent * terrain.tangent)
    sine *= cosine
    fx, fz = rates.force[0], rates.force[1]
    along = rates.column
    along[0], along[1] = cosine * fx + sine * fz, cosine * fz - sine * fx
    limited = 1.0 / price.force if price.friction.penalty > 0.0 else 0.0
    beyond = excess(price.friction, along)
    r[0], r[1], r[2] = limited * beyond[0], limited * beyond[1], limited * beyond[2]
    _, above, tangent = foot(walker, terrain, stage)
    r[3] = (least - above) / HEIGHT
    r[4] = (x[2] - x[0] + KNEE) / KNEE
    r[5] = (x[3] - x[1] + KNEE) / KNEE
    r[6] = (x[4] - LEAN) / LEAN_SCALE
    r[7] = (-x[4] - LEAN) / LEAN_SCALE
    reach = -walker.reach[0] - walker.reach[2]
    hip = walker.reach[0] * stage.cos[0] + walker.reach[2] * stage.cos[2]
    r[8] = (HIP * reach - hip) / HIP_SCALE
    if not linearise:
        return
    r_x[:] = 0.0
    r_u[:] = 0.0
    for m in range(N_X + N_U):
        if m < N_X:
            fx, fz = rates.force_x[0, m], rates.force_x[1, m]
        else:
            fx, fz = rates.force_u[0, m - N_X], rates.force_u[1, m - N_X]
        a, b, c = cone(price.friction, cosine * fx + sine * fz, cosine * fz - sine * fx)
        if m < N_X:
            r_x[0, m], r_x[1, m], r_x[2, m] = limited * a, limited * b, limited * c
        else:
            n = m - N_X
            r_u[0, n], r_u[1, n], r_u[2, n] = limited * a, limited * b, limited * c
    for i in range(5):
        r_x[3, i] = walker.reach[i] * (stage.sin[i] - tangent * stage.cos[i]) / HEIGHT
    r_x[4, 2], r_x[4, 0] = 1.0 / KNEE, -1.0 / KNEE
    r_x[5, 3], r_x[5, 1] = 1.0 / KNEE, -1.0 / KNEE
    r_x[6, 4] = 1.0 / LEAN_SCALE
    r_x[7, 4] = -1.0 / LEAN_SCALE
    r_x[8, 0] = walker.reach[0] * stage.sin[0] / HIP_SCALE
    r_x[8, 2] = walker.reach[2] * stage.sin[2] / HIP_SCALE


@compiled
def landing_rows(
    price: Price, walker: Walker, terrain: Terrain, x: Array, weight: float, stage: kernels.Stage, r: Array, r_x: Array
) -> None:
    """Residuals of a landing, (14,), at the state before it, with their derivatives (14, 10)."""
    r_x[:] = 0.0
    root = np.sqrt(weight)
    for i in range(5):
        r[i] = root * (x[i] - price.nominal[i]) / price.angle
        r[5 + i] = root * (x[5 + i] - price.nominal[5 + i]) / price.speed
        r_x[i, i] = root / price.angle
        r_x[5 + i, 5 + i] = root / price.speed
    place(x, stage)
    ahead, above, tangent = foot(walker, terrain, stage)
    reach = -walker.reach[0] - walker.reach[2]
    rate = 0.0
    for i in range(5):
        gradient = -walker.reach[i] * (stage.sin[i] - tangent * stage.cos[i])
        rate += gradient * x[5 + i]
        r_x[10, i] = gradient / price.height
        r_x[11, 5 + i] = gradient / DESCENT_SCALE
        r_x[11, i] = -walker.reach[i] * (stage.cos[i] + tangent * stage.sin[i]) * x[5 + i] / DESCENT_SCALE
        r_x[12, i] = walker.reach[i] * stage.cos[i] / LENGTH_SCALE
        r_x[13, i] = -walker.reach[i] * stage.cos[i] / LENGTH_SCALE
    r[10] = above / price.height
    r[11] = (rate + DESCENT) / DESCENT_SCALE
    r[12] = (SHORTEST * reach - ahead) / LENGTH_SCALE
    r[13] = (ahead - LONGEST * reach) / LENGTH_SCALE
    for i in range(11, LANDING_ROWS):
        if not r[i] > 0.0:
            r[i] = 0.0
            r_x[i] = 0.0
