"""One real-time iteration: shift the plan, linearise about it, solve, and step no further than the true cost falls.

Re-linearising about the last plan alone diverges under large pushes. Here a Newton step is halved until the cost of the
true rollout falls, torques clipped as by the motors, and where it never does the nominal stays. The nominal is the
shifted plan; when that has disappointed (the last step was cut, the legs have been exchanged) it must beat having no
plan at all.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.belief.friction import excess
from controller.common.compiled import Array, compiled
from controller.ltv.cost import ROWS, Cost, model, new_problem, objective
from controller.ltv.horizon import LtvHorizon, Outlook, look_ahead, new_horizon
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
    """

    plan: Array
    candidate: Array
    nominal: LtvHorizon
    other: LtvHorizon
    problem: LtvProblem
    state: LtvState


class Figures(NamedTuple):
    """What came of one iteration.

    Attributes:
        found: Whether a finite motion was found; look here first.
        before: Cost of the nominal.
        after: Cost of the answer.
        share: Of the Newton step that was taken, 0 to 1.
        sweeps: Taken; negative if the last guess was not confirmed.
        excess: How far the contact force expected now is beyond its limits in [N].
    """

    found: bool
    before: float
    after: float
    share: float
    sweeps: int
    excess: float


def new_workspace(N: int) -> Workspace:
    """Room for N stages, without a plan."""
    return Workspace(
        np.zeros((N, 4)), np.zeros((N, 4)), new_horizon(N), new_horizon(N), new_problem(N), new_state(N, ROWS)
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
    outlook: Outlook, cost: Cost, orbit: Orbit, share_of_stage: float, exchanged: bool, doubtful: bool, w: Workspace
) -> Figures:
    """One iteration on w.plan, which is a tick old.

    Args:
        outlook: Measured state, closed loop and ground.
        cost: What to minimise.
        orbit: The clock's nominal rate.
        share_of_stage: A tick's share of a stage.
        exchanged: Whether the legs have been exchanged since the last tick.
        doubtful: Whether the plan must beat having none: the last step was cut.
        w: Plan, and room.
    """
    N = w.plan.shape[0]
    shift(w.plan, share_of_stage)
    if exchanged:
        drop_to_exchange(w.plan, w.other.exchange)
    if exchanged or doubtful:
        w.candidate[:] = 0.0
        look_ahead(outlook, w.candidate, False, w.other)
        without = objective(cost, orbit, w.other, w.candidate)
        look_ahead(outlook, w.plan, False, w.other)
        if not objective(cost, orbit, w.other, w.plan) <= without:
            w.plan[:] = w.candidate
    look_ahead(outlook, w.plan, True, w.nominal)
    before = objective(cost, orbit, w.nominal, w.plan)
    if not np.isfinite(before):
        return Figures(False, before, before, 0.0, 0, 0.0)
    model(cost, orbit, w.nominal, w.plan, w.problem)
    sweeps = solve(w.problem, w.state, SWEEPS)
    after, share = before, 1.0
    for _ in range(HALVINGS + 1):
        for k in range(N):
            for i in range(4):
                w.candidate[k, i] = w.plan[k, i] + share * w.state.u[k, i]
        look_ahead(outlook, w.candidate, False, w.other)
        after = objective(cost, orbit, w.other, w.candidate)
        if after < before:
            w.plan[:] = w.candidate
            break
        share *= 0.5
    else:
        after, share = before, 0.0
        look_ahead(outlook, w.plan, False, w.other)
    beyond = max(0.0, max(excess(cost.friction, w.other.force[0]))) if cost.friction.penalty > 0.0 else 0.0
    return Figures(True, before, after, share, sweeps, beyond)
