"""Fitting the gait to the moment: the family is gaits, the rule is steady, and without it nothing changes."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.common.errors import UserError
from controller.common.records import Leg, StanceState
from controller.common.settings import FittingSettings
from controller.design.orbit import periodic_orbit
from controller.fitting.controller import GaitFitting
from controller.fitting.family import GaitFamily
from controller.fitting.library import GaitLibrary
from sim.bridge import run as bridge
from sim.log.read import read_log
from sim.loop import EachTick
from sim.scenario import Push, Scenario, with_values

RULE = FittingSettings(share=-1.0, slower=0.25, faster=0.1, hysteresis=0.02, most=0.3)
FITTING = {"controller.gait_fitting.enabled": True}
ZD_PD = {"controller.kind": "zd-pd"}
KINDS = ("zd-pd", "c-mpc", "c-mpc-ltv", "clf-qp", "output-mpc")


@pytest.fixture(scope="module")
def belief():
    return bridge.load_belief(Scenario())


@pytest.fixture(scope="module")
def family(belief):
    return GaitFamily.around(belief.gait, GaitLibrary.load(belief.library, belief.model))


class Events(EachTick):
    """Keeps the decisions and what the loop says about gaits."""

    def __init__(self):
        self.torques, self.gaits = [], []

    def tick(self, k, state, observation, step, tick_s):
        self.torques.append(step.u_total)

    def event(self, k, level, name, message):
        if name == "gait":
            self.gaits.append(message)


def walk(changes, **scenario):
    tape = Events()
    return bridge.run_scenario(with_values(Scenario(**scenario), changes), tape=tape), tape


def test_the_member_in_the_middle_is_the_gait_itself(belief, family):
    assert family.member(0.0) is belief.gait
    assert not family.rate_change(0.0).any()
    near = family.member(1e-9)
    np.testing.assert_allclose(near.alpha, belief.gait.alpha, atol=1e-7)
    np.testing.assert_allclose(near.q_minus, belief.gait.q_minus, atol=1e-7)


def test_members_are_walkable_and_as_fast_as_they_say(belief, family):
    """Between grid points too. The paper's gait misses hybrid invariance by 0.04 rad/s; the others hardly by more."""
    q, dq = belief.gait.post_impact(belief.model)
    own = np.abs(dq[:4] - belief.gait.desired(belief.gait.theta_plus)[1] * (belief.gait.clock @ dq)).max()
    speeds = []
    for faster in np.linspace(family.speeds[0], family.speeds[-1], 9):
        gait = family.member(faster)
        q, dq = gait.post_impact(belief.model)
        start, slope, _ = gait.desired(gait.theta_plus)
        assert np.abs(q[:4] - start).max() < 0.01
        assert np.abs(dq[:4] - slope * (gait.clock @ dq)).max() <= 1.1 * own
        orbit = periodic_orbit(belief.model, gait)
        assert orbit.exists and (np.abs(orbit.u).max(axis=0) <= belief.model.torque_limits).all()
        speeds.append(orbit.speed)
    assert (np.diff(speeds) > 0.0).all()


def test_members_are_smooth_in_the_speed(family):
    """Half the step, half the change, and no jump anywhere."""
    for here in np.linspace(family.speeds[0] + 0.01, family.speeds[-1] - 0.01, 40):
        fine, coarse = (np.abs(family.member(here + d).alpha - family.member(here).alpha).max() for d in (1e-4, 2e-4))
        assert fine < 2e-3 and coarse == pytest.approx(2.0 * fine, rel=0.5, abs=1e-6)


def test_members_end_where_the_family_ends(family):
    for beyond, end in ((-9.0, 0), (9.0, -1)):
        np.testing.assert_array_equal(family.member(beyond).alpha, family.alpha[end])


def test_the_speed_is_read_from_the_momentum(belief, family):
    """A walker on a member's orbit, just before its impact, is measured to be as fast as the member."""
    chooser = GaitFitting(bridge.build_controller(Scenario().controller, belief), belief.model, family, RULE)
    for k in (1, len(family.speeds) // 2, -2):
        gait = family.member(family.speeds[k])
        before = StanceState(q=gait.q_minus, dq=gait.dq_minus, leg=Leg.LEFT)
        assert chooser.measure(before) == pytest.approx(family.speeds[k], abs=0.03)
    assert family.faster_by(-1e3) == family.speeds[0] and family.faster_by(1e3) == family.speeds[-1]


speeds = st.floats(-0.6, 0.6)


@given(followed=st.floats(-0.25, 0.1), measured=speeds)
def test_the_rule_stays_within_its_bounds(followed, measured):
    after = RULE.next(followed, measured)
    assert -0.25 - 1e-12 <= after <= 0.1 + 1e-12
    assert abs(after - followed) <= RULE.most + 1e-12
    assert after == followed or abs(after - followed) > RULE.hysteresis or after == 0.0
    assert dataclasses.replace(RULE, most=0.05).next(followed, measured) == pytest.approx(
        np.clip(after, followed - 0.05, followed + 0.05)
    )


@given(measured=speeds)
def test_the_rule_settles_and_does_not_chatter(measured):
    """The same speed twice gives the same gait twice; a speed a little off keeps it."""
    first = RULE.next(0.0, measured)
    assert RULE.next(first, measured) == first
    if first and abs(first) > 2.0 * RULE.hysteresis and -0.2 < first < 0.05:
        assert RULE.next(first, measured + 0.9 * RULE.hysteresis) == first


def test_an_undisturbed_walk_follows_its_own_gait_to_the_bit():
    off, on = walk(ZD_PD, steps=4), walk(ZD_PD | FITTING, steps=4)
    assert on[1].gaits == []
    assert on[0].state_digest == off[0].state_digest
    assert all((a == b).all() for a, b in zip(on[1].torques, off[1].torques, strict=True))


@pytest.mark.parametrize("kind", KINDS)
def test_after_a_push_every_controller_follows_a_slower_gait_for_a_while(kind):
    summary, tape = walk({"controller.kind": kind} | FITTING, steps=3, pushes=(Push(force=20.0, step=1),))
    assert summary.outcome == "completed"
    assert tape.gaits and tape.gaits[0].endswith("m/s slower than its own")


def test_it_holds_a_push_that_throws_the_same_controller_over():
    """28 N through the fourth step, which ZD+PD alone falls from."""
    pushed = {"steps": 7, "pushes": (Push(force=28.0, step=4),)}
    assert walk(ZD_PD, **pushed)[0].outcome == "fell"
    first, tape = walk(ZD_PD | FITTING, **pushed)
    assert first.outcome == "completed"
    assert walk(ZD_PD | FITTING, **pushed)[1].gaits == tape.gaits


def test_a_reset_returns_to_the_own_gait(belief, family):
    chooser = GaitFitting(bridge.build_controller(Scenario().controller, belief), belief.model, family, RULE)
    chooser._follow(-0.2)
    assert chooser.inner.gait is not belief.gait
    chooser.reset("left")
    assert chooser.inner.gait is belief.gait and chooser.speed == 0.0


def test_a_log_carries_the_library_and_runs_again_from_it(tmp_path):
    from sim.review.replay import replay

    log = tmp_path / "run.mcap"
    pushed = with_values(Scenario(steps=2, pushes=(Push(force=20.0, step=1),)), ZD_PD | FITTING)
    bridge.run_scenario(pushed, log=log)
    assert "gait-library.json" in read_log(log).attachments
    assert replay(read_log(log)).identical


def test_gaits_that_can_not_be_fitted_are_refused(belief, tmp_path):
    library = GaitLibrary.load(belief.library, belief.model)
    other_clock = dataclasses.replace(belief.gait, clock=np.array([-1.0, 0.0, -0.4, 0.0, -1.0]))
    with pytest.raises(UserError, match="clock"):
        GaitFamily.around(other_clock, library)
    empty = dataclasses.replace(belief, library=tmp_path)
    with pytest.raises(UserError, match="no library gaits"):
        bridge.build_controller(with_values(Scenario(), FITTING).controller, empty)
