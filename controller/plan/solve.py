"""Sequential quadratic programming on a planned motion: Gauss-Newton steps, taken as far as a merit function falls.

The merit is the cost and, priced above their multipliers, the gaps between the stages (Nocedal and Wright, Numerical
Optimization, ch. 18): a plan is never replaced by one with more of it, so planning cannot diverge.
"""

from typing import NamedTuple

import numpy as np

from controller.common.compiled import Array, compiled
from controller.plan.cost import Price
from controller.plan.dynamics import N_U, N_X, World
from controller.plan.interior import Interior, new_interior, solve
from controller.plan.motion import Model, Motion, Room, assess, divide, model, new_model, new_motion, new_room

HALVINGS = 4
SWEEPS = 15  # of the interior-point method
STEEPER = 1.2  # than the multipliers: the price of a gap in the merit function
MOST = 0.15  # [s] change of a step time in one iteration


class Workspace(NamedTuple):
    """What the planner works on.

    Attributes:
        plan: The motion planned.
        K: Feedback about it, (N, 4, 10 + P).
        other: Another motion.
        model: Linear-quadratic model.
        room: Scratch.
        interior: Quadratic problem's room and answer.
        gaps: Scratch, (N, 10).
    """

    plan: Motion
    K: Array
    other: Motion
    model: Model
    room: Room
    interior: Interior
    gaps: Array


class Figures(NamedTuple):
    """What came of it.

    Attributes:
        found: Whether the motion is finite; look here first.
        before: Cost before the first iteration.
        after: Cost of the answer.
        gap: Sum of the gaps between its angles in [rad].
        share: Of the last step taken, 0 to 1.
        iterations: Taken.
    """

    found: bool
    before: float
    after: float
    gap: float
    share: float
    iterations: int


@compiled
def new_workspace(P: int, K: int) -> Workspace:
    """Room for P steps of K intervals."""
    N, n = P * (K + 1) - 1, N_X + P
    return Workspace(
        new_motion(P, K), np.zeros((N, N_U, n)), new_motion(P, K), new_model(P, K), new_room(), new_interior(N, n),
        np.zeros((N, N_X)),
    )  # fmt: skip


@compiled
def improve(price: Price, world: World, x0: Array, elapsed: float, limit: int, w: Workspace) -> Figures:
    """Iterate from the plan in the workspace.

    Args:
        price: Cost and limits.
        world: Walker, push and ground.
        x0: Where the motion begins, (10,).
        elapsed: Time since this step began in [s].
        limit: Iterations.
        w: Plan, and room.
    """
    N, P = w.plan.u.shape[0], w.plan.T.shape[0]
    K = (N + 1) // P - 1
    shortest, longest, dT = np.empty(P), np.empty(P), np.zeros(P)
    for p in range(P):
        gone = elapsed if p == 0 else 0.0
        shortest[p] = max(price.shortest - gone, 0.015)
        longest[p] = max(price.longest - gone, 0.015)
        w.plan.T[p] = min(max(w.plan.T[p], shortest[p]), longest[p])
    w.plan.x[0] = x0
    course = divide(price, P, K, w.plan.T, elapsed)
    cost, angles, rates = assess(price, world, course, w.plan, w.room, w.gaps)
    before, share, count = cost, 0.0, 0
    if not np.isfinite(cost + angles + rates):
        return Figures(False, before, cost, angles, share, count)
    while count < limit:
        count += 1
        model(price, world, course, w.plan, w.room, w.model)
        per_angle, per_rate, _ = solve(
            w.model, course.impact, price.limit, w.plan.u, w.plan.T, shortest, longest, MOST, SWEEPS, w.interior, dT
        )  # fmt: skip
        per_angle, per_rate = STEEPER * per_angle, STEEPER * per_rate
        merit = cost + per_angle * angles + per_rate * rates
        share, new, gain = 1.0, (cost, angles, rates), 0.0
        for _ in range(HALVINGS + 1):
            _step(w, share, dT)
            new = assess(price, world, course, w.other, w.room, w.gaps)
            gain = merit - new[0] - per_angle * new[1] - per_rate * new[2]
            if gain > 0.0:
                break
            share *= 0.5
        else:
            share = 0.0
            break
        w.plan.x[:] = w.other.x
        w.plan.u[:] = w.other.u
        w.plan.T[:] = w.other.T
        w.K[:] = w.interior.K
        cost, angles, rates = new
        if gain < 1e-6 * cost:
            break
    return Figures(True, before, cost, angles, share, count)


@compiled
def _step(w: Workspace, share: float, dT: Array) -> None:
    """The other motion: the plan and a share of the step found."""
    N, P = w.plan.u.shape[0], w.plan.T.shape[0]
    for p in range(P):
        w.other.T[p] = w.plan.T[p] + share * dT[p]
    for n in range(N + 1):
        for i in range(N_X):
            w.other.x[n, i] = w.plan.x[n, i] + share * w.interior.dz[n, i]
        if n < N:
            for i in range(N_U):
                w.other.u[n, i] = w.plan.u[n, i] + share * w.interior.du[n, i]
