"""What a plan and the feedback about it lead to, told when somebody looks: the log, and through it the review."""

from dataclasses import dataclass

import numpy as np

from controller.belief import kernels
from controller.belief.closed_loop import GaitTable, outputs
from controller.common.compiled import Array, compiled
from controller.common.records import Vector
from controller.plan.dynamics import N_U, N_X, World, advance, new_rates, strike
from controller.plan.motion import Motion
from controller.plan.planner import Followed, act

HORIZON = 0.5  # [s]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Forecast:
    """What the plan followed leads to, tick by tick.

    Attributes:
        followed: The plan, and how far it is.
        gait: Whose outputs are told.
        limit: Torque limits in [N.m], (4,).
        period: Of a tick in [s].
        x: State measured, (10,).
        horizon: Time looked ahead, or up to the plan's end, in [s].
    """

    followed: Followed
    gait: GaitTable
    limit: Array
    period: float
    x: Vector
    horizon: float = HORIZON

    def outputs(self) -> Vector:
        """Predicted outputs in [rad] at each tick, (ticks + 1, 4), stance order of its step."""
        return self._seen()[0]

    def contact_forces(self) -> Vector:
        """Predicted stance contact forces over each tick, (tangential, normal) in [N], (ticks, 2)."""
        return self._seen()[1]

    def _seen(self) -> tuple[Vector, Vector]:
        f, ticks = self.followed, round(self.horizon / self.period)
        y, force = np.empty((ticks + 1, N_U)), np.empty((ticks, 2))
        seen = look(
            f.world, self.gait, f.plan, f.K, self.limit, f.since, self.period, ticks, self.x.copy(),
            f.expected.copy(), y, force,
        )  # fmt: skip
        return y[: seen + 1], force[:seen]


@compiled
def look(
    world: World, gait: GaitTable, plan: Motion, K: Array, limit: Array, since: float, period: float, ticks: int,
    x: Array, expected: Array, y: Array, force: Array,
) -> int:  # fmt: skip
    """Follow a plan through its impacts, x and expected in place.

    Args:
        world: As the plan believes it.
        gait: Whose outputs are told.
        plan: The motion planned.
        K: Feedback about it, (N, 4, nz).
        limit: Torque limits in [N.m], (4,).
        since: The plan began in [s].
        period: Of a tick in [s].
        ticks: To look ahead.
        x: State, (10,).
        expected: By the plan now, (10,).
        y: Filled: outputs in [rad], (ticks + 1, 4), stance order of their step.
        force: Filled: stance force over each tick in [N], (ticks, 2).

    Returns:
        Ticks seen: fewer where the plan ends before.
    """
    P = plan.T.shape[0]
    per_step = (plan.u.shape[0] + 1) // P
    u, start, rest, stage = np.empty(N_U), new_rates(), new_rates(), kernels.new_stage()
    q, dq, J, struck = np.empty(5), np.empty(5), np.empty((N_X, N_X)), np.empty(N_X)
    step = 0
    for tick in range(ticks + 1):
        if since >= plan.T[step] - 1e-9:
            if step + 1 == P:
                return tick - 1
            strike(world.walker, x, stage, False, J, struck)
            x[:] = struck
            since -= plan.T[step]
            step += 1
            expected[:] = plan.x[step * per_step]
        kernels.from_links(x[:5], q)
        kernels.from_links(x[5:], dq)
        outputs(gait, q, dq, stage)
        y[tick] = stage.y
        if tick == ticks:
            break
        first = step * per_step
        act(
            world, Motion(plan.x[first:], plan.u[first:], plan.T[step:]), K[first:], limit, since, period, x,
            expected, u,
        )  # fmt: skip
        advance(world, u, period, stage, start, rest, x)
        force[tick] = start.force
        since += period
    return ticks
