"""Controllers from outside: everything takes them, and what they do wrong is one line that names file and line."""

import json
import math
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT

from controller import guard
from controller.common import outside
from controller.common.records import observation_of, write_step
from sim import cli
from sim.bench.outside import outside_path
from sim.bridge.controllers import build_controller, load_belief
from sim.bridge.run import run_scenario
from sim.errors import UserError
from sim.log.read import read_log
from sim.log.read.attachments import scenario_of
from sim.loop.law import rows_law
from sim.loop.ticks import Ticks
from sim.reproduce.study import Effort
from sim.scenario import Scenario, from_toml, names_a_path, to_toml, with_value, with_values
from sim.settings import spec
from sim.settings.tree import spec_at
from sim.trials.plan.plan import from_toml as plan_from_toml
from sim.trials.run import run_plan
from sim.trials.run.trial import trial_scenario

PD = '''
from dataclasses import dataclass
from typing import Annotated

from controller.belief import StanceEstimator
from controller.common.units import POSITIVE, Unit


@dataclass(frozen=True)
class Settings:
    """Attributes:
        kp: Stiffness of each joint,
            the same for all.
    """

    kp: Annotated[float, Unit("N.m/rad"), POSITIVE] = 300.0
    kd: Annotated[float, Unit("N.m.s/rad"), POSITIVE] = 20.0


class Pd:
    def __init__(self, model, gait, settings: Settings):
        self.gait, self.settings, self.stance = gait, settings, StanceEstimator(model)

    def reset(self, stance):
        self.stance.reset(stance)

    def step(self, observation):
        state = self.stance.update(observation)
        h, slope, _ = self.gait.desired(self.gait.clock @ state.q)
        y, dy = state.q[:4] - h, state.dq[:4] - slope * (self.gait.clock @ state.dq)
        return state.leg.from_body(-self.settings.kp * y - self.settings.kd * dy)


make = Pd
'''

TICKS = """
class Odd:
    def reset(self, stance):
        self.k = 0
        {reset}

    def step(self, observation):
        self.k += 1
        {step}


def make():
    return Odd()
"""


@pytest.fixture
def pd(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(PD)
    return "./mine.py:make"


def odd(folder, step="return [0.0] * 4", reset="pass"):
    path = folder / "odd.py"
    path.write_text(TICKS.format(step=step, reset=reset))
    return f"{path}:make"


def walk(kind, log=None, **changes):
    return run_scenario(with_values(Scenario(steps=2), {"controller.kind": kind, **changes}), log=log)


def test_a_file_a_module_an_object_and_a_name_installed_are_the_same_controller(pd, monkeypatch, tmp_path):
    first = walk(pd)
    assert first.outcome == "completed" and 0.0 < first.output_error_rms_rad < 0.1
    monkeypatch.syspath_prepend(str(tmp_path))
    made = outside.find(pd).factory
    monkeypatch.setattr(outside, "_entry_points", lambda: {"pd-of-mine": "mine:make"})
    given = outside.give(made)
    for kind in ("mine.py", "mine:Pd", "pd-of-mine", given):
        assert walk(kind).state_digest == first.state_digest, kind


REFUSES = """
from dataclasses import dataclass

@dataclass(frozen=True)
class Settings:
    gain: float = 3.0

    def __post_init__(self):
        if self.gain > 5.0:
            raise ValueError("more than\\nthe motors bear")

def make(settings: Settings): pass
"""


def test_settings_that_refuse_a_value_do_so_in_one_line(tmp_path, capsys):
    (tmp_path / "refuses.py").write_text(REFUSES)
    argv = ["run", "undisturbed", "--controller", str(tmp_path / "refuses.py"), "--controller.settings.gain", "7"]
    assert cli.main([*argv, "--no-log"]) == 2
    err = capsys.readouterr().err
    assert err == "cmpc: error: --controller.settings: ValueError: more than the motors bear\n"


ODD_FIELDS = {
    "a: Literal[1, 2] = 1": "a Literal must be of words",
    "a: float = 'x'": "default of a = 'x': must be a finite number",
    "a: float = float('nan')": "default of a = nan: must be a finite number",
    "a: bool = 1": "default of a = 1: must be true or false",
    "a: tuple[float, str] = (1.0, 'x')": "a tuple must be of one type",
    "a: 'Undefined' = 1.0": "its annotations: NameError: name 'Undefined' is not defined",
    "a: Path = Path()": "must be bool, int, float",
    "a: 'Settings | None' = None": "a table must be there",
    "a: 'tuple[Settings, ...]' = ()": "tables must come to an end",
    "a: float = 1.0\n    def __post_init__(self): 1 / 0": "cannot be made of defaults: ZeroDivisionError",
}


def test_a_setting_of_any_number_of_values_has_a_flag(tmp_path):
    fields = "gains: tuple[float, ...] = (1.0, 2.0)\n    words: tuple[str, ...] = ('a',)\n    on: tuple[bool, ...] = ()"
    kind = odd_settings(tmp_path, fields)
    log = tmp_path / "a.mcap"
    argv = ["run", "undisturbed", "--controller", kind, "--time-limit", "0.01", "--log", str(log), "--quiet"]
    argv += ["--controller.settings.gains", "3", "4", "5", "--controller.settings.words", "b, c"]
    assert cli.main([*argv, "--controller.settings.on", "true", "no"]) == 0
    settings = scenario_of(read_log(log)).controller.settings
    assert settings.gains == (3.0, 4.0, 5.0) and settings.words == ("b, c",) and settings.on == (True, False)


def odd_settings(folder, fields):
    text = "from dataclasses import dataclass, field\nfrom pathlib import Path\nfrom typing import Literal\n"
    text += f"@dataclass\nclass Settings:\n    {fields}\n"
    text += "class Limp:\n    def reset(self, stance): pass\n    def step(self, observation): return [0.0] * 4\n"
    (folder / "odd.py").write_text(text + "def make(settings: Settings): return Limp()\n", encoding="utf-8")
    return str(folder / "odd.py")


@pytest.mark.parametrize("fields", ODD_FIELDS)
def test_settings_that_could_not_be_written_down_are_refused_in_one_line(fields, tmp_path, capsys):
    """What a run takes, its log must give back."""
    assert cli.main(["run", "undisturbed", "--no-log", "--controller", odd_settings(tmp_path, fields)]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and ODD_FIELDS[fields] in err, err


def test_settings_of_any_name_and_those_made_by_themselves_come_back_from_a_log(tmp_path):
    kind = odd_settings(tmp_path, "größe: float = 1.0\n    made: float = field(init=False, default=2.0)")
    walk(kind, tmp_path / "a.mcap", time_limit=0.01, **{"controller.settings.größe": 3.0})
    assert scenario_of(read_log(tmp_path / "a.mcap")).controller.settings.größe == 3.0


def test_an_installed_distribution_offers_its_controller_by_name(tmp_path):
    """A tiny distribution as pip lays it down, looked at by a process of its own."""
    (tmp_path / "pd_of_mine.py").write_text(PD)
    info = tmp_path / "pd_of_mine-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: pd-of-mine\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[cmpc.controllers]\nmy-pd = pd_of_mine:make\n")
    argv = ["run", "undisturbed", "--controller", "my-pd", "--controller.settings.kp", "250", "--steps", "1"]
    command = [sys.executable, "-m", "sim", *argv, "--no-log", "--json", "--quiet"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(tmp_path)))}
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outcome"] == "completed"


def test_its_settings_are_keys_flags_and_paths_with_units_and_help(pd):
    scenario = with_values(Scenario(), {"controller.kind": pd, "controller.settings.kp": 250})
    assert from_toml(to_toml(scenario)) == scenario and scenario.controller.settings.kp == 250.0
    spec = spec_at(scenario, "controller.settings.kp")
    assert (spec.unit, spec.help) == ("N.m/rad", "Stiffness of each joint, the same for all.")
    for text, words in {
        f'[controller]\nkind = "{pd}"\n[controller.settings]\nkp = -1.0\n': "controller.settings.kp = -1.0 N.m/rad",
        f'[controller]\nkind = "{pd}"\n[controller.settings]\nkq = 1.0\n': "did you mean controller.settings.kp?",
        '[controller]\nkind = "zd-pd"\n[controller.settings]\nkp = 1.0\n': "controller.settings: unknown key",
    }.items():
        with pytest.raises(UserError, match=r"controller\.settings") as refused:
            from_toml(text)
        assert words in str(refused.value)
    assert with_value(scenario, "controller.kind", "zd-pd") == with_value(Scenario(), "controller.kind", "zd-pd")


def test_the_command_line_takes_its_settings(pd, capsys):
    argv = ["run", "undisturbed", "--controller", pd, "--steps", "1", "--no-log", "--json"]
    results = []
    for more in ([], ["--controller.settings.kp", "250"]):
        assert cli.main([*argv, *more]) == 0
        results.append(json.loads(capsys.readouterr().out)["state_digest"])
    assert results[0] != results[1]
    assert cli.main([*argv, "--controller.settings.kq", "250"]) == 2
    assert "did you mean --controller.settings.kp?" in capsys.readouterr().err
    assert cli.main(["run", "--controller", pd, "--help"]) == 0
    assert "--controller.settings.kp N.m/rad" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("step", "words"),
    {
        "return [0.0] * 4 if self.k < 3 else 1 / 0": ["ZeroDivisionError", "odd.py, line 9"],
        "return [0.0] * (4 if self.k < 9 else 3)": ["a list of 3", "4 numbers [N.m]", "odd.py, line 7"],
        "return None": ["None", "4 numbers"],
        "return 'left'": ["'left'", "4 numbers"],
        "return [0.0, float('nan'), 0.0, 0.0]": ["not finite", "right_hip nan", "odd.py, line 7"],
        "return [0.0, 0.0, float('inf'), 0.0]": ["not finite", "left_knee inf"],
        "raise ValueError('two\\nlines')": ["ValueError: two lines"],
        "return __import__('numpy').zeros(4, complex)": ["an array of shape (4,)", "4 numbers"],
        "import sim; return sim.ControlStep(stance='up', u_total=[0.0] * 4)": ["stance = 'up'", "left or right"],
        "import sim; return sim.ControlStep(stance='left', u_total=[0.0])": ["u_total = a list of 1", "4 numbers"],
        "import sim; return sim.ControlStep(stance='left', u_total=[0] * 4, theta='x')": ["theta = 'x'", "a number"],
        "import sim; return sim.ControlStep(stance='left', u_total=[0] * 4, diagnostics=[1])": [
            "diagnostics",
            "a dict",
        ],
        "import sim; return sim.ControlStep(stance='left', u_total=[0] * 4, plan=3)": ["plan = 3", "outputs() and"],
        "raise SystemExit(3)": ["SystemExit: 3", "odd.py, line 9"],
        "while True: pass": ["no answer within", "odd.py, line 9"],
    }.items(),
)
def test_what_breaks_in_a_tick_is_an_error_with_its_place_and_a_readable_log(
    tmp_path, monkeypatch, capsys, step, words
):
    monkeypatch.setattr(guard, "PATIENCE", 0.4)
    log = tmp_path / "x.mcap"
    assert cli.main(["run", "--controller", odd(tmp_path, step), "--log", str(log), "--json", "--quiet"]) == 1
    summary = json.loads(capsys.readouterr().out)
    assert summary["outcome"] == "error" and summary["fall_reason"] == ""
    for word in words:
        assert word in summary["message"]
    assert read_log(log).metadata["result"]["outcome"] == "error"


PLANS = """
import sim

class Plan:
    def outputs(self):
        return {outputs}

    def contact_forces(self):
        return [[0.0, 300.0]] * 10

class Planner:
    def reset(self, stance): pass

    def step(self, observation):
        return sim.ControlStep(stance="left", u_total=[0.0] * 4, plan=Plan())

make = Planner
"""


@pytest.mark.parametrize(
    ("outputs", "words"),
    {
        "1 / 0": ["outputs(): ZeroDivisionError", "line 6"],
        "[0.0] * 4": ["outputs()", "line 5", "a list of 4; must be rows of 4 numbers"],
        "'x'": ["'x'; must be rows of 4 numbers"],
        "[[0.0] * 4] * 11": [],
    }.items(),
)
def test_a_plan_that_breaks_is_an_error_with_its_place(tmp_path, outputs, words):
    (tmp_path / "plans.py").write_text(PLANS.format(outputs=outputs))
    log = tmp_path / "x.mcap"
    summary = walk(f"{tmp_path / 'plans.py'}:make", log)
    assert summary.outcome == ("error" if words else "fell")
    assert all(word in summary.message for word in words)
    assert read_log(log).complete


@pytest.mark.parametrize(
    "step", ["return [0, 0, 0, 0]", "import numpy; return numpy.zeros(4, int)", "return (0.0,) * 4"]
)
def test_four_numbers_of_any_kind_are_a_torque(tmp_path, step):
    assert walk(odd(tmp_path, step)).outcome == "fell"


def test_a_reset_that_breaks_is_an_error_of_the_run(tmp_path):
    summary = walk(odd(tmp_path, reset="raise KeyError(stance)"))
    assert summary.outcome == "error" and "reset(): KeyError: 'left'" in summary.message and "line 5" in summary.message


def test_what_it_prints_leaves_the_json_alone(tmp_path, capsys):
    (tmp_path / "odd.py").write_text(
        "print('imported')\n" + TICKS.format(step="print(self.k); return [0] * 4", reset="pass")
    )
    assert cli.main(["run", "--controller", str(tmp_path / "odd.py"), "--no-log", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["outcome"] == "fell" and "imported" in err


@pytest.mark.parametrize(
    ("text", "words"),
    {
        "from dataclasses import *\n@dataclass\nclass S:\n    x: int\ndef make(s: S): pass\n": ["x", "a default"],
        "class D:\n    def step(self, o): pass\nmake = D\n": ["has no reset()"],
        "make = 3\n": ["make is no factory: it is 3"],
    }.items(),
)
def test_what_lacks_something_is_refused_by_name(tmp_path, capsys, text, words):
    test_what_cannot_be_made_is_refused_before_the_run(tmp_path, capsys, text, words)


@pytest.mark.parametrize(
    ("text", "words"),
    {
        "def make(:\n": ["SyntaxError", "line 1"],
        "import nowhere_at_all\n": ["ModuleNotFoundError", "line 1"],
        "def build(): pass\n": ["has no factory 'make'", "it has build"],
        "def make(model, wish): pass\n": ["asks for 'wish'", "model, gait"],
        "async def make(): pass\n": ["factory make is async"],
        "def make(): return 3\n": ["gave 3", "reset(stance) and step(observation)"],
        "def make(): raise OSError('no weights')\n": ["OSError: no weights", "line 1"],
        "import sys; sys.exit(1)\n": ["ends the program"],
        "import sys\ndef make(): sys.exit(0)\n": ["SystemExit: 0", "line 2"],
        "from dataclasses import *\n@dataclass\nclass S:\n    x: dict = None\ndef make(s: S): pass\n": ["field x"],
    }.items(),
)
def test_what_cannot_be_made_is_refused_before_the_run(tmp_path, capsys, text, words):
    (tmp_path / "odd.py").write_text(text)
    assert cli.main(["run", "--controller", f"{tmp_path / 'odd.py'}:make", "--no-log"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("cmpc: error: ") and err.count("\n") == 1
    for word in words:
        assert word in err


@pytest.mark.parametrize("kind", ["c-mcp", "nowhere.module:make", "./none.py:make", "python:Gone", ":", "a:"])
def test_a_controller_that_is_not_there_is_refused(kind, capsys):
    assert cli.main(["run", "--controller", kind, "--no-log"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and kind in err
    assert ("did you mean c-mpc?" in err) == (kind == "c-mcp")


def test_a_log_is_read_without_its_code_and_run_again_only_with_it(pd, tmp_path, capsys):
    log = tmp_path / "run.mcap"
    walk(pd, log, **{"controller.settings.kp": 280.0})
    assert cli.main(["replay", str(log), "--quiet"]) == 0
    assert "identical" in capsys.readouterr().out
    assert cli.main(["replay", str(log), "--controller.settings.kp", "290", "--log", "b.mcap", "--json"]) == 0
    capsys.readouterr()
    assert cli.main(["log", "check", str(log)]) == 0 and cli.main(["log", "info", str(log)]) == 0
    assert cli.main(["review", str(log), "--out", "page.html"]) == 0
    capsys.readouterr()
    assert cli.main(["log", "compare", str(log), str(log)]) == 0 and "identical" in capsys.readouterr().out
    assert cli.main(["log", "compare", str(log), "b.mcap"]) == 1
    assert cli.main(["log", "export", str(log), "columns"]) == 0 and (tmp_path / "columns").exists()
    (tmp_path / "mine.py").write_text(PD + "# changed\nopen('ran', 'w').close()\n")
    with pytest.raises(UserError, match="has changed"):
        scenario_of(read_log(log))
    capsys.readouterr()
    assert cli.main(["replay", str(log), "--quiet"]) == 2
    err = [line for line in capsys.readouterr().err.splitlines() if "warning" not in line]
    assert len(err) == 1 and "has changed" in err[0]
    (tmp_path / "mine.py").unlink()
    with pytest.raises(UserError, match="is not here"):
        scenario_of(read_log(log))
    capsys.readouterr()
    assert cli.main(["log", "check", str(log)]) == 0 and cli.main(["review", str(log), "--out", "page2.html"]) == 0
    assert not (tmp_path / "ran").exists()
    code = "import sys; from sim.log.read import read_log; from sim.review.facts import *; "
    code += "from sim.log.read.frames import *; log = read_log(sys.argv[1])"
    subprocess.run([sys.executable, "-c", code, str(log)], check=True, cwd=ROOT)


def test_a_scenario_goes_to_another_process_with_the_text_of_its_controller(pd, tmp_path):
    scenario = with_values(Scenario(), {"controller.kind": pd, "controller.settings.kp": 250.0})
    sent = pickle.dumps(scenario)
    (tmp_path / "mine.py").unlink()
    code = "import pickle, sys; print(pickle.loads(sys.stdin.buffer.read()).controller.settings.kp)"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], input=sent, capture_output=True, check=True, env=environment)
    assert done.stdout.decode().strip() == "250.0"


PLAN = """
controllers = ["{kind}", "c-mpc", "{odd}"]
log_every = 2
[scenario]
steps = 1
[scenario.controller.settings]
kd = 25.0
[[grid]]
name = "gain"
[[grid.axes]]
paths = ["controller.settings.kp"]
values = [200.0, 300.0]
"""


def test_trials_take_it_beside_a_built_in_and_its_faults_cost_one_trial(pd, tmp_path):
    broken = odd(tmp_path, "return [0.0] * (4 if self.k < 9 else 3)")
    plan = plan_from_toml(PLAN.format(kind=pd, odd=broken))
    mine, theirs = (trial_scenario(plan, kind, 1).controller for kind in (pd, "c-mpc"))
    assert (mine.settings.kp, mine.settings.kd) == (300.0, 25.0)
    assert theirs == with_value(Scenario(), "controller.kind", "c-mpc").controller
    results = run_plan(plan, tmp_path / "out", workers=2)
    rows = {(row.controller, row.trial): row for row in results}
    assert [rows[pd, i].outcome for i in range(2)] == [rows["c-mpc", i].outcome for i in range(2)] == ["completed"] * 2
    assert rows[pd, 0].state_digest != rows[pd, 1].state_digest
    assert rows["c-mpc", 0].state_digest == rows["c-mpc", 1].state_digest
    assert rows[broken, 0].outcome == "error" and "odd.py, line 7" in rows[broken, 0].message
    assert len(list((tmp_path / "out" / "logs").glob("*.mcap"))) == 3
    results.store.close()
    (tmp_path / "mine.py").write_text(PD + "# changed\n")
    with pytest.raises(UserError, match=r"found with something else: file .*mine.py"):
        run_plan(plan, tmp_path / "out", workers=1)


@pytest.mark.parametrize("kind", ["zd-pd", "c-mpc"])
def test_a_built_in_controller_that_gives_no_number_is_an_error_too(tmp_path, kind, monkeypatch):
    with pytest.raises(UserError, match="rate_bias"):
        walk(kind, **{"sensors.rate_bias.left_knee": -1e308})
    monkeypatch.setattr(spec, "LARGEST", math.inf)  # what no file may ask for
    changes = {"sensors.rate_bias.left_knee": -1e308, "controller.kp": (1e308,) * 4, "controller.kd": (1e308,) * 4}
    log = tmp_path / "nan.mcap"
    with np.errstate(all="ignore"):
        summary = walk(kind, log, time_limit=0.2, **changes)
    assert summary.outcome in ("error", "fell")
    if summary.outcome == "error":
        assert "not finite" in summary.message and read_log(log).metadata["result"]["outcome"] == "error"


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("~nobody_here/m.py", "No such file"),
        (":make", "names no module; must be"),
        (".mine:make", "names no module; must be"),
        ("quits_at_once", "module quits_at_once: ends the program when imported"),
        ("./zeros.py", "null bytes"),
    ],
)
def test_names_of_nothing_are_one_line(kind, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quits_at_once.py").write_text("raise SystemExit(3)\n")
    (tmp_path / "zeros.py").write_bytes(b"\0\0")
    assert cli.main(["run", "--no-log", "--controller", f"{kind}:make" if kind.startswith("quits") else kind]) == 2
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1 and "None" not in err, err


def test_a_setting_may_be_called_left_without_a_right(tmp_path, capsys):
    kind = odd_settings(tmp_path, "left_gain: float = 1.0")
    assert cli.main(["poincare", "--plant.kind", "rigid", "--quiet", "--controller", kind]) in (1, 2)
    assert "left_gain" not in capsys.readouterr().err


def test_a_step_map_a_basin_a_benchmark_and_a_reproduction_take_it(pd, tmp_path, capsys):
    rigid = ["--plant.kind", "rigid", "--plant.timestep", "0.001", "--quiet"]
    broken = odd(tmp_path, "return [0.0] * (4 if self.k < 9 else 3)")
    assert cli.main(["poincare", *rigid, "--controller", broken]) == 2
    err = capsys.readouterr().err
    assert "odd.py, line 7" in err and err.count("\n") == 1
    span = [
        "--torso",
        "0",
        "0.02",
        "2",
        "--force",
        "0",
        "5",
        "2",
        "--limit",
        "2",
        "--workers",
        "1",
        "--out",
        str(tmp_path / "basin"),
    ]
    assert cli.main(["basin", *rigid, *span, "--controller", broken]) == 2
    assert "odd.py, line 7" in capsys.readouterr().err
    assert cli.main(["bench", "--quick", "--controller", broken]) == 2
    assert "odd.py, line 7" in capsys.readouterr().err
    ways = outside_path(1)
    assert [way.unit for way in ways] == ["us", "us"] and all(way.value > 0.0 for way in ways)
    effort = Effort(changes={"controller.kind": pd, "controller.settings.kp": 250.0})
    kinds = [from_toml(effort.scenario("rigid", name)).controller for name in ("zd-pd", "c-mpc")]
    assert kinds[0].kind == "zd-pd" and (kinds[1].kind, kinds[1].settings.kp) == (pd, 250.0)


def test_a_log_of_a_gait_with_a_dot_or_a_space_in_its_name_replays_identically(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("L0.40-v0.80", "my gait", "gång"):
        (tmp_path / f"{name}.toml").write_text((ROOT / "models/rabbit/gaits/L0.40-v0.80.toml").read_text())
        log = tmp_path / f"{name}.mcap"
        walk("zd-pd", log, gait=f"./{name}.toml", steps=1)
        assert cli.main(["replay", str(log), "--quiet"]) == 0, capsys.readouterr().out
        assert "identical" in capsys.readouterr().out


def test_a_walker_without_the_default_gait_walks_its_own_and_words_are_suggested(capsys):
    summary = walk("zd-pd", walker="rabbit-tac", steps=1)
    assert summary.outcome == "completed"
    for argv, words in {
        ("--walker", "rabit"): "did you mean rabbit?",
        ("--gait", "papr"): "did you mean paper?",
        ("--controller.solver", "ricati"): "did you mean riccati?",
        ("--controller", "zdpd"): "did you mean zd-pd?",
    }.items():
        assert cli.main(["run", *argv, "--no-log"]) == 2
        assert words in capsys.readouterr().err


@pytest.mark.parametrize("separator", ["/", "\\"])
def test_a_path_with_slashes_is_a_path_whatever_the_systems_separator(monkeypatch, separator):
    monkeypatch.setattr(os, "sep", separator)
    assert names_a_path("./mine") and names_a_path("a/b") and not names_a_path("rabbit")


def test_from_row_to_row_is_what_from_record_to_record_is(pd):
    belief = load_belief(Scenario())
    rng, block = np.random.default_rng(0), Ticks.room(60)
    one, other = (build_controller(with_value(Scenario(), "controller.kind", pd).controller, belief) for _ in range(2))
    for law in (one, other):
        law.reset("right")
    fast, filled = rows_law(one, block), 0
    for i in range(60):
        seen = block.seen[i]
        seen["q"], seen["dq"] = belief.gait.q_minus + 0.1 * rng.normal(size=5), rng.normal(size=5)
        seen["contact"] = rng.integers(0, 2, 2)
        fast.decide(block.seen, block.step, i)
        step = other.step(observation_of(seen))
        wanted = np.zeros(1, block.step.dtype)
        write_step(wanted, 0, step)
        for name in wanted.dtype.names:
            np.testing.assert_allclose(block.step[i][name], wanted[0][name], rtol=1e-9, atol=1e-9, err_msg=name)
        filled += seen["contact"][0] == 0
    assert 10 < filled < 50
