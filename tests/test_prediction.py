"""The horizon is the closed loop under ZD+PD, sampled, with impacts found from the state."""

import numpy as np
import oracle
import pytest

from controller.cmpc import predict
from controller.cmpc.zero_dynamics import zero_dynamics_pd
from controller.common.records import Leg, StanceState

N, T = 100, 1e-3
Q, DQ = slice(0, 5), slice(5, 10)


def state(q, dq, leg=Leg.LEFT):
    return StanceState(q=q, dq=dq, leg=leg)


@pytest.fixture(scope="module")
def at_start(gait, model):
    return state(*gait.post_impact(model))


@pytest.fixture(scope="module")
def before_impact(loop, at_start):
    """Half a step after the start: an impact lies within the next horizon."""
    x = predict(loop, at_start, 480, T).x[-1]
    return state(x[Q], x[DQ])


def in_surface(walker, x):
    """Whether x is in S of Eq. (4), going down, by Pinocchio."""
    q_e, dq_e = walker.unpinned(x[Q], x[DQ])
    ahead, height = walker.foot(q_e, oracle.SWING_FOOT)
    return ahead > 0 and height <= 0 and (walker.jacobian(q_e, oracle.SWING_FOOT) @ dq_e)[1] < 0


def euler(loop, x):
    """Eqs. (10)-(12) with u_tilde = 0."""
    step = zero_dynamics_pd(loop, x[Q], x[DQ])
    return np.concatenate([x[Q] + T * x[DQ] + T**2 / 2 * step.ddq, x[DQ] + T * step.ddq])


@pytest.mark.parametrize("offset", [0.0, 0.05])
def test_every_stage_is_one_step_of_the_law_or_that_and_an_impact(loop, model, walker, before_impact, offset):
    torso = np.array([0, 0, 0, 0, offset])
    horizon = predict(loop, state(before_impact.q + torso, before_impact.dq), N, T)
    assert horizon.exchange.any()
    for k in range(N):
        x = euler(loop, horizon.x[k])
        assert horizon.exchange[k] == in_surface(walker, x)
        if horizon.exchange[k]:
            x = np.concatenate(walker.impact(x[Q], x[DQ]))
        assert horizon.x[k + 1] == pytest.approx(x, rel=1e-9, abs=1e-9)


def test_every_stage_reports_its_law(loop, walker, before_impact):
    horizon = predict(loop, before_impact, N, T)
    for k in range(N):
        q, dq = horizon.x[k, Q], horizon.x[k, DQ]
        step = zero_dynamics_pd(loop, q, dq)
        assert horizon.u[k] == pytest.approx(step.u, rel=1e-9, abs=1e-9)
        assert horizon.y[k] == pytest.approx(step.y, abs=1e-12)
        assert horizon.dy[k] == pytest.approx(step.dy, abs=1e-11)
        D, _ = walker.pinned(q, dq)
        DinvB = np.linalg.solve(D, oracle.B)
        assert horizon.rate_per_torque[k] == pytest.approx(T * DinvB[:4], rel=1e-9, abs=1e-12)
        force, per_torque = walker.stance_force(q, dq, step.u)
        assert horizon.force[k] == pytest.approx(force, rel=1e-8, abs=1e-6)
        assert horizon.force_per_torque[k] == pytest.approx(per_torque, rel=1e-8, abs=1e-9)
    last = zero_dynamics_pd(loop, horizon.x[N, Q], horizon.x[N, DQ])
    assert (*horizon.y[N], *horizon.dy[N]) == pytest.approx((*last.y, *last.dy), abs=1e-11)
    first = zero_dynamics_pd(loop, before_impact.q, before_impact.dq)
    assert (horizon.theta, horizon.dtheta) == pytest.approx((first.theta, first.dtheta))


def test_sampling_is_of_first_order_overall_and_of_second_and_third_in_a_step(loop, at_start):
    """Against the continuous closed loop: per step, q misses by T^3 and dq by T^2; over a time, both by T."""

    def flow(x):
        return np.concatenate([x[DQ], zero_dynamics_pd(loop, x[Q], x[DQ]).ddq])

    x0 = np.concatenate([at_start.q + np.array([0.02, -0.03, 0.04, 0.02, 0.01]), at_start.dq])
    duration = 0.08  # [s]
    exact = oracle.runge_kutta(flow, x0, duration, 800)

    def miss(stages):
        horizon = predict(loop, state(x0[Q], x0[DQ]), stages, duration / stages)
        assert not horizon.exchange.any()
        return np.abs(horizon.x[-1] - exact).max()

    errors = np.array([miss(stages) for stages in (40, 80, 160, 320)])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(np.ones(3), abs=0.15)

    def local(h):
        x = predict(loop, state(x0[Q], x0[DQ]), 1, h).x[1] - oracle.runge_kutta(flow, x0, h, 20)
        return np.array([np.abs(x[Q]).max(), np.abs(x[DQ]).max()])

    orders = np.log2(local(1e-3) / local(5e-4))
    assert orders == pytest.approx([3.0, 2.0], abs=0.15)


def test_impact_comes_from_the_state_not_from_time(loop, before_impact):
    """Starting k ticks later on the same path, the impact is k ticks nearer and all stages are the same."""
    horizon = predict(loop, before_impact, N, T)
    first = horizon.impact_in
    assert first > 10 and horizon.exchange[first - 1]
    for k in (1, 7, first - 1):
        later = predict(loop, state(horizon.x[k, Q], horizon.x[k, DQ]), N - k, T)
        assert later.impact_in == first - k
        np.testing.assert_allclose(later.x, horizon.x[k:], rtol=0.0, atol=1e-11)  # sines are carried along
        np.testing.assert_allclose(later.u, horizon.u[k:], rtol=0.0, atol=1e-8)
    after = predict(loop, state(horizon.x[first, Q], horizon.x[first, DQ]), N - first, T)
    assert after.impact_in == -1


def test_a_foot_that_scuffs_behind_does_not_land(loop, model, walker, gait):
    """Eq. (4) asks for p_2^h > 0: below the ground and going down is not enough."""
    q = oracle.R @ gait.q_minus  # the swing foot is a step behind, on the ground
    down = -np.array([model.swing_foot(q, column)[2] for column in np.eye(5)])
    horizon = predict(loop, state(q, 3.0 * down), 5, T)
    for x, exchange in zip(horizon.x[1:], horizon.exchange, strict=True):
        q_e, _ = walker.unpinned(x[Q], x[DQ])
        behind, height = walker.foot(q_e, oracle.SWING_FOOT)
        assert behind < 0.0 and height < 0.0 and model.swing_foot(x[Q], x[DQ])[2] < 0.0
        assert not exchange


def test_a_foot_below_the_ground_believed_in_does_not_land_again_and_again(loop, model, before_impact):
    """Lower ground than believed: the foot is ahead, below the surface of Eq. (4) and still going down."""
    first = predict(loop, before_impact, N, T).impact_in
    seen = predict(loop, before_impact, first - 1, T)  # the walk up to the stage before it lands
    q, dq = seen.x[-1, Q], seen.x[-1, DQ]
    fallen = q + 4 * T * dq  # as if the ground had given way
    ahead, height, rate = model.swing_foot(fallen, dq)
    assert ahead > 0.0 and height < 0.0 and rate < 0.0
    assert not predict(loop, state(fallen, dq), 5, T).exchange.any()


def test_a_faster_walker_lands_sooner(loop, before_impact):
    landings = [
        predict(loop, state(before_impact.q, factor * before_impact.dq), N, T).impact_in for factor in (1.0, 1.3, 1.7)
    ]
    assert landings[0] > landings[1] > landings[2] > 0


def test_the_gait_predicts_itself(loop, model, gait, at_start):
    """The paper's gait: a first step of some 0.52 s and 0.40 m, its errors those of the table's decimals."""
    horizon = predict(loop, at_start, 600, T)
    assert 0.50 < horizon.impact_in * T < 0.55
    landed = horizon.x[horizon.impact_in]
    behind, height, _ = model.swing_foot(landed[Q], landed[DQ])
    assert behind == pytest.approx(-0.40, abs=0.01) and abs(height) < 2e-3
    assert np.abs(horizon.y[: horizon.impact_in]).max() < 0.02


def test_prediction_does_not_know_which_leg_it_is(loop, before_impact):
    left = predict(loop, before_impact, N, T)
    right = predict(loop, state(before_impact.q, before_impact.dq, Leg.RIGHT), N, T)
    assert np.array_equal(left.x, right.x)


def test_prediction_keeps_its_arguments_and_repeats_itself(loop, before_impact):
    q, dq = before_impact.q.copy(), before_impact.dq.copy()
    a, b = (predict(loop, before_impact, N, T) for _ in range(2))
    assert np.array_equal(q, before_impact.q) and np.array_equal(dq, before_impact.dq)
    assert all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("x", "u", "y", "force"))


def test_a_state_that_can_not_be_is_told_not_raised(loop, at_start):
    assert predict(loop, at_start, N, T).is_finite
    wild = predict(loop, state(at_start.q, 1e4 * at_start.dq), N, T)
    assert not wild.is_finite
    assert not predict(loop, state(at_start.q * np.nan, at_start.dq), N, T).is_finite
