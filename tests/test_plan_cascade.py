"""The third cascade in the loop: calm on the gait, on the plan under a push, the same again and again."""

import numpy as np
import pytest

from controller.plan import planner, solve
from sim.bridge import run as bridge
from sim.loop import NoTape
from sim.scenario import Push, Scenario, with_values

PLAN = {"controller.kind": "c-mpc-plan", "plant.ground.friction": 0.8}
BACK = with_values(Scenario(steps=2, pushes=(Push(force=-40.0, body="torso", step=1),)), PLAN)


class Ticks(NoTape):
    """Keeps every tick's decision and figures, and now and then what is expected."""

    frame_every = 50

    def __init__(self):
        self.steps, self.figures, self.expected = [], [], {}

    def ticks(self, ticks):
        self.steps.append(ticks.step.copy())
        self.figures += [dict(ticks.diagnostics[k]) for k in range(ticks.first, ticks.first + len(ticks))]
        self.expected |= {k: frame.plan for k, frame in ticks.frames.items() if frame.plan is not None}


class Steps(NoTape):
    """Keeps every tick's torque."""

    def __init__(self):
        self.torques = []

    def ticks(self, ticks):
        self.torques.append(ticks.step["u_total"].copy())


def walk(scenario):
    tape = Ticks()
    summary = bridge.run_scenario(scenario, tape=tape)
    return summary, np.concatenate(tape.steps), tape.figures, tape.expected


def of(figures, name):
    return np.array([tick[name] for tick in figures])


@pytest.fixture(scope="module")
def pushed():
    return walk(BACK)


def test_it_stands_on_a_push_that_throws_the_second_cascade_over(pushed):
    """40 N backward through the first step: it takes its time and walks on; c-mpc-ltv falls."""
    summary, _, figures, _ = pushed
    assert summary.outcome == "completed"
    assert of(figures, "plan followed").max() == 1.0 and of(figures, "plan time left [s]").max() > 0.8
    second = bridge.run_scenario(with_values(BACK, {"controller.kind": "c-mpc-ltv"}))
    assert second.outcome == "fell"


def test_torques_keep_their_limits_and_sum_up(pushed):
    """Whatever share the plan has, u_zd + u_mpc is the torque, and it is one the motors have."""
    _, steps, _, _ = pushed
    assert (np.abs(steps["u_total"]) <= [75.0, 75.0, 50.0, 50.0]).all()
    np.testing.assert_allclose(steps["u_zd"] + steps["u_mpc"], steps["u_total"], rtol=0, atol=1e-9)


def test_it_knows_a_load_from_a_push():
    """Four times the torso's mass: told within 50 ms, and walked with; as a push it would throw it over at once."""
    heavy = with_values(Scenario(steps=3), PLAN | {"plant.mass_factor.torso": 4.0})
    summary, _, figures, _ = walk(heavy)
    assert summary.outcome == "completed"
    load, push = of(figures, "plan load [kg]"), of(figures, "plan push [N]")
    assert (np.abs(load[50:] - 36.0) < 6.0).all() and np.abs(push).max() < 25.0


def test_it_steps_over_a_ledge_that_it_stumbles_on():
    """6 cm up that nobody told of: the foot meets the riser, is lifted over it, and so is the other one."""
    ledge = {"plant.ground.ledges.0.height": 0.06, "plant.ground.ledges.0.position": 1.0}
    summary, _, figures, _ = walk(with_values(Scenario(steps=6), PLAN | ledge))
    assert summary.outcome == "completed"
    believed, followed = of(figures, "plan ledge [m]"), of(figures, "plan followed")
    assert believed[:1300].max() == 0.0 < believed.max() < 0.1 and followed.max() == 1.0
    assert believed[-1] == followed[-1] == 0.0  # and all is calm again
    second = bridge.run_scenario(with_values(Scenario(steps=6), PLAN | ledge | {"controller.kind": "c-mpc-ltv"}))
    assert second.outcome == "fell"


def test_the_same_bytes_again(pushed):
    """No wall clock: planning takes simulated time."""
    _, steps, figures, _ = pushed
    _, again, same, _ = walk(BACK)
    assert (steps["u_total"] == again["u_total"]).all() and figures == same


def test_calm_it_is_the_second_cascade():
    """Undisturbed: not one torque is the plan's."""
    _, steps, figures, _ = walk(with_values(Scenario(time_limit=0.3), PLAN))
    assert (of(figures, "plan followed") == 0.0).all() and (of(figures, "plan made") == 0.0).all()
    tape = Steps()
    bridge.run_scenario(with_values(Scenario(time_limit=0.3), PLAN | {"controller.kind": "c-mpc-ltv"}), tape=tape)
    second = np.clip(np.concatenate(tape.torques), [-75, -75, -50, -50], [75, 75, 50, 50])
    np.testing.assert_allclose(steps["u_total"], second, rtol=0, atol=1e-9)


def test_a_plan_is_used_after_its_delay():
    """Walks with and without a delay part, at the latest when the first plan under a push is used."""
    one = with_values(BACK, {"time_limit": 0.1, "controller.plan.delay": 0.0})
    _, at_once, _, _ = walk(one)
    _, later, _, _ = walk(with_values(one, {"controller.plan.delay": 0.02}))
    differ = np.flatnonzero((at_once["u_total"] != later["u_total"]).any(axis=1))
    assert 0 < differ[0] < 100


def test_what_it_expects_comes_true(pushed):
    """Outputs and forces told ahead on the plan are those of the run 50 ms later, before another plan knows better."""
    _, steps, figures, expected = pushed
    share, left = of(figures, "plan followed"), of(figures, "plan time left [s]")
    known = [k for k in expected if share[k] == 1.0 and left[k] > 0.1 and k + 50 < len(steps)]
    assert len(known) > 10
    off = [np.abs(expected[k].outputs()[50] - steps["y"][k + 50]).max() for k in known]
    assert np.median(off) < 0.02
    for k in known:
        assert len(expected[k].outputs()) == len(expected[k].contact_forces()) + 1
        np.testing.assert_allclose(expected[k].outputs()[0], steps["y"][k], rtol=0, atol=1e-9)
        np.testing.assert_allclose(expected[k].contact_forces()[0], steps["contact_force"][k], rtol=0, atol=3.0)


def test_a_plan_that_is_lost_is_said(monkeypatch):
    """The law on the gait takes over, and the tick that found no plan is flagged."""
    made = []

    def improve(*args):
        made.append(args)
        figures = solve.improve(*args)
        return figures._replace(found=False) if len(made) > 8 else figures

    monkeypatch.setattr(planner, "improve", improve)
    _, steps, figures, _ = walk(with_values(BACK, {"time_limit": 0.25}))
    lost, share = steps["fallback"] > 0, of(figures, "plan followed")
    assert share.max() == 1.0 and share[-1] == 0.0
    assert lost.any() and (of(figures, "plan made")[lost] == 1.0).all()
