"""The planner offline: its derivatives, its quadratic problem, and what it plans under a push."""

import dataclasses

import numpy as np
import pytest
import qpsolvers
from scipy.sparse import csc_matrix

from controller.belief import Friction
from controller.common.settings import PlanSettings
from controller.plan import dynamics, interior, motion, shift, solve, start
from controller.plan.cost import ROWS
from controller.plan.dynamics import N_U, N_X
from sim.bridge import run as bridge
from sim.scenario import Scenario

SETTINGS = PlanSettings()
FRICTION = Friction(mu=0.6, normal_min=20.0)


@pytest.fixture(scope="module")
def belief():
    return bridge.load_belief(Scenario())


@pytest.fixture(scope="module")
def gait(belief):
    """Cost about the gait and the plan that is it."""
    return start.plan_of_gait(belief.model, belief.gait, SETTINGS, FRICTION)


def copied(workspace):
    """A workspace of its own with the same plan."""
    P = len(workspace.plan.T)
    own = solve.new_workspace(P, (len(workspace.plan.u) + 1) // P - 1)
    for source, target in zip(workspace.plan, own.plan, strict=True):
        target[:] = source
    own.K[:] = workspace.K
    return own


def slopes(f, x, e=1e-6):
    return np.array([(f(x + e * d) - f(x - e * d)) / (2 * e) for d in np.eye(len(x))]).T


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_are_those_of_the_motion(belief, gait, seed):
    """By state, torque and time, and the force's and the impact's by the state, against central differences."""
    rng = np.random.default_rng(seed)
    world = start.world(belief.model)._replace(push=float(rng.normal(0, 40)), terrain=dynamics.Terrain(0.1))
    x = gait[0].nominal + rng.normal(0, 0.2, N_X)
    u, h = rng.normal(0, 20, N_U), 0.01
    room = motion.new_room()

    def after(v):
        out = v[:N_X].copy()
        dynamics.advance(world, v[N_X:-1].copy(), v[-1], room.stage, room.rest, room.rest, out)
        return out

    def force(v):
        dynamics.accelerate(world, v[:N_X].copy(), v[N_X:].copy(), room.stage, False, room.rest)
        return room.rest.force.copy()

    def struck(v):
        out = np.empty(N_X)
        dynamics.strike(world.walker, v, room.stage, False, room.J, out)
        return out

    S = np.eye(N_X, dynamics.COLUMNS)
    end = x.copy()
    dynamics.advance_tangent(world, u, h, 1.0, room.stage, room.start, room.rest, end, S)
    v = np.concatenate([x, u, [h]])
    np.testing.assert_allclose(end, after(v), rtol=0, atol=1e-12)
    np.testing.assert_allclose(S, slopes(after, v), rtol=0, atol=1e-6)
    by_state_and_torque = np.hstack([room.start.force_x, room.start.force_u])
    np.testing.assert_allclose(by_state_and_torque, slopes(force, v[:-1]), rtol=0, atol=1e-5)
    dynamics.strike(world.walker, x, room.stage, True, room.J, end)
    np.testing.assert_allclose(room.J, slopes(struck, x), rtol=0, atol=1e-6)


def random_problem(rng, P, K):
    """A quadratic model of stable stages with random rows, some of which are exceeded."""
    model = motion.new_model(P, K)
    N, n = model.A.shape[:2]
    impact = np.array([s % (K + 1) == K for s in range(N)])
    for s in range(N):
        model.A[s, :N_X] = 0.3 * rng.normal(size=(N_X, n))
        model.A[s, N_X:, N_X:] = np.eye(P)
        model.B[s, :N_X] = 0.0 if impact[s] else 0.3 * rng.normal(size=(N_X, N_U))
        model.gap[s, :N_X] = 0.1 * rng.normal(size=N_X)
        model.H[s, n:, n:] = np.eye(N_U) * (1.0 if impact[s] else 0.1)
        model.g[s, n:] = 0.0 if impact[s] else rng.normal(size=N_U)
    half = rng.normal(size=(n, n))
    model.H_end[:] = half @ half.T
    model.g_end[:] = 3.0 * rng.normal(size=n)
    model.r[:] = rng.normal(-0.5, 1.0, model.r.shape)
    model.r_x[:] = rng.normal(size=model.r_x.shape)
    model.r_u[:] = rng.normal(size=model.r_u.shape)
    model.weight[:] = rng.uniform(0.2, 1.0, model.weight.shape)
    return model, impact


def condensed(model, impact, limit, planned, bound):
    """The same as min 1/2 v'Hv + g'v, Gv <= h in v = (torques, times, violations)."""
    N, n = model.A.shape[:2]
    P, rows = n - N_X, ROWS * int((~impact).sum())
    size = N * N_U + P
    Z, z = np.zeros((n, size)), np.zeros(n)
    Z[N_X:, N * N_U :] = np.eye(P)
    H, g = np.zeros((size + rows, size + rows)), np.zeros(size + rows)
    G, h = [], []

    def add(M, m, J, c):
        H[:size, :size] += J.T @ M @ J
        g[:size] += J.T @ (M @ c + m)

    at = size
    for s in range(N):
        U = np.zeros((N_U, size))
        U[:, s * N_U : (s + 1) * N_U] = np.eye(N_U)
        add(model.H[s], model.g[s], np.vstack([Z, U]), np.concatenate([z, np.zeros(N_U)]))
        for row in range(0 if impact[s] else ROWS):
            line = np.zeros(size + rows)
            line[:size] = model.r_x[s, row] @ Z[:N_X] + model.r_u[s, row] @ U
            line[at] = -1.0
            G.append(line)
            h.append(-model.r[s, row] - model.r_x[s, row] @ z[:N_X])
            H[at, at] = model.weight[s, row]
            at += 1
        Z, z = model.A[s] @ Z + model.B[s] @ U, model.A[s] @ z + model.gap[s]
    add(model.H_end, model.g_end, Z, z)
    lower, upper = np.full(size + rows, -np.inf), np.full(size + rows, np.inf)
    for s in np.flatnonzero(~impact):
        lower[s * N_U : (s + 1) * N_U], upper[s * N_U : (s + 1) * N_U] = -limit - planned[s], limit - planned[s]
    lower[N * N_U : size], upper[N * N_U : size] = -bound, bound
    return H, g, np.array(G), np.array(h), lower, upper


@pytest.mark.parametrize("seed", range(4))
def test_the_quadratic_problem_is_solved(seed):
    """Against Clarabel on the condensed problem: torques at their limits, rows exceeded, step times decided."""
    rng = np.random.default_rng(seed)
    P, K, bound = 2, 3, 0.5
    model, impact = random_problem(rng, P, K)
    N, n = model.A.shape[:2]
    limit, planned = np.full(N_U, 1.0), rng.uniform(-0.5, 0.5, (N, N_U))
    w, dT = interior.new_interior(N, n), np.zeros(P)
    T = np.full(P, 1.0)
    _, _, sweeps = interior.solve(model, impact, limit, planned, T, T - bound, T + bound, bound, 40, w, dT)
    H, g, G, h, lower, upper = condensed(model, impact, limit, planned, bound)
    best = qpsolvers.solve_qp(csc_matrix(H), g, csc_matrix(G), h, lb=lower, ub=upper, solver="clarabel")
    assert best is not None and sweeps < 40
    size = N * N_U + P
    found = np.concatenate([w.du.ravel(), dT])
    violation = np.maximum(0.0, G[:, :size] @ found - h)

    def cost(v):
        return 0.5 * v @ H @ v + g @ v

    assert np.abs(planned + w.du)[~impact].max() <= 1.0 + 1e-12
    assert (np.abs(planned + w.du)[~impact] > 0.99).any() and (violation > 0.1).any()
    duality = interior.TOLERANCE * interior.ALL_ROWS * N
    assert cost(np.concatenate([found, violation])) == pytest.approx(cost(best), abs=2 * duality)


def test_a_push_is_stood_on_or_run_with(belief, gait):
    """Back: a longer time for a step that still lands; forward: a longer and quicker step. Torques stay legal."""
    price, nominal = gait
    reach = belief.model.lumped.reach
    K = SETTINGS.intervals
    length = -np.sin(nominal.plan.x[K, :5]) @ reach
    plans = {}
    for push in (-40.0, 60.0):
        w = copied(nominal)
        for force in np.linspace(0.0, push, 5)[1:]:
            world = start.world(belief.model)._replace(push=float(force))
            figures = solve.improve(price, world, nominal.plan.x[0], 0.0, 8, w)
        assert figures.found and figures.gap < 0.02
        assert (np.abs(w.plan.u) <= price.limit + 1e-9).all()
        assert abs(np.cos(w.plan.x[K, :5]) @ reach) < 0.01  # it lands on the ground
        plans[push] = w.plan
    assert plans[-40.0].T[0] > 1.5 * nominal.plan.T[0]
    assert plans[60.0].T[0] < nominal.plan.T[0]
    assert -np.sin(plans[60.0].x[K, :5]) @ reach > 1.3 * length


def test_the_merit_never_rises(belief, gait):
    """From a plan far from any motion: each iteration ends no worse than it began, whatever the push."""
    price, nominal = gait
    rng = np.random.default_rng(5)
    for push in (-60.0, 0.0, 110.0):
        w = copied(nominal)
        w.plan.x[1:] += rng.normal(0, 0.1, w.plan.x[1:].shape)
        world = start.world(belief.model)._replace(push=push)
        for _ in range(4):
            before = [a.copy() for a in w.plan]
            figures = solve.improve(price, world, nominal.plan.x[0], 0.0, 1, w)
            assert figures.found and np.isfinite(figures.after)
            kept = all((a == b).all() for a, b in zip(before, w.plan, strict=True))
            assert kept == (figures.share == 0.0)


def test_a_shifted_plan_is_the_same_motion(belief, gait):
    """20 ms later: its first state is where the plan's torques lead in 20 ms, and its time is that much shorter."""
    _, nominal = gait
    w = copied(nominal)
    x, world, room = w.plan.x[0].copy(), start.world(belief.model), motion.new_room()
    for _ in range(20):
        dynamics.advance(world, w.plan.u[0], 1e-3, room.stage, room.rest, room.rest, x)
    T = w.plan.T[0]
    shift.shift(w.plan, w.K, 0.02, 0.015, w.other, np.empty_like(w.K))
    assert w.plan.T[0] == pytest.approx(T - 0.02)
    np.testing.assert_allclose(w.plan.x[0, :5], x[:5], rtol=0, atol=1e-3)  # rates are interpolated more roughly
    np.testing.assert_allclose(w.plan.x[0, 5:], x[5:], rtol=0, atol=0.3)
    np.testing.assert_allclose(w.plan.x[SETTINGS.intervals], nominal.plan.x[SETTINGS.intervals], rtol=0, atol=1e-12)


def test_more_steps_may_be_planned(belief):
    """Three steps of few intervals: a plan of the gait that closes its gaps."""
    settings = dataclasses.replace(SETTINGS, steps=3, intervals=10)
    price, w = start.plan_of_gait(belief.model, belief.gait, settings, FRICTION)
    assert w.plan.T == pytest.approx(np.full(3, price.time), abs=0.1)
    figures = solve.improve(price, start.world(belief.model), w.plan.x[0].copy(), 0.0, 1, copied(w))
    assert figures.gap < 1e-3
