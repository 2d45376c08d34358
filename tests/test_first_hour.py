"""What a newcomer meets: first words, help, files to start from, completion, doctor, mistyped words, signs of life."""

import ast
import json
import os
import re
import shlex
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from sim import cli
from sim.commands.completion import whole
from sim.commands.new import PLAN
from sim.commands.options import ESSENTIAL
from sim.scenario import from_toml, load, settings_table, shipped
from sim.terminal.console import note
from sim.terminal.progress import progress_bar
from sim.terminal.pulse import Pulse
from sim.trials.plan.plan import from_toml as plan_from_toml


def test_the_program_alone_shows_what_to_do_first_and_its_commands_are_commands(capsys):
    assert cli.main([]) == 0
    out = capsys.readouterr().out
    assert out.index("first") < out.index("your own") < out.index("commands")
    assert set(re.findall(r"cmpc ([a-z]+)", out)) <= set(cli.COMMANDS)


def test_help_shows_fifteen_settings_and_help_all_every_one(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")
    assert len(ESSENTIAL) == 15

    def shown(*words):
        assert cli.main(["run", "push-25N", *words]) == 0
        out = capsys.readouterr().out
        return {flag for flag in re.findall(r"^  (--[\w.-]+)", out, re.M) if "." in flag}, out

    short, out = shown("--help")
    dotted = {"--" + path.replace("_", "-") for path in ESSENTIAL if "." in path} - {"--controller.kind"}
    assert short == dotted and "--help-all" in out
    every, _ = shown("--help-all")
    assert {"--" + row.path.replace("_", "-") for row in settings_table() if "." in row.path} - every <= {
        "--controller.kind"
    }


def switched_on(text):
    return re.sub(r"^#(?=[\w\[])(?!\[)", "", text, flags=re.M)


@pytest.mark.parametrize("name", [*shipped(), "own"])
def test_a_new_scenario_reads_back_with_and_without_its_defaults_switched_on(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    source = name
    if name == "own":
        Path("own.toml").write_text("[plant.ground]\nslope = 0.02\n[[plant.ground.ramps]]\nslope = 0.1\n")
        source = "own.toml"
    assert cli.main(["new", "scenario", "mine.toml", "--from", source]) == 0
    assert capsys.readouterr().out == "mine.toml\nnext: cmpc run mine.toml\n"
    text = Path("mine.toml").read_text()
    assert from_toml(text) == from_toml(switched_on(text)) == load(source)
    assert cli.main(["new", "scenario", "mine.toml"]) == 2 and "never written over" in capsys.readouterr().err
    for row in settings_table():
        assert re.search(rf"^#? ?{row.path.rpartition('.')[2]}\b", text, re.M), row.path


def test_a_new_plan_reads_back(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", "plan", "mine.toml"]) == 0
    text = Path("mine.toml").read_text()
    assert plan_from_toml(text) == plan_from_toml(switched_on(text)) == plan_from_toml(PLAN)


def test_a_new_controller_walks_and_a_run_names_what_comes_next(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", "controller", "mine.py"]) == 0
    command = ["run", "undisturbed", "--controller", "./mine.py", "--controller.settings.kp", "320", "--steps", "2"]
    assert cli.main([*command, "--log", "a.mcap", "--quiet"]) == 0
    out = capsys.readouterr().out
    assert "2 of 2" in out
    assert "\nnext: cmpc review a.mcap " in out and "\nnext: cmpc replay a.mcap --controller zd-pd " in out


@pytest.mark.parametrize("line", ["new scenario x.py", "new plan nowhere/x.toml", "new controller x.toml"])
def test_a_name_that_cannot_be_written_is_one_line(line, capsys):
    assert cli.main(line.split()) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_line_that_comes_next_can_be_pasted(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", "controller", "my own.py"]) == 0
    assert shlex.split(capsys.readouterr().out)[-2:] == ["--controller", "./my own.py"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("review --follow", "--follow takes one log; 0 were given"),
        ("review --follow .", ".: is no log: it is a folder"),
        ("review --layout foxglove", "takes the one file to write; 0 were given"),
        ("review --layout foxglove a.json --out b.json", "without --follow and --out"),
        ("review . --out b.html", "left out for a folder"),
        ("trials certfy", "did you mean certify?"),
    ],
)
def test_what_cannot_be_done_is_told_and_not_left_aside(line, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(line.split()) == 2
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1 and not list(tmp_path.iterdir()), err


def test_completion_knows_every_command_option_and_shipped_name():
    parser = whole(cli.COMMANDS)
    commands = next(action.choices for action in parser._actions if action.dest == "==SUPPRESS==" and action.choices)
    assert set(commands) == set(cli.COMMANDS)
    run = {action.dest: action for action in commands["run"]._actions}
    assert run["scenario"].choices == sorted(shipped())
    assert {f"setting:{row.path}" for row in settings_table()} <= set(run)


def test_doctor_looks_at_everything_and_finds_nothing_missing(capsys):
    assert cli.main(["doctor", "--json"]) == 0
    rows = {row["what"]: row for row in json.loads(capsys.readouterr().out)}
    for what in ("Python", "machine", "BLAS", "kernels on disk", "this folder", "display", "OpenGL without display"):
        assert rows[what]["found"]
    assert any(what.startswith("extra ") for what in rows)
    assert all(row["hint"] for row in rows.values() if row["well"] is False)


def test_a_file_of_the_users_that_would_be_imported_in_place_of_ours_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sim.py").write_text("")
    cli.main(["doctor", "--json"])
    row = next(row for row in json.loads(capsys.readouterr().out) if row["what"] == "import sim")
    assert row["found"] == str(tmp_path / "sim.py") and row["well"] is not True and row["hint"]


MISTYPED = """
rnu = run
revew RUN.mcap = review
trails pushes = trials
replai x = replay
bnech = bench
reproduse = reproduce
poincarre = poincare
wieghts search = weights
gaits check paper = gait
walkr check rabbit = walker
docter = doctor
completoin bash = completion
gait desing = design
gait chekc paper = check
gait compar paper paper = compare
gait libary = library
gait polsh paper = polish
gains serach = search
weights seach = search
walker chek rabbit = check
walker nwe x = new
log inof x = info
log chekc x = check
log recovr x = recover
log exprt x y = export
log comapre x y = compare
trials shw x = show
trials reprot x = report
trials rety x = retry
trials numercis x = numerics
new scenrio x.toml = scenario
new contoller x.py = controller
run --stesp 3 = --steps
run --hlep = --help
run --contoller zd-pd = --controller
run --controller.horizn 50 = --controller.horizon
run --plant.grond.friction 0.5 = --plant.ground.friction
run --friction 0.5 = friction
run --slope 0.05 = --plant.ground.slope
run --force 30 = --pushes.0.force
run --mass 2 = mass
run --plant.mass-factor.tors 2 = --plant.mass-factor.torso
run --sensors.angle-nois 0.01 = --sensors.angle-noise
run --latency 2 = latency
run --no-lgo = --no-log
run --jsn = --json
run --quite = --quiet
bench --quik = --quick
reproduce fig3 --quik = --quick
gait check paper --jsn = --json
trials pushes --ou x = --out
run --controller c-mcp = c-mpc
run --controller zdpd = zd-pd
run --controller.solver ricatti = riccati
run --plant.kind mujco = mujoco
run --pushes.0.body torsoo = torso
run --walker rabit = rabbit
run --gait paper-polishd = paper-polished
run undistrubed = undisturbed
trials push --out x = pushes
trials montecralo --out x = montecarlo
reproduce fig33 = fig3
""".strip().splitlines()


def test_of_mistyped_words_the_nearest_is_named(capsys):
    assert len(MISTYPED) >= 60
    missed = []
    for line in MISTYPED:
        words, _, near = line.partition(" = ")
        assert cli.main(words.split()) == 2, words
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1 and "Traceback" not in err, err
        if not re.search(rf"did you mean [^?]*{re.escape(near)}[^?]*\?", err):
            missed.append((words, err))
    assert len(MISTYPED) - len(missed) >= 55, missed
    assert not missed, missed


@pytest.mark.parametrize(
    "line, words",
    [
        ("run paper.toml", ["is a gait", "--gait paper.toml"]),
        ("run plan.toml", ["is a plan", "cmpc trials plan.toml"]),
        ("trials scenario.toml --out x", ["is a scenario", "cmpc run scenario.toml"]),
        ("trials paper.toml --out x", ["is a gait"]),
        ("gait design --step-length 40cm --speed 0.8", ["--step-length", "40cm", "finite number", "[m]"]),
        ("run --plant.ground.friction 1e300", ["--plant.ground.friction", "between 0 and 100"]),
        ("run --controller.normal-force-min 1e300", ["no more than 1e+09", "[N]"]),
    ],
)
def test_what_was_meant_for_another_command_or_in_another_unit_is_told(line, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    root = Path(cli.__file__).parents[1]
    Path("paper.toml").write_text((root / "models/rabbit/gaits/paper.toml").read_text())
    Path("plan.toml").write_text(PLAN)
    Path("scenario.toml").write_text("steps = 3\n[plant.ground]\nslope = 0.1\n")
    assert cli.main(line.split()) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and all(word in err for word in words), err
    assert len(err) < 500


def test_a_walker_beside_needs_no_dot(tmp_path, monkeypatch):
    from sim.walkers import WalkerFolder

    monkeypatch.chdir(tmp_path)
    mine = tmp_path / "mine"
    (mine / "gaits").mkdir(parents=True)
    for ending in ("urdf", "xml"):
        (mine / f"mine.{ending}").write_text("")
    assert WalkerFolder.find("mine").urdf == mine / "mine.urdf"


def test_silence_is_broken_by_what_and_how_long(capsys, monkeypatch):
    monkeypatch.setattr("sim.terminal.pulse.SILENCES", (0.05,))
    pulse = Pulse()
    with pulse.beating("cmpc gait check"):
        time.sleep(0.3)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) >= 2 and all(re.fullmatch(r"cmpc gait check: \d+ s", line) for line in lines)
    with pulse.beating("x"), pulse.hushed():
        time.sleep(0.2)
    assert capsys.readouterr().err == ""


def test_a_bar_in_a_pipe_says_its_words_now_and_then(capsys, monkeypatch):
    monkeypatch.setattr("sim.terminal.pulse.SILENCES", (0.05,))
    with progress_bar("mapping", "cells", quiet=False) as update:
        update(3, 10)
        time.sleep(0.2)
    assert "mapping: 3/10 cells" in capsys.readouterr().err
    with progress_bar("mapping", quiet=True) as update:
        assert update is None


def test_a_note_is_a_sign_of_life(capsys):
    note("one")
    assert capsys.readouterr().err == "one\n"


def test_a_page_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    from sim.errors import UserError
    from sim.pages import write

    page = tmp_path / "page.html"
    write(page, "old")
    monkeypatch.setattr(Path, "replace", lambda self, other: (_ for _ in ()).throw(OSError(28, "No space left")))
    with pytest.raises(UserError, match=r"page\.html: cannot be written: No space left"):
        write(page, "new")
    assert page.read_text() == "old" and [path.name for path in tmp_path.iterdir()] == ["page.html"]


def test_what_is_no_file_is_written_into_not_replaced(tmp_path):
    from sim.pages import write

    pipe, read = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()), daemon=True)
    reader.start()
    write(pipe, "words")
    reader.join(60.0)
    assert read == ["words"] and pipe.is_fifo()


def test_the_interface_for_python_tells_one_error_and_is_typed():
    import sim

    with pytest.raises(sim.UserError) as caught:
        sim.read("nowhere.mcap")
    assert caught.value.__cause__ is None and caught.value.__suppress_context__
    with pytest.raises(sim.UserError) as caught:
        sim.run("undisturbd")
    assert caught.value.__cause__ is None and "did you mean undisturbed" in str(caught.value)
    with pytest.raises(sim.UserError) as caught:
        sim.with_value(sim.load("undisturbed"), "plant.ground.friction", -1.0)
    assert caught.value.what == "plant.ground.friction = -1.0 ratio"
    assert caught.value.must == "a number between 0 and 100 [ratio]"
    root = Path(cli.__file__).parents[1]
    assert (root / "sim/py.typed").is_file() and (root / "controller/py.typed").is_file()


def test_a_log_shows_itself(tmp_path):
    import sim

    summary = sim.run(
        sim.with_values(sim.load("undisturbed"), {"steps": 1}), controller="zd-pd", log=tmp_path / "a.mcap"
    )
    log = sim.read(summary.log)
    assert len(repr(log)) < 200 and "undisturbed, completed, 1 steps" in repr(log)
    shown = log._repr_html_()
    assert "walked all 1 steps" in shown and shown.count("<svg") == 4 and len(shown) < 300_000
    assert "<script" not in shown and "1 in 0." in summary._repr_html_() and "the fall with it" not in shown


def test_a_log_of_a_fall_says_that_its_error_has_the_fall_in_it(tmp_path):
    import sim

    pushed = sim.with_values(sim.load("undisturbed"), {"pushes.0.force": 300.0, "pushes.0.step": 1, "steps": 2})
    summary = sim.run(pushed, controller="zd-pd", log=tmp_path / "a.mcap")
    assert summary.outcome == "fell" and " rad, the fall with it" in sim.read(summary.log)._repr_html_()


def test_importing_the_face_loads_no_engine():
    code = "import sim, sys; sim.load; sys.exit(bool({'mujoco', 'numba'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], cwd=Path(cli.__file__).parents[1]).returncode == 0


def test_the_controller_to_start_from_is_python():
    from sim.commands.new import CONTROLLER

    ast.parse(CONTROLLER)


def test_doctor_names_the_extra_that_brings_what_is_missing(capsys, monkeypatch):
    from sim.commands import doctor

    finding = doctor.Finding(what="extra video", found="without imageio", well=None, hint="pip install 'x[video]'")
    monkeypatch.setattr(doctor, "examine", lambda: iter([finding]))
    assert cli.main(["doctor"]) == 0
    assert "pip install 'x[video]'" in capsys.readouterr().out
