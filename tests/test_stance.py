"""Which leg stands, from what the controller may see."""

import numpy as np
import pytest

from controller.belief import StanceEstimator
from controller.records import Leg, swap_legs
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
