"""Steps and falls as the truth has them."""

import numpy as np
import pytest
from fakes import plant_state, rows_of

from sim.loop import FallCriteria, FallReason, Judge
from sim.loop.judge import ENDED, LANDED, SCUFF_BEGAN, SCUFF_ENDED, SETTLING
from sim.loop.ticks import JUDGED

AHEAD = np.array([[0.0, 0.0], [0.4, 0.0]])  # [m] the right foot before the left


def landed(t=0.5, foot=AHEAD, contact=(True, True)):
    return plant_state(t=t, foot=foot, contact=contact)


def look(judge, state):
    """What the judge finds at a state."""
    return judge.look(rows_of(state), np.zeros(1, JUDGED), 0)


def touch_down(judge, state):
    """The step that a state completes, if it does."""
    return judge.touch_down() if look(judge, state) & LANDED else None


def scuff(judge, state):
    return judge.scuff() if look(judge, state) & (SCUFF_BEGAN | SCUFF_ENDED) else ""


def fall(judge, state):
    """Why a state is a fall, and its figures."""
    return judge.end(rows_of(state)[0])[1:] if look(judge, state) & ENDED else (FallReason.NONE, "")


def settled(judge, t):
    judged = np.zeros(1, JUDGED)
    judge.look(rows_of(plant_state(t=t)), judged, 0)
    return bool(judged["settled"][0])


@pytest.fixture
def judge():
    return Judge("left")


def test_a_step_is_the_swing_foot_landing_ahead(judge):
    step = touch_down(judge, landed())
    assert (step.number, step.foot) == (1, "right")
    assert (step.t, step.duration, step.length) == pytest.approx((0.5, 0.5, 0.4))
    assert judge.steps == 1 and judge.stance == 1 and judge.last_impact == 0.5


def test_a_step_counts_once_while_both_feet_stand(judge):
    assert [bool(touch_down(judge, landed(t))) for t in (0.5, 0.501, 0.502)] == [True, False, False]


@pytest.mark.parametrize(
    "state",
    [
        landed(contact=(True, False)),
        landed(contact=(False, False)),
        landed(foot=np.array([[0.0, 0.0], [-0.1, 0.0]])),
        landed(foot=np.zeros((2, 2))),
    ],
    ids=["swing", "flight", "scuff behind", "feet together"],
)
def test_no_step(judge, state):
    assert touch_down(judge, state) is None
    assert judge.steps == 0 and judge.stance == 0


def test_feet_take_turns_and_durations_add_up(judge):
    found = []
    for k, t in enumerate((0.5, 1.1, 1.6)):
        foot = np.zeros((2, 2))
        foot[1 - k % 2, 0] = 0.4
        found.append(touch_down(judge, landed(t, foot)))
    assert [step.foot for step in found] == ["right", "left", "right"]
    assert [step.number for step in found] == [1, 2, 3]
    assert sum(step.duration for step in found) == pytest.approx(1.6)


def test_contact_forces_count_once_the_impact_is_over(judge):
    touch_down(judge, landed(0.5))
    assert not settled(judge, 0.5) and not settled(judge, 0.5 + SETTLING - 1e-9)
    assert settled(judge, 0.5 + SETTLING + 1e-9)


@pytest.mark.parametrize(
    ("changes", "reason", "figures"),
    [
        ({}, FallReason.NONE, ""),
        ({"hip": np.array([0.0, 0.451])}, FallReason.NONE, ""),
        ({"hip": np.array([0.0, 0.449])}, FallReason.HIP_LOW, "0.449 m"),
        ({"q": np.array([0, 0, 0, 0, 1.19])}, FallReason.NONE, ""),
        ({"q": np.array([0, 0, 0, 0, 1.21])}, FallReason.TORSO_TILT, "1.21 rad"),
        ({"q": np.array([0, 0, 0, 0, -1.21])}, FallReason.TORSO_TILT, "-1.21 rad"),
        ({"penetrating": ("torso", "left_femur")}, FallReason.BODY_CONTACT, "torso, left_femur"),
        ({"t": 2.0}, FallReason.NONE, ""),
        ({"t": 2.001}, FallReason.STALLED, "2.0 s"),
    ],
)
def test_falls(judge, changes, reason, figures):
    found, detail = fall(judge, plant_state(**changes))
    assert found is reason
    assert figures in detail and bool(detail) == bool(figures)


def test_hip_height_is_above_the_lower_foot(judge):
    """On a slope that leads down, the hip may be low above level ground and high above the foot."""
    down = plant_state(hip=np.array([4.0, 0.3]), foot=np.array([[4.0, -0.45], [3.8, -0.3]]))
    assert fall(judge, down)[0] is FallReason.NONE


def test_a_step_ends_the_stall(judge):
    touch_down(judge, landed(1.9))
    assert fall(judge, plant_state(t=3.8))[0] is FallReason.NONE


def test_criteria_can_be_others():
    strict = Judge("right", FallCriteria(hip_height=0.8))
    assert fall(strict, plant_state(contact=(False, True)))[0] is FallReason.HIP_LOW
    assert strict.stance == 1


def test_criteria_follow_the_leg_and_are_rabbits_by_default():
    assert FallCriteria.of_leg(0.8) == FallCriteria()
    half = FallCriteria.of_leg(0.4)
    assert (half.hip_height, half.step_length) == pytest.approx((0.225, 0.05))
    assert fall(Judge("left", half), plant_state(hip=np.array([0.0, 0.4])))[0] is FallReason.NONE


def test_a_foot_that_scuffs_just_ahead_is_no_step_until_it_lands(judge):
    """Past the stance foot by a centimetre it has only scuffed; the same foot then lands, and that is the step."""
    assert touch_down(judge, landed(0.3, np.array([[0.0, 0.0], [judge.criteria.step_length / 10, 0.0]]))) is None
    assert judge.stance == 0 and judge.last_impact == 0.0
    assert touch_down(judge, landed(0.5)).duration == pytest.approx(0.5)


def in_the_ground(t, depth, *, ahead=-0.1):
    foot = np.array([[0.0, 0.0], [ahead, -depth]])
    return plant_state(t=t, foot=foot, clearance=np.array([0.0, -depth]))


def test_a_scuff_is_the_swing_foot_below_the_ground_once_the_landing_is_over(judge):
    assert scuff(judge, in_the_ground(SETTLING / 2, 5e-4)) == ""
    assert "below the ground" in scuff(judge, in_the_ground(0.1, 1e-3))
    assert scuff(judge, in_the_ground(0.101, 3e-3, ahead=0.02)) == ""
    assert "3.00 mm deep, 2 ticks" in scuff(judge, plant_state(t=0.102))
    assert (judge.scuffing.depth, judge.scuffing.ticks, judge.scuffing.ahead) == (3e-3, 2, 1)
    assert fall(judge, in_the_ground(0.101, 3e-3))[0] is FallReason.NONE


def test_a_scuff_deeper_than_the_rule_is_a_fall_where_asked_for():
    judge = Judge("left", FallCriteria.of_leg(0.8, trips=True))
    for depth, reason in ((0.9e-3, FallReason.NONE), (1.1e-3, FallReason.TRIPPED)):
        state = in_the_ground(0.1, depth)
        scuff(judge, state)
        assert fall(judge, state)[0] is reason
