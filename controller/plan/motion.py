"""A planned motion: intervals of held torque over this step and the next ones, with an impact between two steps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.belief import kernels
from controller.belief.kernels import Walker
from controller.common.compiled import Array, compiled
from controller.plan.cost import LANDING_ROWS, ROWS, Price, landing_rows, next_terrain, stage_rows
from controller.plan.dynamics import (
    COLUMNS,
    N_U,
    N_X,
    Rates,
    Terrain,
    World,
    advance,
    advance_tangent,
    new_rates,
    strike,
)

EXACT = 3.0  # violation, in its scale, beyond which a soft limit costs in proportion
TIME_DAMPING = 20.0  # [1/s^2] of a change of a step time, where the cost does not care
LONGEST_SUBSTEP = 0.013  # [s]; the swing knee's damping has a time constant of 20 ms


class Motion(NamedTuple):
    """N stages: K intervals a step, and one stage for the impact between two steps.

    Attributes:
        x: State at the beginning of each stage and at the end, (N + 1, 10).
        u: Torque held over each stage in [N.m], (N, 4); not used by an impact.
        T: Time of each step, of the first one what is left, in [s], (P,).
    """

    x: Array
    u: Array
    T: Array


class Model(NamedTuple):
    """Linear-quadratic model of a motion in deviations of (x, T), nz = 10 + P.

    Attributes:
        A, B: Of each stage, (N, nz, nz), (N, nz, 4).
        gap: Where each stage ends less where the next one begins, (N, nz).
        H: Hessian of each stage's cost by (z, u), (N, nz + 4, nz + 4).
        g: Its gradient, (N, nz + 4).
        r, r_x, r_u: Residuals of each stage's soft limits, (N, 9), (N, 9, 10), (N, 9, 4).
        weight: Of their squares where they are exceeded, (N, 9).
        H_end, g_end: Of the end's cost, (nz, nz), (nz,).
    """

    A: Array
    B: Array
    gap: Array
    H: Array
    g: Array
    r: Array
    r_x: Array
    r_u: Array
    weight: Array
    H_end: Array
    g_end: Array


class Room(NamedTuple):
    """Scratch."""

    stage: kernels.Stage
    start: Rates
    rest: Rates
    S: Array
    J: Array
    r: Array
    r_x: Array
    r_u: Array
    l: Array  # noqa: E741
    l_x: Array


class Course(NamedTuple):
    """How a motion is divided.

    Attributes:
        phase: Step that each stage belongs to, (N,); an impact to the step it ends.
        impact: Whether it is an impact, (N,).
        least: Height the swing foot must have at the beginning of each stage in [m], (N,).
        intervals: Of each step.
        substeps: Of each interval of each step, (P,).
    """

    phase: NDArray[np.int64]
    impact: NDArray[np.bool_]
    least: Array
    intervals: int
    substeps: NDArray[np.int64]


@compiled
def new_room() -> Room:
    """Allocate."""
    z = np.zeros
    return Room(
        kernels.new_stage(), new_rates(), new_rates(), z((N_X, COLUMNS)), z((N_X, N_X)), z(ROWS), z((ROWS, N_X)),
        z((ROWS, N_U)), z(LANDING_ROWS), z((LANDING_ROWS, N_X)),
    )  # fmt: skip


@compiled
def new_motion(P: int, K: int) -> Motion:
    """Room for P steps of K intervals."""
    N = P * (K + 1) - 1
    return Motion(np.zeros((N + 1, N_X)), np.zeros((N, N_U)), np.zeros(P))


@compiled
def new_model(P: int, K: int) -> Model:
    """Room for the model of P steps of K intervals."""
    N, n = P * (K + 1) - 1, N_X + P
    z = np.zeros
    return Model(
        z((N, n, n)), z((N, n, N_U)), z((N, n)), z((N, n + N_U, n + N_U)), z((N, n + N_U)), z((N, ROWS)),
        z((N, ROWS, N_X)), z((N, ROWS, N_U)), z((N, ROWS)), z((n, n)), z(n),
    )  # fmt: skip


@compiled
def divide(price: Price, P: int, K: int, T: Array, elapsed: float) -> Course:
    """The stages of a motion, of whose first step some time has passed."""
    N = P * (K + 1) - 1
    phase, impact, least = np.zeros(N, dtype=np.int64), np.zeros(N, dtype=np.bool_), np.zeros(N)
    substeps = np.zeros(P, dtype=np.int64)
    for p in range(P):
        substeps[p] = max(1, int(np.ceil(T[p] / K / LONGEST_SUBSTEP)))
        before = elapsed if p == 0 else 0.0
        for j in range(K + 1):
            k = p * (K + 1) + j
            if k < N:
                phase[k] = p
                impact[k] = j == K
                share = (before + T[p] * j / K) / (before + T[p])
                least[k] = 4.0 * price.clearance * share * (1.0 - share)
    return Course(phase, impact, least, K, substeps)


@compiled
def soft(r: float) -> tuple[float, float]:
    """Cost of a violation and the weight of its square in a Gauss-Newton model: quadratic, then linear, so exact."""
    s = np.sqrt(1.0 + r * r / (EXACT * EXACT))
    return EXACT * EXACT * (s - 1.0), 1.0 / s


@compiled
def _end_cost(price: Price, walker: Walker, terrain: Terrain, x: Array, last: bool, room: Room) -> float:
    landing_rows(price, walker, terrain, x, price.last if last else 1.0, room.stage, room.l, room.l_x)
    total = 0.0
    for i in range(LANDING_ROWS):
        if i < N_X:
            total += 0.5 * room.l[i] * room.l[i]
        else:
            cost, weight = soft(room.l[i])
            total += cost
            root = np.sqrt(weight)
            room.l[i] *= root
            for m in range(N_X):
                room.l_x[i, m] *= root
    return total


@compiled
def assess(
    price: Price, world: World, course: Course, plan: Motion, room: Room, gaps: Array
) -> tuple[float, float, float]:  # fmt: skip
    """Cost of a motion, and its gaps: where each stage ends less where the next one begins, (N, 10).

    Returns:
        The cost, and the sums of the gaps' sizes in [rad] and in [rad/s].
    """
    N, P = plan.u.shape[0], plan.T.shape[0]
    walker, terrain = world.walker, world.terrain
    total, angles, rates = 0.0, 0.0, 0.0
    for p in range(1, P):
        off = (plan.T[p] - price.time) / price.spread
        total += 0.5 * off * off
    x = np.empty(N_X)
    for n in range(N):
        p = course.phase[n]
        x[:] = plan.x[n]
        if course.impact[n]:
            total += _end_cost(price, walker, terrain, x, False, room)
            strike(walker, plan.x[n], room.stage, False, room.J, x)
            terrain = next_terrain(walker, terrain, plan.x[n], room.stage)
        else:
            u = plan.u[n]
            for i in range(N_U):
                total += 0.5 * price.torque * u[i] * u[i]
            h = plan.T[p] / (course.intervals * course.substeps[p])
            for sub in range(course.substeps[p]):
                if sub == 0:
                    advance(world, u, h, room.stage, room.start, room.rest, x)
                    stage_rows(
                        price, walker, terrain, plan.x[n], course.least[n], room.start, room.stage, False, room.r,
                        room.r_x, room.r_u,
                    )  # fmt: skip
                    for i in range(ROWS):
                        if room.r[i] > 0.0:
                            total += soft(room.r[i])[0]
                else:
                    advance(world, u, h, room.stage, room.rest, room.rest, x)
        for i in range(N_X):
            gaps[n, i] = x[i] - plan.x[n + 1, i]
            if i < 5:
                angles += abs(gaps[n, i])
            else:
                rates += abs(gaps[n, i])
    total += _end_cost(price, walker, terrain, plan.x[N], True, room)
    return total, angles, rates


@compiled
def model(price: Price, world: World, course: Course, plan: Motion, room: Room, out: Model) -> None:
    """The linear-quadratic (Gauss-Newton) model about a motion."""
    N, P = plan.u.shape[0], plan.T.shape[0]
    n = N_X + P
    walker, terrain = world.walker, world.terrain
    out.A[:] = 0.0
    out.B[:] = 0.0
    out.gap[:] = 0.0
    out.weight[:] = 0.0
    out.r[:] = -1.0
    out.H[:] = 0.0
    out.g[:] = 0.0
    out.H_end[:] = 0.0
    out.g_end[:] = 0.0
    x = np.empty(N_X)
    for s in range(N):
        p = course.phase[s]
        A, B, H, g = out.A[s], out.B[s], out.H[s], out.g[s]
        for m in range(P):
            A[N_X + m, N_X + m] = 1.0
        if course.impact[s]:
            _end_cost(price, walker, terrain, plan.x[s], False, room)
            _square(room.l, room.l_x, H, g)
            strike(walker, plan.x[s], room.stage, True, room.J, x)
            terrain = next_terrain(walker, terrain, plan.x[s], room.stage)
            for i in range(N_X):
                out.gap[s, i] = x[i] - plan.x[s + 1, i]
                for m in range(N_X):
                    A[i, m] = room.J[i, m]
            for i in range(N_U):
                H[n + i, n + i] = 1.0
            continue
        per_time = 1.0 / (course.intervals * course.substeps[p])
        h = plan.T[p] * per_time
        S = room.S
        S[:] = 0.0
        for i in range(N_X):
            S[i, i] = 1.0
        x[:] = plan.x[s]
        for sub in range(course.substeps[p]):
            if sub == 0:
                advance_tangent(world, plan.u[s], h, per_time, room.stage, room.start, room.rest, x, S)
            else:
                advance_tangent(world, plan.u[s], h, per_time, room.stage, room.rest, room.rest, x, S)
        for i in range(N_X):
            out.gap[s, i] = x[i] - plan.x[s + 1, i]
            for m in range(N_X):
                A[i, m] = S[i, m]
            for m in range(N_U):
                B[i, m] = S[i, N_X + m]
            A[i, N_X + p] = S[i, N_X + N_U]
        r = out.r[s]
        stage_rows(
            price, walker, terrain, plan.x[s], course.least[s], room.start, room.stage, True, r, out.r_x[s], out.r_u[s]
        )  # fmt: skip
        for row in range(ROWS):
            out.weight[s, row] = soft(max(r[row], 0.0))[1]
        for i in range(N_U):
            H[n + i, n + i] += price.torque
            g[n + i] += price.torque * plan.u[s, i]
    _end_cost(price, walker, terrain, plan.x[N], True, room)
    _square(room.l, room.l_x, out.H_end, out.g_end)
    for p in range(1, P):
        out.H_end[N_X + p, N_X + p] += 1.0 / (price.spread * price.spread)
        out.g_end[N_X + p] += (plan.T[p] - price.time) / (price.spread * price.spread)
    for p in range(P):
        out.H_end[N_X + p, N_X + p] += TIME_DAMPING


@compiled
def _square(r: Array, r_x: Array, H: Array, g: Array) -> None:
    """Add the Gauss-Newton model of half the sum of squares."""
    for row in range(r.shape[0]):
        for i in range(N_X):
            a = r_x[row, i]
            if a != 0.0:
                g[i] += a * r[row]
                for m in range(N_X):
                    H[i, m] += a * r_x[row, m]
