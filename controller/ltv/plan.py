"""One real-time iteration: shift the plan, linearise about it, solve, and step no further than the true cost falls.

Re-linearising about the last plan alone diverges under large pushes. Here a Newton step is halved until the cost of the
true rollout falls, torques clipped as by the motors, and where it never does the nominal stays. The nominal is the
shifted plan; when that has disappointed (the last step was cut, the legs have been exchanged) it must beat having no
plan at all.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.belief.kernels import Gains, GaitTable, Walker
from controller.compiled import Array, compiled
from controller.ltv.cost import FORCE_ROWS, ROWS, Cost, excess, model, new_problem, objective
from controller.ltv.horizon import LtvHorizon, look_ahead, new_horizon
from controller.ltv.landing import Ground
from controller.ltv.orbit import Orbit
from controller.ltv.problem import LtvProblem, LtvState, new_state
from controller.ltv.sweep import solve

HALVINGS = 3
SWEEPS = 4  # a guess that four have not confirmed cycles as a rule, and the line search takes what there is


class Workspace(NamedTuple):
    """What one iteration works on.

    Attributes:
        plan: MPC torques in [N.m], (N, 4); kept from tick to tick.
        candidate: Another plan, (N, 4).
        nominal: Horizon under the plan.
        other: Horizon under the candidate.
        problem: Quadratic model about the nominal.
        state: Guess and answer of the sweeps.
        figures: Cost of the nominal, cost of the answer, share of the step taken, sweeps, and how far the contact force
            expected now is beyond its limits in [N], (5,).
    """

    plan: Array
    candidate: Array
    nominal: LtvHorizon
    other: LtvHorizon
    problem: LtvProblem
    state: LtvState
    figures: Array


def new_workspace(N: int) -> Workspace:
    """Room for N stages, without a plan."""
    return Workspace(
        np.zeros((N, 4)), np.zeros((N, 4)), new_horizon(N), new_horizon(N), new_problem(N), new_state(N, ROWS),
        np.zeros(5),
    )  # fmt: skip


@compiled
def shift(plan: Array, share: float) -> None:
    """Move the plan on by a share of a stage; what is beyond its end stays as it was."""
    for k in range(plan.shape[0] - 1):
        for i in range(4):
            plan[k, i] += share * (plan[k + 1, i] - plan[k, i])


@compiled
def drop_to_exchange(plan: Array, exchange: NDArray[np.bool_]) -> None:
    """The legs have been exchanged: what was planned for after that begins now."""
    N = plan.shape[0]
    first = 0
    while first < N and not exchange[first]:
        first += 1
    if first >= N - 1:
        plan[:] = 0.0
        return
    for k in range(N):
        for i in range(4):
            plan[k, i] = plan[min(k + first + 1, N - 1), i]


@compiled
def improve(
    walker: Walker, gait: GaitTable, gains: Gains, cost: Cost, orbit: Orbit, ground: Ground, h: float, substeps: int,
    q: Array, dq: Array, exchanged: bool, share_of_stage: float, w: Workspace,
) -> bool:  # fmt: skip
    """One iteration on w.plan, which is a tick old; returns whether a finite motion was found.

    Args:
        walker: Lumped constants.
        gait: Outputs.
        gains: ZD+PD gains.
        cost: What to minimise.
        orbit: The clock's nominal rate.
        ground: Where the swing foot lands.
        h: Length of a substep in [s].
        substeps: Of each stage.
        q: Measured coordinates in [rad], (5,).
        dq: Measured rates in [rad/s], (5,).
        exchanged: Whether the legs have been exchanged since the last tick.
        share_of_stage: A tick's share of a stage.
        w: Plan, and room.
    """
    N = w.plan.shape[0]
    shift(w.plan, share_of_stage)
    if exchanged:
        drop_to_exchange(w.plan, w.other.exchange)
    if exchanged or w.figures[2] < 1.0:  # is the old plan any good?
        w.candidate[:] = 0.0
        look_ahead(walker, gait, gains, cost.limit, ground, h, substeps, q, dq, w.candidate, False, w.other)
        without = objective(cost, orbit, w.other, w.candidate)
        look_ahead(walker, gait, gains, cost.limit, ground, h, substeps, q, dq, w.plan, False, w.other)
        if not objective(cost, orbit, w.other, w.plan) <= without:
            w.plan[:] = w.candidate
    look_ahead(walker, gait, gains, cost.limit, ground, h, substeps, q, dq, w.plan, True, w.nominal)
    best = objective(cost, orbit, w.nominal, w.plan)
    w.figures[0] = best
    if not np.isfinite(best):
        w.figures[2] = 0.0
        return False
    model(cost, orbit, w.nominal, w.plan, w.problem)
    w.figures[3] = solve(w.problem, w.state, SWEEPS)
    share = 1.0
    for _ in range(HALVINGS + 1):
        for k in range(N):
            for i in range(4):
                w.candidate[k, i] = w.plan[k, i] + share * w.state.u[k, i]
        look_ahead(walker, gait, gains, cost.limit, ground, h, substeps, q, dq, w.candidate, False, w.other)
        now = objective(cost, orbit, w.other, w.candidate)
        if now < best:
            best = now
            w.plan[:] = w.candidate
            break
        share *= 0.5
    else:
        share = 0.0
        look_ahead(walker, gait, gains, cost.limit, ground, h, substeps, q, dq, w.plan, False, w.other)
    w.figures[1], w.figures[2] = best, share
    w.figures[4] = 0.0
    if cost.force_penalty > 0.0:
        for row in range(FORCE_ROWS):
            w.figures[4] = max(w.figures[4], excess(cost, w.other.force[0], row))
    return True
