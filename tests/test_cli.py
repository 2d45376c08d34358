"""The command line: what it runs, what it prints, and one line with exit code 2 for every bad input."""

import dataclasses
import json
import math
import os
import re
import signal
import subprocess
import sys
import types
from pathlib import Path

import pytest

from sim import cli
from sim.loop import RunSummary
from sim.scenario import Push, settings_table, shipped

JOINTS = ("left_hip", "right_hip", "left_knee", "right_knee")
SUMMARY = RunSummary(
    outcome="completed",
    fall_reason="",
    steps=10,
    time_s=5.3,
    step_time_s=0.53,
    step_length_m=0.4,
    peak_torque_Nm=dict.fromkeys(JOINTS, 40.0),
    torque_limit_Nm={"left_hip": 75.0, "right_hip": 75.0, "left_knee": 50.0, "right_knee": math.inf},
    friction_ratio_max=0.41,
    output_error_rms_rad=0.0123,
    mpc_torque_share=0.2,
    solve_ms={"median": 0.5, "p99": 0.9, "max": 1.5},
    tick_ms={"median": 0.8, "p99": 1.1, "max": 2.5},
    fallbacks=3,
    slack_max_N=math.nan,
    realtime_factor=1.2,
)


class FakeRun:
    """Stands for the real run: remembers what it was asked for."""

    def __init__(self):
        self.result = SUMMARY
        self.during = lambda: None
        self.called = False

    def __call__(self, scenario, *, log, progress=None, stop=lambda: None, announce=None, view=False, tape=None):
        self.called, self.scenario, self.log, self.progress = True, scenario, log, progress
        self.during()
        reason = stop()
        if reason:
            return dataclasses.replace(self.result, outcome="interrupted", message=reason)
        return dataclasses.replace(self.result, log=str(log or ""))


@pytest.fixture
def run(monkeypatch, tmp_path):
    fake = FakeRun()
    monkeypatch.setitem(sys.modules, "sim.bridge.run", types.SimpleNamespace(run_scenario=fake))
    monkeypatch.setattr("sim.trials.run.trial.fading", lambda witness, scenario: False)
    monkeypatch.chdir(tmp_path)
    return fake


def call(*argv):
    return cli.main(["run", *argv])


def test_without_arguments_the_default_scenario_runs_and_logs(run, capsys):
    assert call() == 0
    assert run.scenario.name == "push-25N"
    assert run.log.parent == Path("logs") and run.log.parent.is_dir()
    assert re.fullmatch(rf"push-25N-c-mpc-2\d{{7}}T\d{{6}}Z-{os.getpid()}\.mcap", run.log.name)
    out, err = capsys.readouterr()
    words = [
        "completed",
        "10 of 10",
        "0.530 s",
        "0.400 m",
        "40.0 N.m of 75",
        "no limit",
        "0.410",
        "0.6",
        "0.0123",
    ]
    for word in [*words, "median 0.500 ms", "1.20 x real time", "3 ticks", str(run.log)]:
        assert word in out
    assert err == ""


def test_a_default_log_never_takes_an_existing_name(run):
    for _ in range(3):
        call()
        assert not run.log.exists()
        run.log.touch()


def test_flags_override_the_scenario_wherever_the_name_stands(run):
    flags = [
        "--controller",
        "zd-pd",
        "--steps",
        "3",
        "undisturbed",
        "--plant.mass-factor.torso",
        "2",
        "--seed=7",
    ]
    assert call(*flags, "--no-log", "--plant.ground.slope", "-1e-2", "--controller.kp", "1", "2", "3", "4") == 0
    scenario = run.scenario
    assert (scenario.name, scenario.controller.kind, scenario.steps, scenario.seed) == (
        "undisturbed",
        "zd-pd",
        3,
        7,
    )
    assert (scenario.plant.mass_factor.torso, scenario.plant.ground.slope) == (2.0, -0.01)
    assert scenario.controller.kp == (1.0, 2.0, 3.0, 4.0)
    assert run.log is None


def test_underscores_and_hyphens_are_the_same(run):
    assert call("--no_log", "--plant.mass_factor.left_femur=1.5", "--controller.kind", "zd-pd") == 0
    assert run.scenario.plant.mass_factor.left_femur == 1.5


def test_switches_go_both_ways(run):
    assert call("--no-log", "--controller.no-friction-rows", "--plant.no-saturation", "--plant.saturation") == 0
    assert (run.scenario.controller.friction_rows, run.scenario.plant.saturation) == (False, True)


def test_pushes_are_changed_and_added_by_flags(run):
    window = ["--pushes.0.step", "none", "--pushes.0.start", "1", "--pushes.0.end", "1.5"]
    added = [
        "--pushes.1.force",
        "-20",
        "--pushes.1.step",
        "5",
        "--pushes.2.force",
        "1",
        "--pushes.2.step",
        "6",
    ]
    assert call("--no-log", "--pushes.0.force", "30", *window, *added, "--pushes.1.point", "0", "0.1") == 0
    first = Push(force=30.0, start=1.0, end=1.5)
    assert run.scenario.pushes == (
        first,
        Push(force=-20.0, step=5, point=(0.0, 0.1)),
        Push(force=1.0, step=6),
    )


def test_a_scenario_file_runs(run, tmp_path):
    (tmp_path / "hill.toml").write_text("[plant.ground]\nslope = 0.05\n")
    assert call("hill.toml", "--log", "hill.mcap") == 0
    assert (run.scenario.name, run.scenario.plant.ground.slope, run.log) == ("hill", 0.05, Path("hill.mcap"))


def test_json_is_one_object_with_the_fields_of_the_summary_and_nothing_else(run, capsys):
    assert call("--json", "--no-log") == 0
    out, err = capsys.readouterr()

    def refuse(token):
        raise AssertionError(token)

    summary = json.loads(out, parse_constant=refuse)
    assert set(summary) == {field.name for field in dataclasses.fields(RunSummary)}
    assert summary["torque_limit_Nm"]["right_knee"] is None and summary["slack_max_N"] is None
    assert out.count("\n") == 1 and err == ""
    assert run.progress is None


@pytest.mark.parametrize(("outcome", "code"), [("completed", 0), ("fell", 0), ("error", 1)])
def test_a_fall_is_a_result_and_an_error_is_not(run, outcome, code, capsys):
    run.result = dataclasses.replace(SUMMARY, outcome=outcome, fall_reason="the hip [sank]" * (outcome == "fell"))
    assert call("--no-log") == code
    out = capsys.readouterr().out
    assert outcome in out
    assert ("the hip [sank]" in out) == (outcome == "fell")


def test_figures_that_do_not_exist_are_dashes(run, capsys):
    run.result = dataclasses.replace(SUMMARY, step_time_s=None, friction_ratio_max=None, solve_ms={})
    assert call("--no-log") == 0
    assert "None" not in capsys.readouterr().out


@pytest.mark.parametrize(("signum", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_lets_the_run_finish_and_is_reported(run, signum, code, capsys):
    before = signal.getsignal(signum)
    run.during = lambda: os.kill(os.getpid(), signum)
    assert call("--no-log") == code
    assert f"interrupted: interrupted by {signum.name}" in capsys.readouterr().out
    assert signal.getsignal(signum) is before


def test_a_second_signal_does_not_wait(run, capsys):
    run.during = lambda: [os.kill(os.getpid(), signal.SIGINT) for _ in range(2)]
    assert call("--no-log") == 130
    assert capsys.readouterr().err == "cmpc: interrupted\n"


def test_help_shows_every_setting_with_its_unit_and_the_scenarios_own_values(run, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "400")
    assert call("friction-50N", "--help-all") == 0
    out = capsys.readouterr().out
    lines = {line.split()[0].rstrip(","): line for line in out.splitlines() if line.startswith("  --")}
    for row in settings_table():
        flag = "--" + row.path.replace("_", "-")
        line = lines["--controller" if row.path == "controller.kind" else flag]
        if row.spec.unit:
            assert f"{flag} {row.spec.unit}" in line or line.rstrip().endswith(row.spec.unit)
        assert row.spec.help in " ".join(out.split())
    assert "--pushes.0.force N" in out and "(default: 50)" in out and "(default: 2)" in out
    assert not run.called


def test_list_names_each_shipped_scenario(run, capsys):
    assert call("--list") == 0
    out = capsys.readouterr().out
    for name, description in shipped().items():
        assert f"{name} " in out and description in out


BAD = {
    "--plant.timestp 1e-3": ["--plant.timestp", "did you mean --plant.timestep"],
    "undisturbed push-25N": ["push-25N"],
    "push-25": ["push-25", "did you mean push-25N", "undisturbed"],
    "none.toml": ["none.toml", "cannot be read"],
    "bad.toml": ["bad.toml", "plant.slop"],
    "--steps ten": ["--steps = 'ten'", "integer", "[steps]"],
    "--steps 1.5": ["--steps = '1.5'", "integer"],
    "--steps": ["--steps", "expected", "[steps]"],
    "--steps 0": ["--steps = 0 steps"],
    "--seed -1": ["--seed = -1"],
    "--controller pd": ["--controller.kind = 'pd'", "c-mpc, zd-pd"],
    "--controller.horizon 0": ["--controller.horizon = 0 ticks"],
    "--controller.kp 1 2 3": ["--controller.kp", "4", "[1/s^2]"],
    "--controller.friction -0.1": ["--controller.friction = -0.1", "[ratio]"],
    "--controller.period nan": ["--controller.period = nan s"],
    "--plant.timestep 0": ["--plant.timestep = 0.0 s", "above 0"],
    "--plant.timestep 3e-4": ["--plant.timestep = 0.0003 s", "0.001 s"],
    "--plant.mass-factor.torso 0": ["--plant.mass_factor.torso = 0.0", "above 0", "[ratio]"],
    "--plant.mass-factor.torso -1e-3": ["--plant.mass_factor.torso = -0.001"],
    "--plant.ground.friction -inf": ["--plant.ground.friction = -inf", "[ratio]"],
    "--pushes.0.body head": ["--pushes.0.body = 'head'", "torso"],
    "--pushes.0.force nan": ["--pushes.0.force = nan N", "[N]"],
    "--pushes.0.start 1": ["--pushes.0", "step = 2", "[s]"],
    "--pushes.1.step 3": ["--pushes.1.force: missing", "[N]"],
    "--pushes.5.force 3": ["--pushes.5.force", "0 to 1"],
    "--log there.mcap": ["--log there.mcap", "never overwritten"],
    "--log nowhere/x.mcap": ["--log nowhere/x.mcap", "nowhere"],
    "--log there.mcap/x.mcap": ["--log there.mcap/x.mcap"],
    "--log /proc/x.mcap": ["--log /proc/x.mcap"],
    "--log x.mcap --no-log": ["--no-log", "--log"],
}


@pytest.mark.parametrize("line", BAD)
def test_bad_input_is_one_line_and_exit_code_2(run, line, capsys, tmp_path):
    (tmp_path / "bad.toml").write_text("[plant]\nslop = 1\n")
    (tmp_path / "there.mcap").write_text("precious")
    assert call(*line.split()) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert err.startswith("cmpc: error: ") and "Traceback" not in err
    for words in BAD[line]:
        assert words in err
    assert not run.called
    assert (tmp_path / "there.mcap").read_text() == "precious"


def test_an_unmakeable_log_folder_is_an_error(run, tmp_path, capsys):
    (tmp_path / "logs").write_text("a file")
    assert call() == 2
    assert "logs" in capsys.readouterr().err


def test_an_unknown_command_is_refused_with_the_nearest(capsys):
    assert cli.main(["runn"]) == 2
    assert "did you mean run?" in capsys.readouterr().err


ACTIONS = {
    "gait": ("design", "check", "compare", "polish", "library"),
    "gains": ("search",),
    "weights": ("search",),
    "walker": ("new", "check"),
    "log": ("info", "check", "recover", "export", "compare"),
}


@pytest.mark.parametrize("command", ACTIONS)
def test_each_action_has_its_help_and_a_mistyped_one_is_refused_with_the_nearest(command, capsys):
    assert cli.main([command]) == 0
    listed = capsys.readouterr().out
    for action in ACTIONS[command]:
        assert action in listed
        assert cli.main([command, action, "--help"]) == 0
        assert capsys.readouterr().out.startswith(f"usage: cmpc {command} {action} ")
        assert cli.main([command, action[:-1]]) == 2
        assert f"cmpc {command} {action[:-1]}: unknown; did you mean {action}?" in capsys.readouterr().err


@pytest.mark.parametrize(
    "line", ["bench --quik", "gait check paper --jsn", "log info x --jsn", "trials report x --ou y"]
)
def test_a_mistyped_option_of_any_command_is_one_line_with_the_nearest(line, capsys):
    assert cli.main(line.split()) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "unknown option --" in err


@pytest.mark.parametrize("argv", [[], ["--help"]])
def test_help_lists_each_command(argv, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert cli.main(argv) == 0
    out = capsys.readouterr().out
    for name, line in cli.COMMANDS.items():
        assert name in out and line in out


def test_start_up_loads_no_engine_and_module_is_the_same_program():
    code = (
        "import sys, runpy; sys.argv = ['cmpc', 'run', '--help']\n"
        "try: runpy.run_module('sim', run_name='__main__')\n"
        "except SystemExit as end: assert end.code == 0\n"
        "heavy = {'mujoco', 'numba', 'numpy', 'pinocchio', 'qpsolvers', 'mcap', 'controller.common.records', 'rich'}\n"
        "sys.exit(str(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: cmpc run")
