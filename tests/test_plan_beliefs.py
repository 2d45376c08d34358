"""What a plan is made for: a load told from a push, an impulse from a push that lasts, a slope from a ledge."""

import dataclasses

import numpy as np
import pytest

from controller.belief import kernels
from controller.belief.lumped import lump
from controller.common.records import Leg, StanceState
from controller.common.settings import PlanSettings
from controller.observer import Estimate
from controller.plan import cost, dynamics, start
from controller.plan.beliefs import Beliefs
from controller.plan.ledge import Ledge
from controller.plan.load import Scales
from controller.plan.share import Share
from sim.bridge import run as bridge
from sim.scenario import Scenario

PERIOD = 1e-3


@pytest.fixture(scope="module")
def belief():
    return bridge.load_belief(Scenario())


def heavier(model, load):
    """The walker with a load on its torso."""
    torso, factor = model.torso, 1.0 + load / model.torso.mass
    torso = dataclasses.replace(torso, mass=factor * torso.mass, inertia=factor * torso.inertia)
    lumped = lump(torso, model.femur, model.tibia, model.joints, model.lumped.gravity, model.known)
    return start.world(model)._replace(walker=lumped)


@pytest.mark.parametrize(("load", "push"), [(0.0, 0.0), (24.0, 0.0), (0.0, -40.0), (-3.0, 30.0), (36.0, 25.0)])
def test_scales_tell_load_and_push(belief, load, push):
    """From the motion alone, 80 ms after both came, under torques that have nothing to do with either."""
    model = belief.model
    q, dq = belief.gait.post_impact(model)
    x = np.concatenate([start.links(q), start.links(dq)])
    truth = heavier(model, load)._replace(push=push)
    scales, rng = Scales(model, start.world(model), PERIOD, 0.0), np.random.default_rng(3)
    stage, rates, u = kernels.new_stage(), dynamics.new_rates(), np.zeros(4)
    for _ in range(80):
        scales.update(x, u, stands=True, exchanged=False)
        u = rng.normal(0, 20, 4)
        dynamics.advance(truth, u, PERIOD, stage, rates, rates, x)
    assert scales.load == pytest.approx(load, abs=0.5 + 0.03 * abs(load))
    assert scales.push == pytest.approx(push, abs=3.0 + 0.05 * abs(push))
    assert (scales.world.walker is start.world(model).walker) == (load == 0.0)


def taught(beliefs, told, felt, state, *, exchanged=False):
    """One tick with what observer and scales say given; the push that the plan is for."""
    beliefs.scales.update = lambda *_, **__: None
    beliefs.scales.push = felt
    x = np.concatenate([start.links(state.q), start.links(state.dq)])
    beliefs.update(Estimate(push=told), state, x, np.zeros(4), stands=True, swings=True, exchanged=exchanged)
    return beliefs.world.push


@pytest.fixture
def beliefs(belief):
    return Beliefs(belief.model, start.world(belief.model), PERIOD, 0.0)


@pytest.fixture
def landed(belief):
    q, dq = belief.gait.post_impact(belief.model)
    return StanceState(q=q, dq=dq, leg=Leg.LEFT)


def test_a_push_is_believed_as_far_as_both_agree(beliefs, landed):
    assert taught(beliefs, -40.0, -35.0, landed) == -35.0
    assert taught(beliefs, 20.0, 60.0, landed) == 20.0
    assert taught(beliefs, 20.0, -5.0, landed) == 0.0


def test_an_impulse_is_no_push(beliefs, landed):
    """Neither while it acts nor while the estimate comes back from it; a push that goes on is one after 150 ms."""
    assert taught(beliefs, -300.0, -300.0, landed) == 0.0 and beliefs.push == -300.0
    after = [taught(beliefs, -50.0, -50.0, landed) for _ in range(160)]
    assert after[:140] == [0.0] * 140 and after[-1] == -50.0
    assert taught(beliefs, -300.0, -300.0, landed) == taught(beliefs, -2.0, -2.0, landed) + 2.0 == 0.0


def test_one_landing_is_half_a_slope_and_two_are_one(belief, beliefs, landed):
    """The feet as far above each other as on a slope of 0.1: half of it at first, all of it when seen again."""
    model = belief.model

    def on(slope):
        q = landed.q.copy()
        for _ in range(20):
            behind, height, _ = model.swing_foot(q, landed.dq)
            q[1] += 2.0 * (height - slope * behind)
        return StanceState(q=q, dq=landed.dq, leg=Leg.LEFT)

    seen = []
    for slope in (0.0, 0.1, 0.1, 0.0, -0.2):
        taught(beliefs, 0.0, 0.0, on(slope), exchanged=True)
        seen.append(beliefs.world.terrain.tangent)
    np.testing.assert_allclose(seen, [0.0, 0.05, 0.1, 0.0, -0.1], rtol=0, atol=1e-3)


@pytest.mark.parametrize(("speed", "felt"), [(-1.5, -1.5), (0.0, 0.0)])
def test_scales_feel_a_blow_to_the_swing_foot_and_take_it_for_no_load(belief, speed, felt):
    """The foot is stopped from one tick to the next; a walker that stands on nothing feels it too, and no load."""
    q, dq = belief.gait.post_impact(belief.model)
    x = np.concatenate([start.links(q), start.links(dq)])
    world, stage, rates = start.world(belief.model), kernels.new_stage(), dynamics.new_rates()
    for stands in (True, False):
        scales, y = Scales(belief.model, world, PERIOD, 0.0), x.copy()
        for _ in range(30):
            scales.update(y, np.zeros(4), stands=True, exchanged=False)
            dynamics.advance(world, np.zeros(4), PERIOD, stage, rates, rates, y)
        arm = -world.walker.reach * np.cos(y[:5])  # of the foot's speed forward
        y[5:] += arm * speed / (arm @ arm)
        scales.update(y, np.zeros(4), stands=stands, exchanged=False)
        assert scales.blow == pytest.approx(felt, abs=0.02) and scales.load == 0.0
        assert scales.weighs == (stands and felt == 0.0)


@pytest.mark.parametrize("noise", [0.05, 0.2, 1.0])
def test_noise_is_no_blow(belief, noise):
    """Of rates, in [rad/s], white: not once in three seconds."""
    q, _ = belief.gait.post_impact(belief.model)
    x = np.concatenate([start.links(q), np.zeros(5)])
    scales, rng = Scales(belief.model, start.world(belief.model), PERIOD, 0.0), np.random.default_rng(7)
    for _ in range(3000):
        scales.update(
            x + np.concatenate([np.zeros(5), rng.normal(0, noise, 5)]), np.zeros(4), stands=True, exchanged=False
        )
        assert scales.blow == 0.0


def test_a_foot_stopped_in_the_air_has_met_a_ledge():
    """How high it is, is a guess until one foot stands on it, and of no matter when both do."""
    ledge = Ledge()
    assert not ledge.met(0.0, 0.2, 0.03, 0.0) and not ledge.met(-2.0, 0.2, 0.003, 0.0)  # no blow; on the ground
    assert not ledge.met(2.0, 0.2, 0.03, 0.0) and ledge.rise == 0.0  # from behind
    assert ledge.met(-2.0, 0.2, 0.03, 0.0)
    assert 0.06 < ledge.rise < 0.1 and 0.18 < ledge.edge < 0.2 and ledge.level == 0.0
    ledge.missed(0.3, 0.05, 0.0)
    assert 0.04 < ledge.rise < 0.05  # the foot is past the edge and feels nothing
    assert ledge.landed(-0.4, -0.045, 0.0)
    assert 0.045 < ledge.rise < 0.07 and ledge.level == -ledge.rise and -0.22 < ledge.edge < -0.2
    assert ledge.met(-2.0, -0.15, -0.01, 0.0) and ledge.edge == pytest.approx(-0.16) and ledge.level < 0.0
    assert not ledge.landed(-0.4, 0.0, 0.0) and ledge.rise == 0.0


def test_a_ledge_that_no_foot_finds_is_forgotten():
    """Whether the foot is past its edge and as low as ever, or has landed there; one that is still ahead is kept."""
    ledge = Ledge()
    assert ledge.met(-2.0, 0.2, 0.03, 0.0)
    ledge.missed(0.3, 0.001, 0.0)
    assert ledge.rise == 0.0
    assert ledge.met(-2.0, 0.2, 0.03, 0.0) and not ledge.landed(-0.4, 0.0, 0.0)
    assert ledge.rise == 0.0
    for foothold in (0.15, 0.199):
        assert ledge.met(-2.0, 0.2, 0.03, 0.0) and not ledge.landed(-foothold, 0.0, 0.0)
        assert ledge.rise > 0.06 and ledge.level == 0.0 and 0.0 < ledge.ramp <= ledge.edge


def test_a_ledge_just_ahead_is_not_under_the_stance_foot(belief):
    """However near its riser is; and the next step of a plan has it where it is from there."""
    ledge, stage = Ledge(), kernels.new_stage()
    assert ledge.met(-2.0, 0.005, 0.03, 0.0)
    walker, terrain = belief.model.lumped, ledge.terrain(0.0)
    assert cost.ledge(terrain, 0.0)[0] == 0.0 and cost.ledge(terrain, 0.01)[0] == ledge.rise
    step = 1e-7
    for ahead in np.linspace(-0.02, 0.02, 41):
        slope = (cost.ledge(terrain, ahead + step)[0] - cost.ledge(terrain, ahead - step)[0]) / (2 * step)
        assert cost.ledge(terrain, ahead)[1] == pytest.approx(slope, abs=0.2)
    before = np.concatenate([start.links(belief.gait.q_minus), np.zeros(5)])
    dynamics.place(before, stage)
    length, above, _ = cost.foot(walker, terrain, stage)
    then = cost.next_terrain(walker, terrain, before, stage)
    assert then.level == -ledge.rise and then.edge == pytest.approx(ledge.edge - length)
    assert above == pytest.approx(-ledge.rise, abs=1e-3)


def test_the_share_goes_over_and_comes_back():
    """In 30 ms either way; back only after a rest in calm; none is ready while all is calm, and none without a plan."""
    share = Share(PlanSettings(), PERIOD)

    def ticks(off, n, found=True):
        for _ in range(n):
            share.look(off)
            share.move(found)
        return share.value

    assert ticks(0.1, 10) == 0.0 and share.resting
    assert ticks(0.5, 1) == 0.0 and not share.resting
    assert ticks(1.2, 15) == pytest.approx(0.5) and ticks(1.2, 20) == 1.0
    assert ticks(0.1, 90) == 1.0 and ticks(0.1, 60) == 0.0 and share.resting
    assert ticks(1.2, 40) == 1.0 and ticks(1.2, 40, found=False) == 0.0
