"""A log runs again from itself, to the last bit, and what was changed in it is seen."""

import json
import shutil

import pytest

from sim.bridge import kernels
from sim.bridge.run import run_scenario
from sim.cli import main
from sim.log.read import read_log
from sim.log.read.attachments import scenario_of
from sim.log.read.scan import scan
from sim.scenario import load, with_values
from tests.test_logs import exchanged

BASE = {"time_limit": 0.6, "controller.horizon": 30}
VARIED = [
    ("undisturbed", {}),
    ("undisturbed", {"controller.kind": "zd-pd"}),
    ("undisturbed", {"steps": 1}),
    ("undisturbed", {"steps": 1, "controller.kind": "zd-pd"}),
    ("push-40N-first", {}),
    ("push-40N-first", {"controller.kind": "zd-pd"}),
    ("push-40N-first", {"pushes.0.force": -30.0}),
    ("push-40N-first", {"pushes.0.body": "left_femur", "pushes.0.point": (0.0, 0.2)}),
    ("push-40N-first", {"pushes.0.direction": 0.5, "steps": 1}),
    ("push-25N", {"pushes.0.step": 1, "actuation.lag": 0.002, "sensors.contact_dropout": 0.05}),
    ("undisturbed", {"plant.ground.slope": 0.05}),
    ("undisturbed", {"plant.ground.slope": -0.05, "controller.kind": "zd-pd"}),
    ("undisturbed", {"plant.ground.rough.height": 0.004, "plant.ground.rough.start": 0.2, "seed": 5}),
    ("payload-x2", {}),
    ("undisturbed", {"plant.mass_factor.torso": 1.5, "plant.damping_factor.left_knee": 2.0}),
    ("undisturbed", {"sensors.angle_noise": 1e-3, "sensors.rate_noise": 0.01, "seed": 11}),
    ("undisturbed", {"plant.kind": "rigid", "steps": 1}),
    ("undisturbed", {"plant.integrator": "RK4", "plant.timestep": 5e-4}),
    ("undisturbed", {"controller.friction_rows": False, "plant.torque_limit_factor.left_hip": 0.5}),
    ("undisturbed", {"controller.horizon": 100, "seed": 7, "time_limit": 0.3}),
    ("push-40N-first", {"controller.observer.enabled": True}),
]


def run(path, name, changes):
    run_scenario(with_values(load(name), BASE | changes), log=path)
    return path


def replay(capsys, *words):
    code = main(["replay", "--quiet", *map(str, words)])
    out = capsys.readouterr()
    return code, out.out, out.err


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return run(tmp_path_factory.mktemp("replay") / "run.mcap", "push-40N-first", {})


@pytest.mark.parametrize(("name", "changes"), VARIED, ids=[f"{i}-{name}" for i, (name, _) in enumerate(VARIED)])
def test_every_varied_log_replays_identical(tmp_path, capsys, name, changes):
    code, out, _ = replay(capsys, run(tmp_path / "run.mcap", name, changes))
    ticks = len(read_log(tmp_path / "run.mcap").channel("/control"))
    assert (code, out) == (0, f"identical: {ticks} ticks\n")
    assert main(["log", "check", str(tmp_path / "run.mcap")]) == 0


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("rabbit.xml", b"Units:", b"units:", "is not the one"),  # a comment: the run itself is the same
        ("rabbit.xml", b'mass="6.8"', b'mass="6.9"', "first difference: tick 1"),
        ("rabbit.urdf", b'effort="75', b'effort="74', "first difference"),
        ("paper.toml", b"3.", b"3.0", "is not the one"),
        ("scenario.toml", b"force = 40.0", b"force = 41.0", "first difference: tick 1"),
        ("scenario.toml", b"seed = 0", b"seed = 1", "is not the one"),
    ],
)
def test_a_changed_attachment_is_not_identical(path, tmp_path, capsys, name, old, new, words):
    code, out, err = replay(capsys, exchanged(path, tmp_path / "x.mcap", name, old, new))
    assert code in (1, 2) and "identical" not in out and (words in out or code == 2), (out, err)


def test_one_flipped_byte_of_an_attachment_is_damage(path, tmp_path, capsys):
    data = path.read_bytes()
    (tmp_path / "x.mcap").write_bytes(data.replace(b"Units:", b"units:", 1))
    code, _, err = replay(capsys, tmp_path / "x.mcap")
    assert code == 2 and "CRC of an attachment" in err


def test_a_cut_log_agrees_as_far_as_it_goes(path, tmp_path, capsys):
    data = path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: scan(data).end - 3000])
    code, out, _ = replay(capsys, tmp_path / "cut.mcap")
    assert code == 3 and "lacks the end of its run" in out
    assert main(["log", "recover", str(tmp_path / "cut.mcap"), str(tmp_path / "saved.mcap")]) == 1
    assert replay(capsys, tmp_path / "saved.mcap")[0] == 3


def test_an_interrupted_run_replays_identical(tmp_path, capsys):
    asked = iter(range(10_000))

    def stop():
        return "interrupted by SIGINT" if next(asked) == 123 else None

    path = tmp_path / "run.mcap"
    summary = run_scenario(with_values(load("undisturbed"), BASE), log=path, stop=stop)
    assert summary.outcome == "interrupted"
    assert replay(capsys, path)[:2] == (0, "identical: 123 ticks\n")


def test_time_spent_on_kernels_does_not_end_a_replay(path, monkeypatch):
    asked = []
    monkeypatch.setattr(kernels, "ready", lambda *_: False)
    monkeypatch.setattr(kernels, "prepare", lambda *_, stop, **more: asked.extend(stop() for _ in range(10_000)))
    assert main(["replay", str(path)]) == 0 and asked


def test_other_versions_are_told(path, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("sim.log.provenance.package_versions", lambda: {"mujoco": "9.9"})
    code, _, err = replay(capsys, path)
    assert code == 0 and "mujoco was 4" in err and "is 9.9" in err


def test_what_would_another_controller_have_done(path, tmp_path, capsys):
    new = tmp_path / "what-if.mcap"
    code, out, _ = replay(
        capsys, path, "--controller", "zd-pd", "--set", "pushes.0.force", "10", "--log", new, "--json"
    )
    assert code == 0
    log = read_log(new)
    assert json.loads(out)["log"] == str(new)
    assert b'kind = "zd-pd"' in log.attachments["scenario.toml"][1]
    assert b"force = 10.0" in log.attachments["scenario.toml"][1]
    assert {k: v for k, v in log.attachments.items() if k != "scenario.toml"} == {
        k: v for k, v in read_log(path).attachments.items() if k != "scenario.toml"
    }
    assert (log.channel("/control")["u_mpc.left_hip"] == 0.0).all()
    assert replay(capsys, new)[0] == 0


def test_what_set_is_told_is_taken_as_it_stands(path, tmp_path, capsys):
    """Blanks in a text, a switch turned off, several numbers in a word, the controller by its short name."""
    sets = {"name": "two words", "controller.friction-rows": "false", "start.q_offset": "0.01,0 0, 0 0"}
    words = [word for item in sets.items() for word in ("--set", *item)]
    code, _, err = replay(capsys, path, *words, "--set", "controller", "zd-pd", "--log", tmp_path / "new.mcap")
    assert code == 0, err
    changed = scenario_of(read_log(tmp_path / "new.mcap"))
    assert changed.name == "two words" and changed.controller.kind == "zd-pd"
    assert not changed.controller.friction_rows and changed.start.q_offset == (0.01, 0.0, 0.0, 0.0, 0.0)


def test_it_needs_nothing_but_the_log(path, tmp_path, capsys, monkeypatch):
    """Neither the shipped models nor the current directory."""
    shutil.copy(path, tmp_path / "run.mcap")
    monkeypatch.setattr("sim.walkers.folder.SHIPPED", tmp_path / "nowhere")
    monkeypatch.chdir(tmp_path)
    assert replay(capsys, "run.mcap")[0] == 0
    assert [p.name for p in tmp_path.iterdir()] == ["run.mcap"]


def test_set_names_a_controller_of_ones_own(path, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    limp = "class Limp:\n    reset = lambda self, stance: None\n    step = lambda self, seen: [0.0] * 4\n"
    (tmp_path / "limp.py").write_text(f"{limp}def make(): return Limp()\n")
    sets = {"controller": "./limp.py", "time_limit": "0.01", "controller.friction-rows": "no"}
    words = [word for item in sets.items() for word in ("--set", *item)]
    code, _, err = replay(capsys, path, *words, "--log", tmp_path / "new.mcap")
    assert code == 0, err
    changed = scenario_of(read_log(tmp_path / "new.mcap")).controller
    assert changed.kind == "./limp.py" and not changed.friction_rows


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--set"], "--set expected 2 arguments [PATH VALUE]"),
        (["--set", "plant.ground.frction", "1"], "plant.ground.friction"),
        (["--controller", "lqr"], "one of c-mpc, zd-pd"),
    ],
)
def test_bad_changes_are_one_line(path, capsys, words, message):
    code, _, err = replay(capsys, path, *words)
    assert code == 2 and message in err and err.count("\n") == 1
