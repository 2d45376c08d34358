"""C-MPC's weights: what the settings do, and the search over them on a robustness score."""

import json

import numpy as np
import pytest

from sim.bridge.run import build_controller, known_belief
from sim.cli import main
from sim.errors import UserError
from sim.scenario import Scenario, from_toml, with_values
from sim.trials.plan import load_plan
from sim.trials.run import TrialResult
from sim.trials.run.trial import axis_values
from sim.trials.weights import changes, held_out_plan, paired, score, start_from

SAME = (1.0, 1.0, 1.0, 1.0, 1.0, 100.0)
PLAN = """
name = "tiny"
controllers = ["c-mpc"]
[scenario]
steps = 2
controller.horizon = 40
[[montecarlo]]
name = "push"
trials = 1
[[montecarlo.axes]]
paths = ["pushes.0.force"]
also = ["pushes.0.step = 1"]
distribution = "uniform"
low = 20.0
high = 100.0
"""


@pytest.fixture(scope="module")
def plan():
    return load_plan("weights")


def test_weights_are_factors_on_the_papers():
    paper = build_controller(Scenario().controller, known_belief("rabbit", "paper")).weights
    values = {"controller.weights.output": (2.0, 1.0, 3.0, 1.0), "controller.weights.torque": (1.0, 0.5, 1.0, 1.0)}
    scenario = with_values(Scenario(), values | {"controller.weights.output_rate": (1.0, 1.0, 1.0, 0.0)})
    found = build_controller(scenario.controller, known_belief("rabbit", "paper")).weights
    assert found.Q_position / paper.Q_position == pytest.approx([2, 1, 3, 1])
    assert found.Q_velocity / paper.Q_velocity == pytest.approx([1, 1, 1, 0])
    assert found.R / paper.R == pytest.approx([1, 0.5, 1, 1])


def test_the_start_is_the_plans_own_controller(plan):
    assert with_values(plan.scenario, changes(SAME, plan.scenario)) == plan.scenario


def test_a_point_scales_weights_and_sets_the_horizon(plan):
    base = with_values(plan.scenario, {"controller.weights.output": (1.0, 2.0, 0.0, 1.0)})
    found = with_values(base, changes((2.0, 2.0, 5.0, 1.23456, 0.5, 71.4), base)).controller
    assert found.weights.output == (2.0, 4.0, 0.0, 1.23) and found.weights.output_rate == (0.5,) * 4
    assert found.horizon == 71 and found.weights.torque == (1.0,) * 4


def test_held_out_draws_are_others_and_more(plan):
    others = held_out_plan(plan, 3)
    sizes = [sum(study.size for study in some.studies) for some in (plan, others)]
    assert sizes[1] == 3 * sizes[0]
    drawn = [
        {tuple(axis_values(some, i)[1].values()) for i in range(n)}
        for some, n in zip((plan, others), sizes, strict=True)
    ]
    assert [len(values) for values in drawn] == sizes and not drawn[0] & drawn[1]


def test_start_from_takes_the_walker_the_gait_and_the_controller_alone(plan, tmp_path):
    path = tmp_path / "g.toml"
    path.write_text('gait = "L0.40-v0.80"\nsteps = 99\n[controller]\nkp = [70.0, 70.0, 70.0, 70.0]\n')
    found = start_from(plan, str(path))
    assert found.scenario.gait == "L0.40-v0.80" and found.scenario.controller.kp == (70.0,) * 4
    assert found.scenario.steps == plan.scenario.steps and found.montecarlo == plan.montecarlo


def trial(steps, study="push", **fields):
    done = {"outcome": "completed" if steps == 5 else "fell", "survived": steps == 5} | fields
    return TrialResult(controller="c-mpc", trial=0, study=study, values="{}", seed=0, steps=steps, **done)


def test_score_is_the_mean_share_of_steps(plan):
    found = score([trial(5), trial(2), trial(1, "ramp")], plan)
    assert found.value == pytest.approx((1.0 + 0.4 + 0.2) / 3) and (found.survived, found.trials) == (1, 3)
    assert found.studies == pytest.approx({"push": 0.7, "ramp": 0.2})
    with pytest.raises(UserError, match="has no result: no end"):
        score([trial(5), trial(1, outcome="error", message="no end")], plan)


def test_the_gain_is_paired():
    found = paired([trial(5), trial(2), trial(1)], [trial(5), trial(5), trial(2)], steps=5)
    assert found.mean == pytest.approx((0.0 + 0.6 + 0.2) / 3)
    assert found.standard_error == pytest.approx(np.std([0.0, 0.6, 0.2], ddof=1) / np.sqrt(3))
    assert (found.start_alone, found.found_alone, found.p) == (0, 1, 1.0)


def test_a_search_judges_on_draws_held_out_resumes_and_leaves_a_scenario(capsys, tmp_path):
    file, out = tmp_path / "tiny.toml", tmp_path / "w.toml"
    file.write_text(PLAN)
    argv = ["weights", "search", "--plan", str(file), "--held-out", "1", "--workers", "1", "--out", str(out), "--json"]
    assert main([*argv, "--evaluations", "1"]) == 0
    capsys.readouterr()
    first = out.with_suffix(".jsonl").read_text()
    assert main([*argv, "--evaluations", "2"]) == 0
    text, err = capsys.readouterr()
    assert "goes on after 1" in err and out.with_suffix(".jsonl").read_text().startswith(first)
    found = json.loads(text)
    assert found["evaluations"] == 2 and found["found"]["search"]["value"] >= found["start"]["search"]["value"]
    record = [json.loads(line) for line in first.splitlines()[1:]]
    assert 1.0 - record[0]["value"] == pytest.approx(found["start"]["search"]["value"])
    scenario = from_toml(out)
    assert list(scenario.controller.weights.output) == found["found"]["settings"]["controller.weights.output"]
    assert scenario.controller.horizon == found["found"]["settings"]["controller.horizon"]
    assert scenario.controller.kp == Scenario().controller.kp and scenario.pushes == ()
    assert "On draws held out" in out.read_text()


BAD = {
    "evaluations": (["--evaluations", "0"], ["--evaluations 0", "1 or above"]),
    "plan": (["--plan", "wieghts"], ["wieghts", "did you mean weights"]),
    "a plan of grids and margins": (["--plan", "pushes"], ["Monte-Carlo"]),
    "scenario": (["--scenario", "nowhere.toml"], ["nowhere.toml"]),
}


@pytest.mark.parametrize("argv, words", BAD.values(), ids=BAD.keys())
def test_bad_input_is_one_line_and_code_2(capsys, tmp_path, argv, words):
    code = main(["weights", "search", "--out", str(tmp_path / "w.toml"), *argv])
    err = capsys.readouterr().err.strip()
    assert code == 2 and "\n" not in err and all(word in err for word in words), err
    assert not list(tmp_path.iterdir())
