"""The answer first: the cause of a fall and its moment, told of a run and of its log alike, and what was run."""

import json
import re

import numpy as np
import pytest

from sim.bridge.run import run_scenario
from sim.cli import main
from sim.interface import JOINTS
from sim.review import load
from sim.review.answer import answer
from sim.review.facts import changed_settings, description
from sim.scenario import load as load_scenario
from sim.scenario import with_values
from sim.trials.falls.recorded import recorded_verdict
from sim.trials.falls.witness import Witness

FALLS = {
    "start": {"start.torso_lean": 0.9, "controller.kind": "zd-pd"},
    "later": {"start.torso_lean": -1.1},
    "push": {"pushes.0.force": 150.0, "pushes.0.step": 1, "controller.kind": "zd-pd"},
    "landed": {"pushes.0.force": 25.0, "pushes.0.step": 2, "controller.kind": "zd-pd"},
    "downhill": {"plant.ground.slope": -0.15},
    "backward": {"pushes.0.force": -120.0, "pushes.0.step": 1, "controller.kind": "zd-pd"},
}


@pytest.fixture(scope="module")
def falls(tmp_path_factory):
    """Name -> (witness of the run, its summary, its log)."""
    folder, found = tmp_path_factory.mktemp("falls"), {}
    for name, changes in FALLS.items():
        scenario = with_values(load_scenario("undisturbed"), {"steps": 8} | changes)
        witness = Witness(scenario.controller.period)
        summary = run_scenario(scenario, log=folder / f"{name}.mcap", tape=witness)
        assert summary.outcome == "fell"
        found[name] = witness, summary, folder / f"{name}.mcap"
    return found


@pytest.mark.parametrize("name", FALLS)
def test_a_log_tells_the_cause_and_the_figures_that_the_run_told(falls, name):
    witness, summary, path = falls[name]
    cause, evidence = witness.verdict(np.array([summary.torque_limit_Nm[joint] for joint in JOINTS]))
    logged, its = recorded_verdict(load(path))
    assert logged is cause
    for field in evidence.__dataclass_fields__:
        there, here = getattr(evidence, field), getattr(its, field)
        assert there == here if isinstance(there, str) else here == pytest.approx(there, abs=1e-6, nan_ok=True), field


def test_run_log_info_and_page_say_it_in_one_sentence(falls, capsys, tmp_path):
    _, _, path = falls["push"]
    sentence, moment = answer(load(path))
    assert re.match(r"fell in step \d+: from \d\.\d{3} s \w+: .*; down \d\.\d\d s later", sentence)
    assert main(["log", "info", str(path)]) == 0
    assert capsys.readouterr().out.startswith(sentence)
    assert main(["log", "info", str(path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["answer"], told["fall_began_s"]) == (sentence, moment)
    push = ["--pushes.0.force", "150", "--pushes.0.step", "1", "--controller", "zd-pd", "--steps", "8"]
    assert main(["run", "undisturbed", *push, "--no-log", "--quiet"]) == 0
    assert sentence.partition(": ")[2].split(",")[0] in capsys.readouterr().out
    assert main(["review", str(path), "--no-open", "--out", str(tmp_path / "x.html")]) == 0
    data = re.search(r'<script id="data" type="application/json">(.*?)</script>', (tmp_path / "x.html").read_text())
    run = json.loads(data[1])["runs"][0]
    assert (run["head"]["answer"], run["began"]) == (sentence, moment)


def test_a_walk_says_how_near_it_came_to_its_limits(tmp_path):
    run_scenario(with_values(load_scenario("undisturbed"), {"steps": 2}), log=tmp_path / "walk.mcap")
    run = load(tmp_path / "walk.mcap")
    words, moment = answer(run)
    peak = max(run.result["peak_torque_Nm"][joint] / run.result["torque_limit_Nm"][joint] for joint in JOINTS)
    told = re.match(r"walked all 2 steps; nearest to its limits: \w+ \w+ ([\d.]+) of ([\d.]+) N.m at", words)
    assert moment is None and float(told[1]) / float(told[2]) == pytest.approx(peak, abs=2e-3)
    assert "|F_T / F_N|" in words
    least = float(run["/control"]["dtheta"].min())
    assert f"clock down to {least:.2f} rad/s at" in words and "mm above the ground at" in words


def test_the_description_is_of_what_was_run():
    named = load_scenario("push-40N-first")
    assert description(named) == named.description and changed_settings(named) == []
    other = with_values(named, {"pushes.0.force": 90.0, "plant.ground.slope": 0.05})
    assert changed_settings(other) == [("plant.ground.slope", "0 rad", "0.05 rad"), ("pushes.0.force", "40 N", "90 N")]
    added = with_values(load_scenario("undisturbed"), {"pushes.0.force": 90.0, "pushes.0.step": 1})
    assert changed_settings(added) == [("pushes.0.force", "-", "90 N"), ("pushes.0.step", "-", "1 step")]
    assert "pushes.0.force = 90 N (not 40 N)" in description(other) and named.description not in description(other)
