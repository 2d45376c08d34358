"""A tick of C-MPC in compiled code: from a row of what was seen to a row of what was decided."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.belief import Friction, Loop
from controller.belief.kernels import N_Q, N_U
from controller.belief.stance import watch
from controller.cmpc.prediction import Horizon, roll_out, within_reason
from controller.cmpc.program import Weights, fill
from controller.common.clock import Clock, now
from controller.common.compiled import Array, compiled
from controller.common.entry import Bound, call
from controller.common.held import held
from controller.common.products import applied
from controller.common.records import Status
from controller.qp import StageQP
from controller.qp.riccati_solver import State, advance, good

NOTHING, FORESEEN, DIVERGED = range(3)
"""How far `tick` has come that ended without a decision."""


class Parts(NamedTuple):
    """All that a tick works on.

    Attributes:
        came_to: What `decide` is to go on from, (1,).
    """

    loop: Loop
    horizon: Horizon
    weights: Weights
    limit: Array
    friction: Friction
    problem: StageQP
    state: State
    came_to: NDArray[np.int64]


OPTIMAL = list(Status).index(Status.OPTIMAL)


@compiled
def foresee(parts: Any, memory: Any, seen: Any, i: int) -> bool:
    """Predict from row `i` of `seen` and build the problem; false where the prediction diverges."""
    p = held(parts)
    q, dq = np.empty(N_Q), np.empty(N_Q)
    watch(memory, p.loop.walker, seen[i], q, dq)
    roll_out(p.loop, q, dq, p.horizon)
    if not within_reason(p.horizon.x, p.horizon.force):
        return False
    fill(p.horizon, p.weights, p.limit, p.friction, p.problem)
    return True


@compiled
def settle(parts: Any, memory: Any, step: Any, i: int) -> bool:
    """Solve the problem and fill row `i` of `step`, but for the time it took; whether it has an answer."""
    p = held(parts)
    sweeps, checks = advance(p.problem, p.state)
    if not good(checks):
        return False
    m, out, horizon, u_mpc = memory[0], step[i], p.horizon, p.state.sweep.u[0]
    for j in range(N_U):
        joint = j ^ m.leg
        out.u_zd[joint], out.u_mpc[joint] = horizon.u[0, j], u_mpc[j]
        out.u_total[joint] = m.torque[joint] = horizon.u[0, j] + u_mpc[j]  # Eq. (23)
        out.y[j], out.dy[j] = horizon.y[0, j], horizon.dy[0, j]
    force = applied(horizon.force_per_torque[0], u_mpc)  # Eq. (20)
    out.contact_force[0], out.contact_force[1] = horizon.force[0, 0] + force[0], horizon.force[0, 1] + force[1]
    out.theta, out.dtheta = horizon.clock[0], horizon.clock[1]
    out.s = (horizon.clock[0] - p.loop.gait.theta_start) / p.loop.gait.theta_span
    out.impact_in = -1
    for k in range(horizon.exchange.shape[0]):
        if horizon.exchange[k]:
            out.impact_in = k + 1
            break
    out.residuals[0], out.residuals[1], out.residuals[2] = checks[0], checks[1], checks[2]
    out.slack, out.active, out.iterations = checks.slack, checks.active, sweeps
    out.followed = 0.0
    out.status, out.stance, out.fallback = OPTIMAL, m.leg, 0
    return True


class Halves(NamedTuple):
    """What `tick` works on: both kernels as values, which are compiled for Python, too, and need not be once more."""

    foresee: Bound
    settle: Bound
    came_to: NDArray[np.int64]
    clock: Clock


@compiled
def tick(halves: Any, seen: Any, step: Any, i: int) -> bool:
    """Fill row `i` of `step` from that of `seen`; false where there is no answer yet, `came_to` then says why."""
    p = held(halves)
    if not call(p.foresee.entry, p.foresee.arguments, (seen, i)):
        p.came_to[0] = DIVERGED
        step[i].solve_s = 0.0
        return False
    started = now(p.clock)
    answered: bool = call(p.settle.entry, p.settle.arguments, (step, i))
    step[i].solve_s = now(p.clock) - started
    if not answered:
        p.came_to[0] = FORESEEN
    return answered
