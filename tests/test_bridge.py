"""The two worlds put together: runs repeat, logs survive, and a third controller walks in the same loop."""

import dataclasses
import json
import shutil
import tomllib

import numpy as np
import pytest
from conftest import RABBIT
from fakes import control_step

from controller import laws
from controller.belief import WalkerModel, load_gait
from sim.bridge import run as bridge
from sim.interface import COORDINATES
from sim.log.read import read_log
from sim.loop import Course, Loop, NoTape
from sim.scenario import Push, Scenario, from_toml, with_value, with_values

KINDS = ("c-mpc", "zd-pd")
PUSHED = Scenario(name="short", steps=2, seed=5, pushes=(Push(force=25.0, step=2),))
SHORT = with_values(PUSHED, {"controller.horizon": 20})


def run(scenario, log=None, **how):
    return bridge.run_scenario(scenario, log=log, **how)


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    """Two logs of one scenario for each controller."""
    folder = tmp_path_factory.mktemp("logs")
    found = {}
    for kind in KINDS:
        scenario = with_value(SHORT, "controller.kind", kind)
        summaries = [run(scenario, folder / f"{kind}-{i}.mcap") for i in range(2)]
        found[kind] = summaries, [read_log(summary.log) for summary in summaries]
    return found


TIMED = {"/timing"}


@pytest.mark.parametrize("kind", KINDS)
def test_same_scenario_and_seed_give_the_same_bytes_in_every_channel_but_timing(twice, kind):
    (a, b), (first, second) = twice[kind]
    assert a.outcome == "completed" and a.steps == 2
    assert set(first.channels) == set(second.channels) and TIMED < set(first.channels)
    for topic in set(first.channels) - TIMED:
        assert first.records(topic) == second.records(topic), topic
    assert first.attachments == second.attachments
    timed = {"solve_ms", "tick_ms", "realtime_factor", "log"}
    same = [{k: v for k, v in dataclasses.asdict(s).items() if k not in timed} for s in (a, b)]
    assert same[0] == same[1]


@pytest.mark.parametrize("kind", KINDS)
def test_log_holds_every_tick_of_the_run(twice, kind):
    (summary, _), (log, _) = twice[kind]
    assert log.complete
    ticks = round(summary.time_s / SHORT.controller.period)
    state, control = log.channel("/plant/state"), log.channel("/control")
    for topic in ("/plant/state", "/control", "/mpc", "/timing"):
        assert len(log.channel(topic)) == ticks
    assert np.array_equal(control["_time_ns"], np.arange(ticks) * 1_000_000)
    for name in COORDINATES:  # ideal sensors: what is seen is the truth
        assert np.array_equal(control[f"observation.q.{name}"], state[f"q.{name}"])
    y = np.column_stack([control[f"y.{n}"] for n in ("stance_hip", "swing_hip", "stance_knee", "swing_knee")])
    assert np.sqrt(np.mean(y**2)) == pytest.approx(summary.output_error_rms_rad)
    assert json.loads(log.metadata["result"]["steps"]) == 2 and log.metadata["result"]["outcome"] == "completed"
    assert sum(m.name == "impact" for _, m in log.messages("/events")) == 2


def test_controllers_differ_as_they_should(twice):
    (c_mpc, _), (log, _) = twice["c-mpc"]
    (zd_pd, _), _ = twice["zd-pd"]
    assert c_mpc.mpc_torque_share > 0.0 and zd_pd.mpc_torque_share == 0.0
    assert c_mpc.solve_ms["median"] > 0.0 and zd_pd.solve_ms["median"] == 0.0
    assert c_mpc.output_error_rms_rad < zd_pd.output_error_rms_rad
    control = log.channel("/control")
    for joint, limit in c_mpc.torque_limit_Nm.items():
        assert np.abs(control[f"u_total.{joint}"]).max() <= limit + 1e-6
        total = control[f"u_zd.{joint}"] + control[f"u_mpc.{joint}"]
        assert control[f"u_total.{joint}"] == pytest.approx(total, abs=1e-9)  # Eq. (23)


def test_held_torque_is_the_commanded_one_clipped(twice):
    """Zero-order hold: what the actuators did over a tick is what was commanded at its start, clipped."""
    for kind in KINDS:
        (summary, _), (log, _) = twice[kind]
        control, state = log.channel("/control"), log.channel("/plant/state")
        for joint, limit in summary.torque_limit_Nm.items():
            commanded = np.clip(control[f"u_total.{joint}"], -limit, limit)
            assert state[f"torque.{joint}"][1:] == pytest.approx(commanded[:-1], abs=1e-9)


def test_the_push_acts_in_the_second_step_alone(twice):
    _, (log, _) = twice["c-mpc"]
    state = log.channel("/plant/state")
    pushed = np.flatnonzero(state["push.x"])
    impacts = [t // 1_000_000 for t, m in log.messages("/events") if m.name == "impact"]
    # Logged is the push of the hold before each tick.
    assert pushed[0] == impacts[0] + 1 and pushed[-1] == len(state) - 1
    assert (state["push.x"][pushed] == 25.0).all()


def test_a_log_is_enough_to_run_it_again(twice, tmp_path):
    """From the attachments alone: same scenario, same walker, same gait, same bytes."""
    _, (log, _) = twice["c-mpc"]
    folder = tmp_path / "rabbit"
    (folder / "gaits").mkdir(parents=True)
    for name, (_, data) in log.attachments.items():
        (folder / ("gaits" if name == "paper.toml" else ".") / name).write_bytes(data)
    (text,) = [d for n, (_, d) in log.attachments.items() if n.endswith(".toml") and n != "paper.toml"]
    again = dataclasses.replace(from_toml(text.decode()), walker=f"{folder}/")
    assert dataclasses.replace(again, walker="rabbit") == SHORT
    repeated = read_log(run(again, tmp_path / "again.mcap").log)
    for topic in ("/plant/state", "/control", "/mpc"):
        assert repeated.records(topic) == log.records(topic)


def test_a_stopped_run_has_a_finished_log(tmp_path):
    ticks = []

    def stop():
        ticks.append(None)
        return "interrupted by SIGTERM" if len(ticks) > 30 else None

    summary = run(SHORT, tmp_path / "x.mcap", stop=stop)
    assert (summary.outcome, summary.message) == ("interrupted", "interrupted by SIGTERM")
    log = read_log(tmp_path / "x.mcap")
    assert log.complete and len(log.channel("/control")) == 30
    assert log.metadata["result"]["outcome"] == "interrupted"


def test_a_crash_in_mid_run_leaves_a_readable_log(tmp_path, monkeypatch):
    class Crashing:
        def __init__(self, inner):
            self.inner, self.k = inner, 0

        def reset(self, stance):
            self.inner.reset(stance)
            self.k = 0

        def step(self, observation):
            self.k += 1
            if self.k > 250:
                raise ZeroDivisionError("a bug")
            return self.inner.step(observation)

    build = bridge.build_controller
    monkeypatch.setattr(bridge, "build_controller", lambda *args, **named: Crashing(build(*args, **named)))
    with pytest.raises(ZeroDivisionError):
        run(with_value(SHORT, "controller.kind", "zd-pd"), tmp_path / "x.mcap")
    log = read_log(tmp_path / "x.mcap")
    assert len(log.channel("/control")) == 250
    assert "result" not in log.metadata
    assert any("ZeroDivisionError: a bug" in m.message for _, m in log.messages("/events"))


def test_a_solver_that_never_answers_walks_on_zd_pd_and_is_counted(tmp_path, monkeypatch):
    from controller.qp.problem import failed

    class Mute:
        def reset(self):
            pass

        def solve(self, problem):
            return failed(SHORT.controller.horizon, "no-solution")

    monkeypatch.setattr(laws, "make_solver", lambda *args: Mute())
    calm = dataclasses.replace(SHORT, pushes=(), steps=1)
    summary = run(calm, tmp_path / "x.mcap")
    log = read_log(tmp_path / "x.mcap")
    ticks = len(log.channel("/control"))
    assert summary.fallbacks == ticks and log.channel("/control")["fallback"].all()
    plain = run(with_value(calm, "controller.kind", "zd-pd"))
    assert (summary.steps, summary.time_s) == (plain.steps, plain.time_s)
    assert summary.output_error_rms_rad == pytest.approx(plain.output_error_rms_rad, rel=1e-6)


class Stiff:
    """A third controller: hold the posture of the start by joint PD. It needs nothing but the Protocol."""

    def __init__(self, q):
        self.q = q

    def reset(self, stance):
        self.stance = stance

    def step(self, observation):
        u = 800.0 * (self.q - observation.q)[:4] - 20.0 * observation.dq[:4]
        return control_step(stance=self.stance, u_zd=u, u_total=u, status="posture")


def test_a_third_controller_needs_the_protocol_alone():
    belief, plant = bridge.load_belief(SHORT), bridge.build_plant(SHORT)
    q, _ = bridge.start_state(SHORT, belief)
    summary = Loop(
        plant=plant,
        controller=Stiff(q),
        course=Course(q=q, dq=np.zeros(5), steps=1, end_time=3.0),
        tape=NoTape(),
    ).run()
    assert summary.outcome == "fell"  # a stiff walker on one point foot is a pendulum
    assert 0.1 < summary.time_s < 3.0 and max(summary.peak_torque_Nm.values()) > 1.0


def test_start_is_the_gaits_state_after_impact_with_the_offsets(model):
    belief = bridge.load_belief(SHORT)
    q, dq = bridge.start_state(SHORT, belief)
    gait = load_gait(RABBIT / "gaits" / "paper.toml", WalkerModel(RABBIT / "rabbit.urdf"))
    q0, dq0 = gait.post_impact(model)
    assert np.array_equal(q, q0) and np.array_equal(dq, dq0)
    moved = with_values(
        SHORT, {"start.torso_offset": 0.1, "start.q_offset": (1, 2, 3, 4, 5), "start.dq_offset": (5, 4, 3, 2, 1)}
    )
    q1, dq1 = bridge.start_state(moved, belief)
    assert q1 - q == pytest.approx([1, 2, 3, 4, 5.1]) and dq1 - dq == pytest.approx([5, 4, 3, 2, 1])


def test_a_leaning_torso_leaves_the_legs_where_they_are():
    belief = bridge.load_belief(SHORT)
    states = []
    for lean in (0.0, 0.2):
        scenario = with_values(SHORT, {"start.torso_lean": lean})
        plant = bridge.build_plant(scenario)
        plant.reset(*bridge.start_state(scenario, belief), "left")
        states.append(plant.state())
    upright, leaning = states
    assert leaning.q[-1] - upright.q[-1] == pytest.approx(0.2)
    assert leaning.foot == pytest.approx(upright.foot) and leaning.hip == pytest.approx(upright.hip)


def test_belief_knows_nothing_of_the_plants_errors():
    """Whatever is wrong with the plant, controller and start are the same."""
    wrong = with_values(SHORT, {"plant.mass_factor.torso": 2.0, "plant.ground.slope": 0.05})
    a, b = bridge.load_belief(SHORT), bridge.load_belief(wrong)
    assert a.model.lumped.mass == b.model.lumped.mass
    assert np.array_equal(bridge.start_state(SHORT, a)[1], bridge.start_state(wrong, b)[1])
    assert bridge.build_plant(wrong).model.body_mass.sum() == pytest.approx(a.model.lumped.mass + 12.0)


@pytest.mark.parametrize("edited", ["rabbit.urdf", "gaits/mine.toml", "gaits/L0.40-v0.80.toml"])
def test_a_belief_is_read_again_where_a_file_of_it_was_edited(tmp_path, edited):
    folder = tmp_path / "rabbit"
    shutil.copytree(RABBIT, folder)
    shutil.copy(folder / "gaits" / "paper.toml", folder / "gaits" / "mine.toml")
    before = bridge.known_belief(str(folder), "mine")
    assert bridge.known_belief(str(folder), "mine") is before
    with (folder / edited).open("a") as file:
        file.write("\n")
    assert bridge.known_belief(str(folder), "mine") is not before


def test_a_gait_of_another_folder_is_used(tmp_path):
    text = (RABBIT / "gaits" / "paper.toml").read_text().replace('name = "paper"', 'name = "mine"')
    (tmp_path / "mine.toml").write_text(text)
    belief = bridge.load_belief(dataclasses.replace(SHORT, gait=str(tmp_path / "mine.toml")))
    assert belief.gait.name == "mine"
    shutil.copytree(RABBIT, tmp_path / "rabbit")
    moved = bridge.load_belief(dataclasses.replace(SHORT, walker=str(tmp_path / "rabbit")))
    assert moved.model.path == tmp_path / "rabbit" / "rabbit.urdf"
    assert tomllib.loads(text)["degree"] == moved.gait.alpha.shape[1] - 1
