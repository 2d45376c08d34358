"""The plan that is the gait itself: what every other plan starts from."""

import functools

import numpy as np

from controller.belief import Friction, Gains, Gait, Loop, WalkerModel, kernels
from controller.belief.closed_loop import GaitTable, closed_loop, outputs
from controller.belief.ground import lands
from controller.common.compiled import Array, compiled
from controller.common.records import Vector
from controller.common.settings import PlanSettings
from controller.plan.cost import Price
from controller.plan.dynamics import Terrain, World
from controller.plan.solve import Workspace, improve, new_workspace

DT = 5e-4  # [s]
ITERATIONS = 40
LONGEST = 3.0  # [s] of a gait's step


def links(q: Vector) -> Vector:
    """Link angles (or rates) of the paper's coordinates, (5,)."""
    phi = np.empty(5)
    kernels.to_links(q, phi)
    return phi


def world(model: WalkerModel) -> World:
    """The walker undisturbed on level ground."""
    lever = np.array([model.lumped.reach[0], 0.0, model.lumped.reach[2], 0.0, model.torso.com])
    return World(model.lumped, lever, 0.0, Terrain())


def price(model: WalkerModel, gait: Gait, settings: PlanSettings, friction: Friction, time: float) -> Price:
    """The cost that settings ask for, about a gait whose step takes some time in [s]."""
    return Price(
        torque=settings.torque,
        angle=settings.angle,
        speed=settings.speed,
        last=settings.last,
        height=settings.height,
        force=settings.force,
        clearance=settings.clearance,
        limit=np.array(model.torque_limits, dtype=float),
        friction=friction,
        nominal=np.concatenate([links(gait.q_minus), links(gait.dq_minus)]),
        time=time,
        spread=settings.spread,
        shortest=settings.shortest,
        longest=settings.longest,
    )


@compiled
def walk(loop: Loop, q: Array, dq: Array, most: int) -> tuple[Array, Array]:
    """States in link angles, (n + 1, 10), and torques, (n, 4), of a step under ZD+PD, every `DT`."""
    stage = kernels.new_stage()
    x, u = np.empty((most + 1, 10)), np.empty((most, 4))
    q, dq = q.copy(), dq.copy()
    n = 0
    for k in range(most + 1):
        kernels.place(q, dq, stage)
        for i in range(5):
            x[k, i] = stage.phi[i]
            x[k, 5 + i] = stage.dphi[i]
        n = k
        ahead, height, rate = kernels.swing_foot(loop.walker, stage)
        if k == most or (k > 0 and lands(ahead, height, rate)):
            break
        closed_loop(loop, q, dq, stage)
        u[k] = stage.u
        for i in range(5):
            q[i] += DT * dq[i] + 0.5 * DT * DT * stage.ddq[i]
            dq[i] += DT * stage.ddq[i]
    return x[: n + 1], u[:n]


@functools.lru_cache(maxsize=4)
def plan_of_gait(
    model: WalkerModel, gait: Gait, settings: PlanSettings, friction: Friction
) -> tuple[Price, Workspace]:  # fmt: skip
    """The cost about a gait, and the best plan from its first state on; not to be written to."""
    loop = Loop(model.lumped, gait.table, Gains(kp=np.full(4, 400.0), kd=np.full(4, 40.0)))
    q, dq = gait.post_impact(model)
    x, u = walk(loop, q, dq, int(LONGEST / DT))
    cost = price(model, gait, settings, friction, len(u) * DT)
    P, K = settings.steps, settings.intervals
    w = new_workspace(P, K)
    for p in range(P):
        w.plan.T[p] = cost.time
        for j in range(K + 1):
            w.plan.x[p * (K + 1) + j] = x[round(j / K * len(u))]
            if j < K:
                held = u[int(j / K * len(u)) : int((j + 1) / K * len(u))].mean(axis=0)
                w.plan.u[p * (K + 1) + j] = np.clip(held, -cost.limit, cost.limit)
    improve(cost, world(model), x[0], 0.0, ITERATIONS, w)
    return cost, w


@compiled
def on_the_clock(gait: GaitTable, q: Array, dq: Array) -> tuple[Array, float, float]:
    """Outputs in [rad], (4,), the clock's rate in [rad/s], and the clock in [rad]."""
    stage = kernels.new_stage()
    theta, dtheta = outputs(gait, q, dq, stage)
    return stage.y, dtheta, theta
