"""MPC on double integrators: exact predictions, the regulator away from the limits, the best plan at them."""

import numpy as np
import pytest
import qpsolvers
from scipy.linalg import expm, solve_discrete_are

from controller.common.settings import OutputMpcSettings
from controller.rivals.output_dynamics import output_dynamics
from controller.rivals.output_mpc import DoubleIntegrator, OutputMpc

OUTPUT, OUTPUT_RATE, T, PERIOD = 8100.0, 220.0, 5e-3, 1e-3
LIMIT, WIDE = np.array([40.0, 40.0, 15.0, 15.0]), np.full(4, 1e6)  # [N.m]


def law(N, limit=LIMIT):
    return OutputMpc(
        OutputMpcSettings(stages=N, stage_time=T, output=OUTPUT, output_rate=OUTPUT_RATE), limit=limit, period=PERIOD
    )


@pytest.fixture(scope="module")
def states(model, gait, walking_states):
    return [output_dynamics(model.lumped, gait.table, q, dq) for q, dq in walking_states(60, spread=0.05)]


def simulated(y, dy, v):
    """Output and rate after each stage, by the matrix exponential; y, dy (4,), v (N, 4) -> (N, 2, 4)."""
    step = expm(T * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]))
    found, now = [], np.stack([y, dy])
    for held in v:
        now = step[:2] @ np.vstack([now, held])
        found.append(now)
    return np.array(found)


def test_the_prediction_is_that_of_double_integrators():
    rng = np.random.default_rng(0)
    y, dy, v = rng.normal(size=4), rng.normal(size=4), rng.normal(size=(12, 4))
    at = DoubleIntegrator.over(12, T)
    predicted = at.free @ np.stack([y, dy]) + np.einsum("kin,nj->kij", at.forced, v)
    np.testing.assert_allclose(predicted, simulated(y, dy, v), rtol=1e-12, atol=1e-14)


def test_the_objective_is_the_sum_over_the_stages(states):
    """x'Px/2 + q'x is half the written-out cost, up to a constant."""
    N, rng = 6, np.random.default_rng(1)
    S = solve_discrete_are([[1, T], [0, 1]], [[T * T / 2], [T]], np.diag([OUTPUT, OUTPUT_RATE]), np.eye(1))

    def cost(dynamics, u):
        v = dynamics.drift + u @ dynamics.decoupling.T
        path = simulated(dynamics.y, dynamics.dy, v)
        running = OUTPUT * (path[:-1, 0] ** 2).sum() + OUTPUT_RATE * (path[:-1, 1] ** 2).sum() + (v**2).sum()
        return running + np.einsum("io,ij,jo->", path[-1], S, path[-1])

    for dynamics in states[:10]:
        problem = law(N).problem(dynamics)
        a, b = rng.uniform(-40, 40, (2, N, 4))
        value = [0.5 * x @ problem.P @ x + problem.q @ x for x in (a.ravel(), b.ravel())]
        assert value[0] - value[1] == pytest.approx(0.5 * (cost(dynamics, a) - cost(dynamics, b)), rel=1e-9)


@pytest.mark.parametrize("N", [1, 4, 15])
def test_within_the_limits_it_is_the_regulator(states, N):
    A, B = np.array([[1, T], [0, 1]]), np.array([[T * T / 2], [T]])
    S = solve_discrete_are(A, B, np.diag([OUTPUT, OUTPUT_RATE]), np.eye(1))
    K = np.linalg.solve(np.eye(1) + B.T @ S @ B, B.T @ S @ A)[0]
    one = law(N, WIDE)
    for dynamics in states:
        decision = one.decide(dynamics)
        assert decision.answer.active == 0
        assert decision.v == pytest.approx(-K[0] * dynamics.y - K[1] * dynamics.dy, rel=1e-7, abs=1e-6)


def test_at_the_limits_it_is_the_best_plan(states):
    """The same problem in v with the limits as rows, by an interior-point method."""
    N, saturated = 8, 0
    one = law(N)
    for dynamics in states[::4]:
        into_u = np.linalg.inv(dynamics.decoupling)
        rows, offset = np.kron(np.eye(N), into_u), np.tile(into_u @ dynamics.drift, N)
        bound = np.tile(LIMIT, N)
        in_v = qpsolvers.Problem(
            P=np.kron(one.quadratic, np.eye(4)),
            q=(one.linear @ np.stack([dynamics.y, dynamics.dy])).ravel(),
            G=np.vstack([rows, -rows]),
            h=np.concatenate([bound + offset, bound - offset]),
        )
        v = qpsolvers.solve_problem(in_v, "piqp", eps_abs=1e-9, eps_rel=1e-11).x[:4]
        decision = one.decide(dynamics)
        assert (np.abs(dynamics.torque(decision.v)) <= LIMIT + 1e-6).all()
        assert decision.v == pytest.approx(v, rel=1e-4, abs=1e-3)
        saturated += decision.answer.active > 0
    assert saturated > 5


def test_the_plan_is_told_tick_by_tick(states):
    N = 7
    for dynamics in states[:5]:
        decision = law(N).decide(dynamics)
        y, force = decision.plan.outputs(), decision.plan.contact_forces()
        ticks = round(N * T / PERIOD)
        assert y.shape == (ticks + 1, 4) and force.shape == (ticks, 2)
        v = dynamics.drift + decision.plan.u @ dynamics.decoupling.T
        np.testing.assert_allclose(y[:: round(T / PERIOD)][1:], simulated(dynamics.y, dynamics.dy, v)[:, 0], atol=1e-12)
        np.testing.assert_allclose(y[0], dynamics.y)
        np.testing.assert_allclose(force[0], dynamics.force + dynamics.force_per_torque @ dynamics.torque(decision.v))
