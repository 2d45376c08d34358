"""The second cascade in the loop: it walks, gives back lost speed, keeps its limits, and learns the ground."""

import numpy as np
import pytest

from controller.common.settings import LtvSettings
from controller.ltv.orbit import find_orbit, nominal_rate
from sim.bridge import run as bridge
from sim.interface import Observation
from sim.loop import EachTick
from sim.scenario import Push, Scenario, with_values

LTV = {"controller.kind": "c-mpc-ltv"}
CALM = with_values(Scenario(steps=2), LTV)


class Steps(EachTick):
    """Keeps every tick's decision."""

    def __init__(self):
        self.steps, self.times = [], []

    def tick(self, k, state, observation, step, tick_s):
        self.steps.append(step)

    def event(self, k, level, name, message):
        if name == "impact":
            self.times.append(float(message.split()[4]))


def seen(q, dq, k=0, landed=False):
    return Observation(t=1e-3 * k, q=q, dq=dq, contact=(True, landed))


def walk(scenario):
    tape = Steps()
    return bridge.run_scenario(scenario, tape=tape), tape


@pytest.fixture(scope="module")
def belief():
    return bridge.load_belief(CALM)


def test_the_orbit_is_the_gaits(belief):
    """dtheta* integrates to the step time of the gait, and agrees with the gait's own speed before impact."""
    orbit = find_orbit(belief.model, belief.gait)
    theta = np.linspace(belief.gait.theta_plus, belief.gait.theta_minus, 2001)
    rate = np.array([nominal_rate(orbit, t)[0] for t in theta])
    assert np.sum(np.diff(theta) * (1 / rate[1:] + 1 / rate[:-1]) / 2) == pytest.approx(0.52, abs=0.01)
    assert rate[-1] == pytest.approx(belief.gait.clock @ belief.gait.dq_minus, rel=0.02)
    for t in (theta[0] - 0.05, theta[700], theta[-1] + 0.05):
        value, slope = nominal_rate(orbit, t)
        there = nominal_rate(orbit, t + 1e-6)[0]
        assert (there - value) / 1e-6 == pytest.approx(slope, rel=1e-3, abs=1e-4)


def test_it_walks_undisturbed_and_nearly_leaves_zd_pd_alone():
    summary, tape = walk(CALM)
    assert summary.outcome == "completed" and summary.fallbacks == 0
    assert summary.output_error_rms_rad < 6e-4 and summary.step_time_s == pytest.approx(0.517, abs=0.01)
    # Where the old plan is the answer to the last bit no step lowers the cost, and the tick may say so.
    assert sum(step.status != "optimal" for step in tape.steps) < 0.01 * len(tape.steps)
    limit = np.array([75.0, 75.0, 50.0, 50.0])
    for step in tape.steps:
        assert (np.abs(step.u_total) <= limit + 1e-9).all()
        np.testing.assert_allclose(step.u_total, step.u_zd + step.u_mpc, atol=1e-12)


def test_lost_speed_comes_back():
    """Pushed backward by 20 N throughout the first step, which throws the paper's cascade over."""
    pushed = Scenario(steps=3, pushes=(Push(force=-20.0, step=1),))
    assert walk(pushed)[0].outcome == "fell"
    summary, tape = walk(with_values(pushed, LTV))
    assert summary.outcome == "completed" and summary.fallbacks == 0
    first, _, third = tape.times
    assert first > 0.7 and third < 0.6  # [s]; the gait's is 0.52


def test_it_softens_contact_rows_and_says_so():
    heavy = {"controller.normal_force_min": 600.0, "steps": 1, "time_limit": 0.1}  # [N], twice its weight
    summary, tape = walk(with_values(CALM, heavy))
    assert summary.slack_max_N > 1.0
    assert all(np.isfinite(step.residuals).all() for step in tape.steps)


def test_a_reset_forgets_everything(belief):
    controller = bridge.build_controller(CALM.controller, belief)
    q, dq = belief.gait.post_impact(belief.model)
    dq = dq + 0.2

    def ticks():
        controller.reset("left")
        return [controller.step(seen(q, dq, k)).u_total for k in range(3)]

    first = ticks()
    controller.step(seen(belief.gait.q_minus, belief.gait.dq_minus, landed=True))
    assert controller.stance.leg.value == "right"
    assert all((a == b).all() for a, b in zip(first, ticks(), strict=True))
    assert not (first[0] == first[1]).all()  # the plan of the last tick is the start of the next


def test_the_slope_is_learnt_from_the_feet(belief):
    """A touch-down with the landing foot raised: half of the slope is believed at once, the rest later."""
    controller = bridge.build_controller(CALM.controller, belief)
    q = belief.gait.q_minus.copy()
    q[4] += 0.05  # the whole walker leans back: the swing foot in front rises
    ahead, height, _ = belief.model.swing_foot(q, belief.gait.dq_minus)
    controller.step(seen(q, belief.gait.dq_minus, landed=True))
    assert abs(height) > 0.01
    assert controller.ground.tangent == pytest.approx(0.5 * height / ahead, rel=1e-6)


def test_a_prediction_that_diverges_falls_back_to_saturated_zd_pd(belief):
    controller = bridge.build_controller(CALM.controller, belief)
    q, dq = belief.gait.post_impact(belief.model)
    step = controller.step(seen(q, dq * 1e200))
    assert step.fallback and step.status == "prediction-diverged"


def test_the_log_may_ask_what_is_expected(belief):
    """Tick by tick over 0.3 s, beginning with the present."""
    controller = bridge.build_controller(CALM.controller, belief)
    q, dq = belief.gait.post_impact(belief.model)
    q[0] += 0.05
    step = controller.step(seen(q, dq))
    y, force = step.plan.outputs(), step.plan.contact_forces()
    assert y.shape == (301, 4) and force.shape == (300, 2)
    np.testing.assert_allclose(y[0], step.y, atol=1e-12)
    np.testing.assert_allclose(force[0], step.contact_force, atol=1e-12)
    assert np.abs(y[-1]).max() < 0.5 * np.abs(y[0]).max()


def test_weights_yield_only_where_the_clock_is_slow():
    plain, yielding = LtvSettings(), LtvSettings(yielding=True)
    for faster in (-0.02, 0.0, 0.3):
        assert yielding.weights_at(faster) == plain.weights_at(faster)
    assert yielding.weights_at(-0.12) == yielding.weights_at(-1.0) == (5e3, 1e2)
    middle = yielding.weights_at(-0.07)
    assert all(slow < m < fast for slow, m, fast in zip((5e3, 1e2), middle, plain.weights_at(-0.07), strict=True))
