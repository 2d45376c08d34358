"""What the second cascade minimises: the true objective of a predicted motion, and its quadratic model about it."""

from typing import NamedTuple

import numpy as np

from controller.compiled import Array, compiled
from controller.ltv.horizon import LtvHorizon
from controller.ltv.orbit import Orbit, nominal_rate
from controller.ltv.problem import LtvProblem
from controller.records import Vector
from controller.settings import LtvSettings

N_E = 9  # errors of a stage: outputs, their rates, the clock's rate
TORQUE_ROWS, FORCE_ROWS = 8, 3  # both bounds of four torques; both sides of the friction cone and the normal force
ROWS = TORQUE_ROWS + FORCE_ROWS


class Cost(NamedTuple):
    """Diagonals and limits, ready for the compiled code.

    Attributes:
        error: Weight on each error of each stage, (N, 9).
        torque: On u_mpc^2 in [1/(N.m)^2].
        torque_penalty: On (torque beyond its limit)^2 in [1/(N.m)^2], in the quadratic model alone: a true motion keeps
            the limits.
        force_penalty: On (force beyond its limit)^2 in [1/N^2]; 0 leaves the rows out.
        limit: Torque limits in [N.m], (4,).
        mu: Friction coefficient counted on.
        normal_min: Least normal force in [N].
    """

    error: Array
    torque: float
    torque_penalty: float
    force_penalty: float
    limit: Array
    mu: float
    normal_min: float


def off_the_orbit(settings: LtvSettings, limit: Vector, contact: tuple[float, float] | None) -> Cost:
    """The cost where the clock's rate is far from the nominal orbit's.

    Args:
        settings: Weights.
        limit: Torque limits in [N.m], (4,).
        contact: Friction coefficient and least normal force in [N]; None leaves the contact rows out.
    """
    stage = [settings.output] * 4 + [settings.output_rate] * 4 + [settings.clock_rate]
    error = np.tile(stage, (settings.stages, 1))
    error[-1] *= settings.last
    mu, normal_min = contact or (0.0, 0.0)
    return Cost(
        error=error,
        torque=settings.torque,
        torque_penalty=settings.torque_penalty,
        force_penalty=settings.force_penalty if contact else 0.0,
        limit=np.array(limit, dtype=float),
        mu=float(mu),
        normal_min=float(normal_min),
    )


def new_problem(N: int) -> LtvProblem:
    """Room for N stages; rows that `model` does not fill never bind."""
    e = np.empty
    return LtvProblem(
        AB=e((N, 10, 14)), error=e((N, N_E)), weight=e((N, N_E)), slope=e(N), R=e(4), linear=e((N, 4)),
        rows_z=np.zeros((N, ROWS, 10)), rows_u=np.zeros((N, ROWS, 4)), limits=np.full((N, ROWS), 1e9),
        penalty=e(ROWS), lower=e(4), upper=e(4),
    )  # fmt: skip


@compiled
def excess(cost: Cost, force: Array, row: int) -> float:
    """How far a contact force (2,) is beyond a limit of it in [N]; negative within."""
    if row == 0:
        return force[0] - cost.mu * force[1]
    if row == 1:
        return -force[0] - cost.mu * force[1]
    return cost.normal_min - force[1]


@compiled
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
        if cost.force_penalty > 0.0:
            for row in range(FORCE_ROWS):
                beyond = max(0.0, excess(cost, h.force[k], row))
                total += cost.force_penalty * beyond * beyond
    return 0.5 * total


@compiled
def model(cost: Cost, orbit: Orbit, h: LtvHorizon, plan: Array, p: LtvProblem) -> None:
    """The problem in deviations from a linearised horizon and its plan."""
    N = plan.shape[0]
    for row in range(ROWS):
        p.penalty[row] = cost.torque_penalty if row < TORQUE_ROWS else cost.force_penalty
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
        if cost.force_penalty > 0.0:
            for m in range(10):
                t, n = h.force_z[k, 0, m], h.force_z[k, 1, m]
                p.rows_z[k, 8, m] = t - cost.mu * n
                p.rows_z[k, 9, m] = -t - cost.mu * n
                p.rows_z[k, 10, m] = -n
            for m in range(4):
                t, n = h.force_u[k, 0, m], h.force_u[k, 1, m]
                p.rows_u[k, 8, m] = t - cost.mu * n
                p.rows_u[k, 9, m] = -t - cost.mu * n
                p.rows_u[k, 10, m] = -n
            for row in range(FORCE_ROWS):
                p.limits[k, TORQUE_ROWS + row] = -excess(cost, h.force[k], row)
