"""What the second cascade minimises: the true objective of a predicted motion, and its quadratic model about it."""

from typing import NamedTuple

import numpy as np

from controller.belief.friction import ROWS as FORCE_ROWS
from controller.belief.friction import UNLIMITED, Friction, cone, excess
from controller.common.compiled import Array, nested
from controller.common.records import Vector
from controller.common.settings import LtvSettings
from controller.ltv.horizon import LtvHorizon
from controller.ltv.orbit import Orbit, nominal_rate
from controller.ltv.problem import LtvProblem

N_E = 9  # errors of a stage: outputs, their rates, the clock's rate
TORQUE_ROWS = 8  # both bounds of four torques
ROWS = TORQUE_ROWS + FORCE_ROWS


class Cost(NamedTuple):
    """Diagonals and limits, ready for the compiled code.

    Attributes:
        error: Weight on each error of each stage, (N, 9).
        torque: On u_mpc^2 in [1/(N.m)^2].
        torque_penalty: On (torque beyond its limit)^2 in [1/(N.m)^2], in the quadratic model alone: a true motion keeps
            the limits.
        limit: Torque limits in [N.m], (4,).
        friction: Contact-force limits; a penalty of 0 leaves their rows out.
    """

    error: Array
    torque: float
    torque_penalty: float
    limit: Array
    friction: Friction


def off_the_orbit(settings: LtvSettings, limit: Vector, friction: Friction | None) -> Cost:
    """The cost where the clock's rate is far from the nominal orbit's.

    Args:
        settings: Weights.
        limit: Torque limits in [N.m], (4,).
        friction: Contact-force limits; None leaves their rows out.
    """
    stage = [settings.output] * 4 + [settings.output_rate] * 4 + [settings.clock_rate]
    error = np.tile(stage, (settings.stages, 1))
    error[-1] *= settings.last
    return Cost(
        error=error,
        torque=settings.torque,
        torque_penalty=settings.torque_penalty,
        limit=np.array(limit, dtype=float),
        friction=friction or UNLIMITED,
    )


def new_problem(N: int) -> LtvProblem:
    """Room for N stages; rows that `model` does not fill never bind."""
    e = np.empty
    return LtvProblem(
        AB=e((N, 10, 14)), error=e((N, N_E)), weight=e((N, N_E)), slope=e(N), R=e(4), linear=e((N, 4)),
        rows_z=np.zeros((N, ROWS, 10)), rows_u=np.zeros((N, ROWS, 4)), limits=np.full((N, ROWS), 1e9),
        penalty=e(ROWS), lower=e(4), upper=e(4),
    )  # fmt: skip


@nested
def objective(cost: Cost, orbit: Orbit, h: LtvHorizon, plan: Array) -> float:
    """True cost of a predicted motion under a plan (N, 4) that keeps the torque limits."""
    N = plan.shape[0]
    total = 0.0
    for k in range(N):
        z = h.z[k + 1]
        rate, _ = nominal_rate(orbit, z[8])
        for i in range(8):
            total += cost.error[k, i] * z[i] * z[i]
        total += cost.error[k, 8] * (z[9] - rate) ** 2
        for i in range(4):
            total += cost.torque * plan[k, i] * plan[k, i]
        if cost.friction.penalty > 0.0:
            for beyond in excess(cost.friction, h.force[k]):
                softening = max(0.0, beyond)
                total += cost.friction.penalty * softening * softening
    return 0.5 * total


@nested
def model(cost: Cost, orbit: Orbit, h: LtvHorizon, plan: Array, p: LtvProblem) -> None:
    """The problem in deviations from a linearised horizon and its plan."""
    N, friction = plan.shape[0], cost.friction
    for row in range(ROWS):
        p.penalty[row] = cost.torque_penalty if row < TORQUE_ROWS else friction.penalty
    for i in range(4):
        p.R[i] = cost.torque
        p.lower[i] = -cost.limit[i] - h.u[0, i] - plan[0, i]
        p.upper[i] = cost.limit[i] - h.u[0, i] - plan[0, i]
    p.AB[:] = h.AB
    p.weight[:] = cost.error
    for k in range(N):
        z = h.z[k + 1]
        rate, slope = nominal_rate(orbit, z[8])
        for i in range(8):
            p.error[k, i] = z[i]
        p.error[k, 8] = z[9] - rate
        p.slope[k] = slope
        for i in range(4):
            p.linear[k, i] = cost.torque * plan[k, i]
        if k > 0:
            for i in range(4):
                for m in range(10):
                    p.rows_z[k, i, m] = h.u_z[k, i, m]
                    p.rows_z[k, 4 + i, m] = -h.u_z[k, i, m]
                p.rows_u[k, i, i] = 1.0
                p.rows_u[k, 4 + i, i] = -1.0
                p.limits[k, i] = cost.limit[i] - h.u[k, i] - plan[k, i]
                p.limits[k, 4 + i] = cost.limit[i] + h.u[k, i] + plan[k, i]
        if friction.penalty > 0.0:
            for m in range(10):
                by_z = cone(friction, h.force_z[k, 0, m], h.force_z[k, 1, m])
                p.rows_z[k, 8, m], p.rows_z[k, 9, m], p.rows_z[k, 10, m] = by_z
            for m in range(4):
                by_u = cone(friction, h.force_u[k, 0, m], h.force_u[k, 1, m])
                p.rows_u[k, 8, m], p.rows_u[k, 9, m], p.rows_u[k, 10, m] = by_u
            beyond = excess(friction, h.force[k])
            p.limits[k, 8], p.limits[k, 9], p.limits[k, 10] = -beyond[0], -beyond[1], -beyond[2]
