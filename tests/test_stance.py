"""Which leg stands, from what the controller may see."""

import numpy as np
import pytest

from controller.belief import StanceEstimator
from controller.common.records import Leg, swap_legs
from sim.interface import Observation

AHEAD, BEHIND = True, False


@pytest.fixture
def estimator(model):
    found = StanceEstimator(model)
    found.reset("left")
    return found


def seen(gait, contact, *, swing=AHEAD, stance="left"):
    """Body-order observation with the swing foot 0.4 m ahead of or behind the stance foot."""
    q = gait.q_minus if swing is AHEAD else swap_legs(gait.q_minus)
    leg = Leg(stance)
    return Observation(t=0.0, q=leg.from_body(q), dq=leg.from_body(gait.dq_minus), contact=contact)


def test_the_postures_are_what_they_are_called(model, gait):
    assert model.swing_foot(gait.q_minus, gait.dq_minus)[0] == pytest.approx(0.4, abs=0.01)
    assert model.swing_foot(swap_legs(gait.q_minus), gait.dq_minus)[0] == pytest.approx(-0.4, abs=0.01)


def test_legs_change_when_the_swing_foot_lands_ahead(estimator, gait):
    state = estimator.update(seen(gait, (True, True)))
    assert state.leg is Leg.RIGHT
    assert np.array_equal(state.q, swap_legs(gait.q_minus))
    assert np.array_equal(state.dq, swap_legs(gait.dq_minus))


@pytest.mark.parametrize(
    ("contact", "swing"),
    [((True, False), AHEAD), ((False, False), AHEAD), ((True, True), BEHIND), ((False, True), BEHIND)],
)
def test_legs_stay_when_the_swing_foot_flies_or_scuffs_behind(estimator, gait, contact, swing):
    observation = seen(gait, contact, swing=swing)
    state = estimator.update(observation)
    assert state.leg is Leg.LEFT
    assert np.array_equal(state.q, observation.q) and np.array_equal(state.dq, observation.dq)


def test_landing_counts_even_if_the_stance_foot_has_left(estimator, gait):
    assert estimator.update(seen(gait, (False, True))).leg is Leg.RIGHT


def test_lingering_double_support_does_not_change_the_legs_back(estimator, gait):
    observation = seen(gait, (True, True))
    legs = [estimator.update(observation).leg for _ in range(5)]
    assert legs == [Leg.RIGHT] * 5


def test_a_walk_alternates(estimator, gait):
    legs = []
    for stance in ("left", "right", "left", "right"):
        assert estimator.leg is Leg(stance)
        legs.append(estimator.update(seen(gait, (True, True), stance=stance)).leg)
    assert legs == [Leg.RIGHT, Leg.LEFT, Leg.RIGHT, Leg.LEFT]


def test_reset_forgets(estimator, gait):
    estimator.update(seen(gait, (True, True)))
    estimator.reset("left")
    assert estimator.leg is Leg.LEFT
    with pytest.raises(ValueError):
        estimator.reset("middle")


def through_an_impact(model, gait, impact_time, *, share):
    """States of an estimator over ticks around a landing whose measured rates are only a share of the way through."""
    found = StanceEstimator(model, impact_time=impact_time)
    found.reset("left")
    q, dq = gait.q_minus, gait.dq_minus
    _, after = model.impact(q, dq)
    halfway = dq + share * (swap_legs(after) - dq)  # body order, as is what is seen
    seen_rates = [dq, halfway, halfway, halfway]
    states = []
    for k, rates in enumerate(seen_rates):
        observation = Observation(t=k * 1e-3, q=q, dq=rates, contact=(True, k > 0))
        states.append(found.update(observation))
        found.held(np.zeros(4))
    return states, after


def test_while_an_impact_lasts_rates_are_those_the_impact_map_predicts(model, gait):
    states, after = through_an_impact(model, gait, 2.5e-3, share=0.4)
    assert states[1].leg is Leg.RIGHT
    jump = np.abs(after - swap_legs(gait.dq_minus)).max()
    assert np.abs(states[1].dq - after).max() < 0.1 * jump  # a tick of acceleration, and no more
    carried = states[1].dq + 1e-3 * model.acceleration(states[1].q, states[1].dq, np.zeros(4))
    assert states[2].dq == pytest.approx(carried, abs=1e-12)
    assert states[3].dq == pytest.approx(carried + 1e-3 * model.acceleration(states[2].q, carried, np.zeros(4)))


def test_after_it_and_where_it_takes_no_time_rates_are_those_measured(model, gait):
    for impact_time, first in ((0.0, 1), (1.5e-3, 3)):
        states, after = through_an_impact(model, gait, impact_time, share=0.4)
        measured = swap_legs(gait.dq_minus + 0.4 * (swap_legs(after) - gait.dq_minus))
        for state in states[first:]:
            assert state.dq == pytest.approx(measured, abs=1e-12)


def test_a_torque_beyond_the_limits_is_predicted_as_the_limit(model, gait):
    found = []
    for torque in (1e3, model.torque_limits):
        estimator = StanceEstimator(model, impact_time=5e-3)
        estimator.reset("left")
        estimator.update(Observation(t=0.0, q=gait.q_minus, dq=gait.dq_minus, contact=(True, False)))
        estimator.held(torque * np.ones(4))
        found.append(estimator.update(Observation(t=1e-3, q=gait.q_minus, dq=gait.dq_minus, contact=(True, True))).dq)
    assert found[0] == pytest.approx(found[1])
