"""The rivals in the loop: they walk, keep the torque limits, repeat, take part in trials, and fall back by name."""

import pickle

import numpy as np
import pytest

from controller.cmpc.zero_dynamics import zero_dynamics_pd
from controller.common.records import Leg
from controller.rivals import dense_qp
from sim.bridge import run as bridge
from sim.interface import Observation
from sim.loop import EachTick
from sim.scenario import Scenario, with_values
from sim.trials.plan.plan import from_toml
from sim.trials.run import TrialSpec, run_trial
from sim.trials.run.result import result_without_times

KINDS = ("clf-qp", "output-mpc")
LIMIT = np.array([75.0, 75.0, 50.0, 50.0])  # [N.m]


class Steps(EachTick):
    """Keeps every tick's decision."""

    def __init__(self):
        self.steps = []

    def tick(self, k, state, observation, step, tick_s):
        self.steps.append(step)


def scenario(kind, **changes):
    return with_values(Scenario(steps=5), {"controller.kind": kind, **changes})


@pytest.fixture(scope="module")
def belief():
    return bridge.load_belief(Scenario())


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


@pytest.fixture
def controller(kind, belief):
    found = bridge.build_controller(scenario(kind).controller, belief)
    found.reset("left")
    return found


def seen(q, dq, contact=(True, False)):
    return Observation(t=0.0, q=q, dq=dq, contact=contact)


def test_it_walks_within_the_torque_limits_and_repeats(kind, belief):
    tape = Steps()
    summary = bridge.run_scenario(scenario(kind), tape=tape, belief=belief)
    assert summary.outcome == "completed" and summary.fallbacks == 0
    assert summary.step_length_m == pytest.approx(0.404, abs=0.01)
    assert summary.output_error_rms_rad < 5e-3
    for step in tape.steps:
        assert (np.abs(step.u_total) <= LIMIT + 1e-9).all()
        np.testing.assert_allclose(step.u_total, step.u_zd + step.u_mpc, atol=1e-12)
        assert np.isfinite(step.residuals).all() and step.residuals.max() < 1e-4
    assert {step.stance for step in tape.steps} == {"left", "right"}
    assert bridge.run_scenario(scenario(kind), belief=belief).state_digest == summary.state_digest


def test_it_walks_in_a_trial(kind):
    plan = from_toml(f"""
controllers = ["{kind}"]
[scenario]
steps = 1
[[grid]]
[[grid.axes]]
paths = ["pushes.0.force"]
also = ["pushes.0.step = 1"]
values = [-5, 5]
""")
    spec = pickle.loads(pickle.dumps(TrialSpec(plan=plan, controller=kind, index=1)))
    result = run_trial(spec)
    assert result.outcome == "completed", result.message
    assert result_without_times(result) == result_without_times(run_trial(spec))


def test_it_speaks_body_order(kind, belief, controller, walking_states):
    """Mirroring what is seen mirrors what is done."""
    mirrored = bridge.build_controller(scenario(kind).controller, belief)
    mirrored.reset("right")
    swap = Leg.RIGHT.from_body
    for q, dq in walking_states(20):
        a = controller.step(seen(q, dq))
        b = mirrored.step(seen(swap(q), swap(dq), (False, True)))
        assert (a.stance, b.stance) == ("left", "right")
        assert np.array_equal(swap(b.u_total), a.u_total) and np.array_equal(b.contact_force, a.contact_force)


def test_the_feed_forward_alone_keeps_the_outputs_at_rest(controller, belief, walking_states):
    """u_zd is the torque that leaves every output unaccelerated: ZD+PD without its PD."""
    for q, dq in walking_states(20):
        step = controller.step(seen(q, dq))
        h = 1e-4  # [s]
        ddq = belief.model.acceleration(q, dq, step.u_zd)
        rates = [controller.step(seen(q + t * dq, dq + t * ddq)).dy for t in (-h, h)]
        scale = 1.0 + np.abs(dq).max() ** 3
        assert (rates[1] - rates[0]) / (2 * h) == pytest.approx(np.zeros(4), abs=1e-4 * scale)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_numbers_that_overflow_are_a_named_fall_back(controller, belief):
    q, dq = belief.gait.post_impact(belief.model)
    step = controller.step(seen(q, dq * 1e200))
    assert step.fallback and step.status == "prediction-diverged"


def test_a_qp_without_answer_falls_back_to_saturated_zd_pd(controller, loop, walking_states, monkeypatch):
    monkeypatch.setattr(dense_qp, "solve", lambda problem, applied: dense_qp.no_answer(len(problem.q), "no-solution"))
    for q, dq in walking_states(10):
        step = controller.step(seen(q, dq))
        assert step.fallback and step.status == "no-solution"
        expected = np.clip(zero_dynamics_pd(loop, q, dq).u, -LIMIT, LIMIT)
        assert step.u_total == pytest.approx(expected, rel=1e-8, abs=1e-7)
