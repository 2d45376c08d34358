"""The control Lyapunov function falls as guaranteed, at the least effort, and gives way to the torque limits alone."""

import numpy as np
import pytest
import qpsolvers
from hypothesis import given
from hypothesis import strategies as st

from controller.belief import Friction
from controller.rivals.clf_qp import ClfQp, F, G, Lyapunov
from controller.rivals.output_dynamics import output_dynamics

PENALTY = 1e4
WIDE = np.full(4, 1e5)  # [N.m]
LYAPUNOV, SLOW = Lyapunov.rapid(0.05), Lyapunov.rapid(1.0)

etas = st.lists(st.floats(-1.0, 1.0, allow_subnormal=False), min_size=8, max_size=8).map(np.array)


def law(limit, friction=None, penalty=PENALTY):
    return ClfQp(LYAPUNOV, penalty=penalty, limit=limit, friction=friction)


def least(eta, penalty=PENALTY):
    """Closed form of the QP without limits: mu and delta."""
    L_F, L_G = LYAPUNOV.derivative(eta)
    psi = L_F + LYAPUNOV.rate * LYAPUNOV.value(eta)
    mu = -max(psi, 0.0) * L_G / (L_G @ L_G + 1.0 / penalty)
    return mu, max(psi, 0.0) / (1.0 + penalty * (L_G @ L_G))


def eta_of(dynamics):
    return np.concatenate([dynamics.y, dynamics.dy])


@pytest.fixture(scope="module")
def states(model, gait, walking_states):
    return [output_dynamics(model.lumped, gait.table, q, dq) for q, dq in walking_states(150, spread=0.05)]


@given(eta=etas)
def test_some_mu_always_lets_it_fall_at_the_guaranteed_rate(eta):
    """The promise of the RES-CLF: the regulator behind its Riccati equation, sped up by epsilon, is such a mu."""
    epsilon = SLOW.rate / LYAPUNOV.rate
    mu = -(G.T @ SLOW.P @ np.concatenate([eta[:4] / epsilon, eta[4:]])) / epsilon
    L_F, L_G = LYAPUNOV.derivative(eta)
    assert L_F + L_G @ mu <= -LYAPUNOV.rate * LYAPUNOV.value(eta) + 1e-9 * (1.0 + abs(L_F))


@given(eta=etas, mu=st.lists(st.floats(-50, 50), min_size=4, max_size=4).map(np.array))
def test_the_derivative_is_that_along_the_output_dynamics(eta, mu):
    L_F, L_G = LYAPUNOV.derivative(eta)
    deta, h = F @ eta + G @ mu, 1e-5
    difference = (LYAPUNOV.value(eta + h * deta) - LYAPUNOV.value(eta - h * deta)) / (2 * h)
    assert L_F + L_G @ mu == pytest.approx(difference, rel=1e-6, abs=1e-5)


def test_the_least_mu_where_no_torque_is_at_its_limit(states):
    """Away from the limits the QP has a closed form, and V falls at the guaranteed rate but for what p leaves."""
    for dynamics in states:
        eta, decision = eta_of(dynamics), law(WIDE).decide(dynamics)
        mu, delta = least(eta)
        assert decision.answer.found and decision.answer.status == "optimal"
        assert decision.v == pytest.approx(mu, rel=1e-6, abs=1e-6)
        L_F, L_G = LYAPUNOV.derivative(eta)
        assert L_F + L_G @ decision.v <= -LYAPUNOV.rate * LYAPUNOV.value(eta) + delta + 1e-6
        assert delta <= 1e-3 * LYAPUNOV.rate * LYAPUNOV.value(eta)


def test_outputs_converge_exponentially():
    """V along the sampled double integrators stays below its guarantee, from every random start."""
    rng, dt = np.random.default_rng(2), 1e-4  # [s]
    for _ in range(5):
        eta = rng.uniform(-0.3, 0.3, 8)
        first = LYAPUNOV.value(eta)
        for k in range(1, 3001):
            mu, _ = least(eta, penalty=1e12)
            eta = eta + dt * (F @ eta) + 0.5 * dt**2 * (F @ G @ mu) + dt * (G @ mu)
            if k % 500 == 0:
                assert LYAPUNOV.value(eta) <= 1.02 * first * np.exp(-LYAPUNOV.rate * k * dt)


def test_the_guarantee_gives_way_only_where_the_limits_leave_no_choice(states):
    """Under a high p the decay misses its guarantee by what the best torque within the limits misses, no more."""
    limit = np.array([15.0, 15.0, 5.0, 5.0])
    usual, relaxed = law(limit), 0
    for dynamics in states:
        eta, decision = eta_of(dynamics), usual.decide(dynamics)
        assert decision.answer.found
        assert (np.abs(dynamics.torque(decision.v)) <= limit + 1e-6).all()
        mu, _ = least(eta)
        if (np.abs(dynamics.torque(mu)) <= limit).all():
            assert decision.v == pytest.approx(mu, rel=1e-6, abs=1e-6) and decision.answer.status == "optimal"
        L_F, L_G = LYAPUNOV.derivative(eta)
        psi = L_F + LYAPUNOV.rate * LYAPUNOV.value(eta)
        unavoidable = max(0.0, psi + L_G @ dynamics.drift - np.abs(L_G @ dynamics.decoupling) @ limit)
        stubborn = law(limit, penalty=1e8 / (L_G @ L_G)).decide(dynamics)
        missed = max(0.0, psi + L_G @ stubborn.v)
        assert missed == pytest.approx(unavoidable, rel=1e-3, abs=1e-3)
        if unavoidable > 0.1:
            assert decision.answer.status == "relaxed"
            relaxed += 1
    assert 20 < relaxed < len(states)


def test_contact_forces_keep_to_the_cone_or_say_by_how_much_not(states):
    friction = Friction(mu=0.3, normal_min=200.0, penalty=1e3)
    limit = np.array([75.0, 75.0, 50.0, 50.0])
    active = 0
    for dynamics in states:
        free, decision = (law(limit, f).decide(dynamics) for f in (None, friction))
        (t, n), (t0, n0) = (
            d.force + d.force_per_torque @ d.torque(x.v) for d, x in ((dynamics, decision), (dynamics, free))
        )
        beyond = max(abs(t) - friction.mu * n, friction.normal_min - n, 0.0)
        assert beyond == pytest.approx(decision.slack, abs=1e-5)
        before = max(abs(t0) - friction.mu * n0, friction.normal_min - n0, 0.0)
        assert beyond <= before + 1e-6
        if before == 0.0:
            assert decision.v == pytest.approx(free.v, rel=1e-6, abs=1e-5)
        active += before > 1.0 and beyond < 0.1 * before
    assert active > 10


def test_another_solver_finds_the_same(states):
    friction = Friction(mu=0.3, normal_min=100.0, penalty=10.0)
    one = law(np.array([40.0, 40.0, 15.0, 15.0]), friction)
    for dynamics in states[::10]:
        problem = one.problem(dynamics)
        exact = qpsolvers.solve_problem(problem, "piqp", eps_abs=1e-10, eps_rel=1e-12)
        assert one.decide(dynamics).v == pytest.approx(exact.x[:4], rel=1e-5, abs=1e-4)
