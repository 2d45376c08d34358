"""The sweep solves its problem: optimality of random problems, the hard box, the quadratic model against true costs."""

import numpy as np
import pytest

from controller.belief import Friction
from controller.belief.ground import LEVEL
from controller.common.settings import LtvSettings
from controller.ltv.cost import ROWS, new_problem, objective, off_the_orbit
from controller.ltv.cost import model as quadratic
from controller.ltv.horizon import Outlook, look_ahead, new_horizon
from controller.ltv.orbit import find_orbit
from controller.ltv.problem import N_Z, new_state, residuals
from controller.ltv.sweep import solve
from controller.qp.bounds import AT_LOWER, AT_UPPER, FREE

N = 8


@pytest.fixture
def weights():
    return LtvSettings(
        stages=24, output=1e5, output_calm=1e6, calm=0.02, output_rate=1e3, clock_rate=3e4, torque=1.0, last=10.0,
        torque_penalty=1e3,
    )  # fmt: skip


def test_outputs_weigh_more_near_the_orbit(weights):
    assert weights.output_at(0.0) == 1e6 and weights.output_at(0.02) == pytest.approx(5.5e5)
    assert weights.output_at(1e200) == 1e5
    steps = [weights.output_at(off) for off in np.linspace(0.0, 0.5, 50)]
    assert (np.diff(steps) < 0.0).all()


def random_problem(seed, box=1e9, bind=True):
    rng = np.random.default_rng(seed)
    p = new_problem(N)
    p.AB[:, :, :N_Z] = np.eye(N_Z) + 0.1 * rng.normal(size=(N, N_Z, N_Z))
    p.AB[:, :, N_Z:] = 0.1 * rng.normal(size=(N, N_Z, 4))
    p.error[:], p.weight[:] = rng.normal(size=(N, 9)), rng.uniform(1.0, 100.0, (N, 9))
    p.slope[:], p.R[:], p.linear[:] = rng.normal(size=N), rng.uniform(0.1, 2.0, 4), rng.normal(size=(N, 4))
    p.rows_z[:], p.rows_u[:] = rng.normal(size=(N, ROWS, N_Z)), rng.normal(size=(N, ROWS, 4))
    p.limits[:] = rng.uniform(0.1, 1.0, (N, ROWS)) if bind else 1e9
    p.penalty[:] = 10.0
    p.lower[:], p.upper[:] = -box, box
    return p


def value_and_gradient(p, u):
    """Objective over all torques (N, 4), written down densely, and its gradient by the chain rule backwards."""
    z, total = [np.zeros(N_Z)], 0.0
    n = len(u)
    for k in range(n):
        z.append(p.AB[k, :, :N_Z] @ z[-1] + p.AB[k, :, N_Z:] @ u[k])
    E = [np.vstack([np.eye(8, N_Z), p.slope[k] * -np.eye(N_Z)[8] + np.eye(N_Z)[9]]) for k in range(n)]
    gradient, adjoint = np.empty_like(u), np.zeros(N_Z)
    for k in reversed(range(n)):
        e = p.error[k] + E[k] @ z[k + 1]
        beyond = np.maximum(0.0, p.rows_z[k] @ z[k] + p.rows_u[k] @ u[k] - p.limits[k])
        total += (e @ (p.weight[k] * e) + u[k] @ (p.R * u[k]) + p.penalty @ beyond**2) / 2 + p.linear[k] @ u[k]
        adjoint = adjoint + E[k].T @ (p.weight[k] * e)
        gradient[k] = p.AB[k, :, N_Z:].T @ adjoint + p.R * u[k] + p.linear[k]
        gradient[k] += p.rows_u[k].T @ (p.penalty * beyond)
        adjoint = p.AB[k, :, :N_Z].T @ adjoint + p.rows_z[k].T @ (p.penalty * beyond)
    return total, gradient


@pytest.mark.parametrize("seed", range(4))
def test_the_gradient_of_this_test_is_one(seed):
    rng = np.random.default_rng(seed)
    p, u, d = random_problem(seed), rng.normal(size=(N, 4)), rng.normal(size=(N, 4))
    slope = (value_and_gradient(p, u + 1e-6 * d)[0] - value_and_gradient(p, u - 1e-6 * d)[0]) / 2e-6
    assert slope == pytest.approx(np.sum(value_and_gradient(p, u)[1] * d), rel=1e-6)


@pytest.mark.parametrize("box", [1e9, 0.2], ids=["free", "boxed"])
@pytest.mark.parametrize("seed", range(6))
def test_the_answer_is_optimal(seed, box):
    p, s = random_problem(seed, box), new_state(N, ROWS)
    sweeps = solve(p, s, 40)
    assert sweeps > 0
    u = s.u.copy()
    _, gradient = value_and_gradient(p, u)
    free = s.fixed == FREE
    scale = np.abs(value_and_gradient(p, 0 * u)[1]).max()
    assert np.abs(gradient[1:]).max() < 1e-9 * scale and np.abs(gradient[0, free]).max(initial=0.0) < 1e-9 * scale
    assert (gradient[0, s.fixed == AT_UPPER] <= 1e-6).all() and (gradient[0, s.fixed == AT_LOWER] >= -1e-6).all()
    assert (u[0] >= p.lower).all() and (u[0] <= p.upper).all()
    assert s.exceeded.any()
    assert (np.abs(residuals(p, s)) < 1e-9 * scale).all()
    if box < 1.0:
        assert not free.all()


def test_a_confirmed_guess_takes_one_sweep():
    p, s = random_problem(0), new_state(N, ROWS)
    assert solve(p, s, 40) > 1
    assert solve(p, s, 40) == 1


def test_the_problem_is_the_objectives_model(loop, model, gait, weights):
    """Slope of the true objective along any direction, softened force rows included."""
    stages, h, substeps, unlimited = weights.stages, 2.5e-3, 2, np.full(4, np.inf)
    rng = np.random.default_rng(1)
    plan = rng.normal(0.0, 30.0, (stages, 4))
    q, dq = gait.post_impact(model)
    q, dq = q + 0.03, dq + 0.3
    cost = off_the_orbit(weights, np.full(4, 1e3), Friction(mu=0.3, normal_min=200.0, penalty=weights.force_penalty))
    orbit = find_orbit(model, gait)
    horizon, p = new_horizon(stages), new_problem(stages)

    def motion(plan, linearise):
        look_ahead(Outlook(loop, unlimited, LEVEL, h, substeps, q, dq), plan, linearise, horizon)
        return objective(cost, orbit, horizon, plan)

    motion(plan, True)
    quadratic(cost, orbit, horizon, plan, p)
    assert (p.limits[:, 8:] < 0.0).any()
    gradient = value_and_gradient(p, np.zeros((stages, 4)))[1]
    for _ in range(3):
        d = 1e-4 * rng.normal(size=plan.shape)
        slope = (motion(plan + d, False) - motion(plan - d, False)) / 2
        assert slope == pytest.approx(np.sum(gradient * d), rel=0.02)
