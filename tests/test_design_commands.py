"""`cmpc gait`, `cmpc walker` and `cmpc gains` as a user meets them."""

import dataclasses
import json
import os
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from conftest import RABBIT
from random_walkers import scaled_urdf

from controller.common.toml import quoted
from controller.design.requirements import Requirements
from controller.fitting.library import check_grid
from sim.bridge.gaits import check_new_file
from sim.cli import main
from sim.commands.gait import REQUIREMENTS
from sim.errors import UserError

URDF = RABBIT / "rabbit.urdf"
TAC = RABBIT.parent / "rabbit-tac" / "gaits" / "L0.40-v1.05.toml"
TOO_FAST = 5.0  # [m/s]


def run(capsys, *argv):
    code = main([str(word) for word in argv])
    out, err = capsys.readouterr()
    return code, out, err


def test_flags_of_requirements_are_its_fields():
    fields = {field.name for field in dataclasses.fields(Requirements)}
    assert set(REQUIREMENTS) == fields - {"step_length", "speed"}


def test_check_passes_the_polished_gait_and_fails_the_printed_one(capsys):
    code, out, _ = run(capsys, "gait", "check", "paper-polished", "--json")
    found = json.loads(out)
    assert (code, found["passed"]) == (0, True)
    assert found["periodicity"] <= 1e-8 and found["eigenvalues"][0] == pytest.approx(found["delta2"], abs=0.01)
    code, out, _ = run(capsys, "gait", "check", RABBIT / "gaits" / "paper.toml")
    assert code == 1 and "VIOLATED" in out


def test_polish_then_plot(capsys, tmp_path):
    file, picture = tmp_path / "p.toml", tmp_path / "p.png"
    code, out, _ = run(capsys, "gait", "polish", "paper", "--out", file, "--plot", picture, "--json")
    assert code == 0 and json.loads(out)["largest_change_rad"] <= 0.02
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_gait_file_is_written_whole_or_not_at_all_as_the_umask_says(capsys, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left")

    file, before = tmp_path / "p.toml", os.umask(0o077)
    try:
        assert run(capsys, "gait", "polish", "paper", "--out", file)[0] == 0
    finally:
        os.umask(before)
    kept = file.read_bytes()
    assert file.stat().st_mode & 0o777 == 0o600
    monkeypatch.setattr(os, "replace", full)
    code, _, err = run(capsys, "gait", "polish", "paper", "--out", file, "--force")
    assert code == 2 and "cannot be written: No space left" in err and err.count("\n") == 1
    assert [*tmp_path.iterdir()] == [file] and file.read_bytes() == kept


def test_a_gait_of_any_name_is_written_as_toml(capsys, tmp_path):
    text, file = (RABBIT / "gaits" / "paper.toml").read_text(), tmp_path / "p.toml"
    odd = tmp_path / "p\udcff.toml"  # a name that UTF-8 cannot encode, which is the gait's where it has no other
    odd.write_text(re.sub("(?m)^name = .*", "", text))
    assert run(capsys, "gait", "polish", odd, "--out", file)[0] == 0
    assert tomllib.loads(file.read_text(encoding="utf-8"))["name"] == "p?-polished"
    name = 'two\nlines\t\\ "\x7f\x01 \U0001f6b6'
    odd.write_text(re.sub("(?m)^name = .*", lambda _: f"name = {quoted(name)}", text))
    for force in (["--force"], []):  # the second time the file is known as one of the same making
        assert run(capsys, "gait", "polish", odd, "--out", file, *force)[0] == 0
        assert tomllib.loads(file.read_text(encoding="utf-8"))["name"] == f"{name}-polished"


OFF_GRID = {
    "two speeds of one name": (["--speeds", 0.8, 0.501, 0.504], "--speeds 0.501 m/s"),
    "a rounded speed": (["--speeds", 0.555], "--speeds 0.555 m/s"),
    "a rounded length": (["--step-lengths", 0.4, 0.4049, "--speeds", 0.8], "--step-lengths 0.4049 m"),
}


@pytest.mark.parametrize("flags, words", OFF_GRID.values(), ids=OFF_GRID.keys())
def test_a_library_refuses_what_its_file_names_cannot_tell(capsys, tmp_path, flags, words):
    folder = tmp_path / "rabbit"
    shutil.copytree(RABBIT, folder)
    before = sorted(folder.rglob("*"))
    code, _, err = run(capsys, "gait", "library", "--walker", folder, "--degree", 4, "--starts", 1, *flags)
    assert code == 2 and f"{words}: must be a multiple of 0.01 m" in err and err.count("\n") == 1, err
    assert sorted(folder.rglob("*")) == before


def test_a_library_takes_every_hundredth():
    check_grid("--speeds", "m/s", [k / 100 for k in range(1, 300)])


BENT = "q_minus = [3.14, 4.44, 0.0, -2.4, 0.0]"
UNPOLISHED = {
    "degree": ("degree = 2\nalpha = [[3, 3, 3], [3, 3, 3], [0, 0, 0], [0, 0, 0]]", ["degree = 2", "must be 4 or more"]),
    "no posture": (f"{BENT}\nalpha = {[[0.0] * 7] * 4}", ["rabbit.urdf", "cannot stand"]),
}


@pytest.mark.parametrize("lines, words", UNPOLISHED.values(), ids=UNPOLISHED.keys())
def test_a_gait_that_cannot_be_polished_is_one_line(capsys, tmp_path, lines, words):
    """Whatever its tolerances let pass."""
    file, out = tmp_path / "g.toml", tmp_path / "p.toml"
    rows = tomllib.loads((RABBIT / "gaits" / "paper.toml").read_text()) | tomllib.loads(lines)
    rows |= {"periodicity_tolerance_rad": 1e6, "periodicity_tolerance_rad_s": 1e6}
    file.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in rows.items()))
    code, _, err = run(capsys, "gait", "polish", file, "--out", out)
    assert code == 2 and err.count("\n") == 1 and all(word in err for word in words), err
    assert not out.exists()


def test_a_walker_from_its_urdf_to_its_walk(capsys, tmp_path):
    """Half of RABBIT, dynamically similar: what holds for the one must hold for the other."""
    folder, urdf = tmp_path / "mine", tmp_path / "half.urdf"
    urdf.write_text(scaled_urdf(0.5))
    code, out, _ = run(capsys, "walker", "new", folder, "--urdf", urdf)
    assert code == 0 and "cmpc gait design" in out
    code, out, _ = run(capsys, "walker", "check", folder)
    assert code == 1 and "FAIL  gaits: none" in out
    assert re.findall("FAIL", out) == ["FAIL"]
    design = ["gait", "design", "--walker", folder, "--step-length", 0.2, "--step-time", 0.35, "--degree", 5, "--json"]
    code, out, _ = run(capsys, *design, "--starts", 1)
    assert code == 0
    gait = Path(json.loads(out)["file"])
    kept = gait.read_bytes()
    code, _, err = run(capsys, *design, "--starts", 1, "--torque-share", 0.8)
    assert code == 2 and gait.name in err and "--force" in err and gait.read_bytes() == kept
    code, out, _ = run(capsys, "walker", "check", folder, "--steps", 5, "--json")
    assert code == 0 and all(stage["holds"] for stage in json.loads(out)["stages"])


def test_a_file_is_made_again_by_the_same_request_alone(tmp_path):
    out = tmp_path / "g.toml"
    check_new_file(out, "Made by: this", force=False)
    out.write_text("# Made by: this\nname = 1\n")
    check_new_file(out, "Made by: this", force=False)
    for remark in ("Made by: that", None):
        check_new_file(out, remark, force=True)
        with pytest.raises(UserError, match="another file is there"):
            check_new_file(out, remark, force=False)


def test_compare_tells_two_gaits_apart(capsys, tmp_path):
    picture = tmp_path / "c.png"
    code, out, _ = run(capsys, "gait", "compare", "paper-polished", "L0.40-v0.80", "--json", "--plot", picture)
    found = json.loads(out)
    assert code == 0 and picture.read_bytes().startswith(b"\x89PNG")
    alpha = {name: np.array(found["alpha_rad"][name]) for name in ("first", "second")}
    assert np.array(found["apart_rad"]) == pytest.approx(alpha["second"] - alpha["first"])
    costs = found["measures"]["squared_torque_N2ms"]
    for gait, name in (("paper-polished", "first"), ("L0.40-v0.80", "second")):
        _, out, _ = run(capsys, "gait", "check", gait, "--json")
        assert costs[name] == pytest.approx(json.loads(out)["cost_N2ms"])
    code, out, _ = run(capsys, "gait", "compare", "paper-polished", "paper-polished")
    assert code == 0 and "apart by 0.0000 rad" in out


def test_check_sees_models_that_disagree(capsys, tmp_path):
    folder = tmp_path / "mine"
    run(capsys, "walker", "new", folder, "--urdf", URDF)
    mjcf = folder / "mine.xml"
    mjcf.write_text(mjcf.read_text().replace('mass="12"', 'mass="12.1"'))
    code, out, _ = run(capsys, "walker", "check", folder)
    assert code == 1 and "FAIL  MJCF and URDF agree: mass matrix" in out


BAD_URDF = {
    "grams": ('mass value="12"', 'mass value="12000"', ["12000 kg", "grams", "must be"]),
    "millimetres": ('origin xyz="0 0 0.4"', 'origin xyz="0 0 400"', ["400 m", "millimetres"]),
    "inertia": ('iyy="1.33"', 'iyy="1330"', ["radius of gyration", "must be"]),
    "another topology": ('tip" type="fixed"', 'ankle" type="continuous"', ["left_ankle", "five links", "must be"]),
}


@pytest.mark.parametrize("old, new, words", BAD_URDF.values(), ids=BAD_URDF.keys())
def test_what_is_no_walker_is_refused(capsys, tmp_path, old, new, words):
    path = tmp_path / "bad.urdf"
    path.write_text(URDF.read_text().replace(old, new))
    code, _, err = run(capsys, "walker", "new", tmp_path / "mine", "--urdf", path)
    assert code == 2 and all(word in err for word in words), err
    assert not (tmp_path / "mine").exists()


BAD = {
    "impossible speed": (
        ["gait", "design", "--step-length", 0.4, "--speed", TOO_FAST, "--degree", 4],
        ["nearest", "misses by", "must be"],
    ),
    "neither speed nor time": (["gait", "design", "--step-length", 0.4], ["--speed", "--step-time"]),
    "degree": (["gait", "design", "--step-length", 0.41, "--speed", 0.8, "--degree", 3], ["degree = 3", "4 to 10"]),
    "friction nan": (["gait", "check", "paper", "--friction", "nan"], ["--friction", "finite"]),
    "unknown subcommand": (["gait", "desing"], ["desing", "did you mean design"]),
    "polish over a file": (["gait", "polish", "paper", "--out", RABBIT / "gaits" / "paper.toml"], ["--force"]),
    "nothing to compare with": (["gait", "compare", "paper"], ["required"]),
    "compared with another walker's": (["gait", "compare", "paper", TAC], ["fingerprint", "cmpc gait design"]),
    "gait of another walker": (["gait", "check", "L0.40-v0.80", "--walker", "rabbit-tac"], ["no such gait"]),
    "folder exists": (["walker", "new", RABBIT, "--urdf", URDF], ["already exists"]),
    "folder name": (["walker", "new", "Not A Name", "--urdf", URDF], ["Not A Name", "must be"]),
    "no urdf": (["walker", "new", "x", "--urdf", "nowhere.urdf"], ["nowhere.urdf", "no such"]),
    "gain of zero": (["gains", "search", "--kp", 0, 1, 1, 1, "--out", "g.toml"], ["--kp", "above 0"]),
    "no evaluations": (["gains", "search", "--evaluations", 0, "--out", "g.toml"], ["--evaluations 0", "must be"]),
}


@pytest.mark.parametrize("argv, words", BAD.values(), ids=BAD.keys())
def test_bad_input_is_one_line_and_code_2(capsys, tmp_path, monkeypatch, argv, words):
    monkeypatch.chdir(tmp_path)
    code, _, err = run(capsys, *argv)
    last = err.strip().splitlines()[-1]
    assert code == 2 and last.startswith("cmpc: error:") and all(word in last for word in words), err
    assert not list(tmp_path.iterdir())


def test_a_gait_file_of_another_walker_is_refused(capsys):
    path = RABBIT / "gaits" / "L0.40-v0.80.toml"
    code, _, err = run(capsys, "gait", "check", path, "--walker", "rabbit-tac")
    assert code == 2 and "fingerprint" in err and "cmpc gait design" in err


def test_gain_search_resumes_and_writes_a_scenario(capsys, tmp_path):
    out = tmp_path / "g.toml"
    code, _, _ = run(capsys, "gains", "search", "--evaluations", 2, "--out", out)
    record = out.with_suffix(".jsonl")
    first = record.read_text()
    assert code == 0
    record.write_text(first + '{"point": [1.0,')  # stopped in the middle of a line
    code, text, err = run(capsys, "gains", "search", "--evaluations", 4, "--out", out, "--json")
    assert code == 0 and "goes on" in err and record.read_text().startswith(first)
    found = json.loads(text)
    assert found["found"]["score"] <= found["start"]["score"]
    code, text, _ = run(capsys, "run", out, "--steps", 2, "--no-log", "--json")
    assert code == 0 and json.loads(text)["outcome"] == "completed"
    code, _, err = run(capsys, "gains", "search", "--seed", 1, "--out", out)
    assert code == 2 and "another search" in err
