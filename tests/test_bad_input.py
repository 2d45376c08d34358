"""Bad input end to end: one line that names the thing, exit code 2, no traceback, nothing lost."""

import os
import shutil
import subprocess
import sys

import pytest
from conftest import RABBIT, ROOT
from spoken import spoken

from sim import cli


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder of its own with a walker that a test may break."""
    shutil.copytree(RABBIT, tmp_path / "walker" / "rabbit")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "walker" / "rabbit"


def refused(capsys, *argv):
    """The one line on stderr of `cmpc run` with these arguments."""
    code = cli.main(["run", "--quiet", *argv])
    out, err = capsys.readouterr()
    assert (code, out) == (2, ""), err
    err = "".join(line for line in err.splitlines(keepends=True) if not line.startswith("compiling kernels"))
    assert err.startswith("cmpc: error: ") and err.count("\n") == 1 and "Traceback" not in err, err
    return err


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def walker(*more):
    return ("--walker", "walker/rabbit", "--log", "x.mcap", *more)


@pytest.mark.parametrize("name", ["rabbit.xml", "rabbit.urdf"])
def test_missing_model_file(capsys, folder, name):
    (folder / name).unlink()
    assert name in refused(capsys, *walker())


def test_missing_walker_names_the_shipped_ones(capsys):
    message = refused(capsys, "--walker", "rabit", "--no-log")
    assert "'rabit'" in message and "'rabbit'" in message


def test_missing_gait_names_the_shipped_ones(capsys):
    message = refused(capsys, "--gait", "papr", "--no-log")
    assert "'papr'" in message and "'paper'" in message
    assert "none.toml" in refused(capsys, "--gait", "none.toml", "--no-log")


@pytest.mark.parametrize("word", ["x" * 300, "gait.toml\0", "/" + "y" * 300])
def test_names_that_no_disk_can_have_are_of_nothing(capsys, word):
    assert "no such" in refused(capsys, "--walker", word, "--no-log")
    assert "no such" in refused(capsys, "--gait", word, "--no-log")
    if "/" not in word and "\0" not in word:
        assert "no scenario" in refused(capsys, word, "--no-log")
        assert cli.main(["trials", word, "--out", "o"]) == 2
        assert "no plan" in capsys.readouterr().err
        assert cli.main(["review", f"{word}.mcap"]) == 2
        assert capsys.readouterr().err.endswith(".mcap: File name too long\n")


@pytest.mark.parametrize(
    ("flag", "legal"),
    {
        "--steps": "from 1 to 1000000",
        "--controller.horizon": "from 1 to 10000",
        "--controller.ltv.stages": "from 1 to 2000",
        "--controller.ltv.substeps": "from 1 to 100",
        "--controller.plan.iterations": "from 1 to 100",
        "--sensors.latency": "from 0 to 10000",
        "--pushes.0.step": "from 1 to 1000000",
        "--seed": "0 or above and no more than 9223372036854775807",
    }.items(),
)
def test_numbers_of_things_end_where_room_and_time_do(capsys, flag, legal):
    assert f"must be an integer {legal}" in refused(capsys, flag, "99999999999999999999", "--no-log")


def test_empty_names_are_of_nothing(capsys, monkeypatch, tmp_path):
    assert "no scenario ''" in refused(capsys, "", "--no-log")
    assert "walker = '': no such folder" in refused(capsys, "--walker", "", "--no-log")
    for words in (["pushes", "--out", ""], ["report", ""], ["retry", ""], ["show", "", "--trial", "zd-pd/0"]):
        assert cli.main(["trials", *words]) == 2
        err = capsys.readouterr().err
        assert ("needs --out DIR" in err or "its name is empty" in err) and err.count("\n") == 1
    assert not [path for path in tmp_path.iterdir() if path.name != "walker"]


def test_an_audit_and_a_port_go_with_what_they_are_of(capsys):
    assert "--audit and --live: must be one of them" in refused(capsys, "--audit", "--live")
    assert "--live-port 8765: is of the server of --live" in refused(capsys, "--live-port", "8765", "--no-log")


MODELS = {
    "another topology": ("rabbit.urdf", 'name="right_knee"', 'name="right_ankle"', ["right_ankle", "right_knee"]),
    "mass zero": ("rabbit.urdf", '<mass value="12"/>', '<mass value="0"/>', ["0.0 kg", "above 0 kg"]),
    "mass nan": ("rabbit.urdf", '<mass value="12"/>', '<mass value="nan"/>', ["mass"]),
    "inertia negative": ("rabbit.urdf", 'iyy="1.33"', 'iyy="-1.33"', ["-1.33 kg m^2", "above 0"]),
    "urdf cut short": ("rabbit.urdf", "</robot>", "", []),
    "plant cut short": ("rabbit.xml", "</mujoco>", "", []),
    "plant with an unknown element": ("rabbit.xml", "<worldbody>", "<wordbody>", []),
    "gait not periodic": ("gaits/paper.toml", "-0.85]", "-1.85]", ["not periodic", "rad/s", "0.1 rad/s"]),
    "gait of three rows": (
        "gaits/paper.toml",
        "  [-0.15, -0.18, -0.51, -0.81, -0.48, -0.38, -0.36],",
        "",
        ["alpha", "(3, 7)", "4 rows"],
    ),
    "gait with nan": ("gaits/paper.toml", "3.66", "nan", ["alpha", "not finite"]),
    "gait that is no toml": ("gaits/paper.toml", "alpha = [", "alpha = ", ["TOML"]),
}


@pytest.mark.parametrize("case", MODELS)
def test_a_file_of_the_walker_that_can_not_be_used(capsys, folder, tmp_path, case):
    name, old, new, words = MODELS[case]
    edit(folder / name, old, new)
    message = refused(capsys, *walker())
    assert name.split("/")[-1] in message
    for word in words:
        assert word in message, message
    assert not (tmp_path / "x.mcap").exists()  # nothing is left behind


def test_empty_model_files(capsys, folder):
    for name in ("rabbit.xml", "rabbit.urdf", "gaits/paper.toml"):
        kept = (folder / name).read_bytes()
        (folder / name).write_bytes(b"")
        assert name.split("/")[-1] in refused(capsys, *walker())
        (folder / name).write_bytes(kept)


def test_unknown_solver_names_the_installed_ones(capsys):
    message = refused(capsys, "--controller.solver", "gurobbi", "--no-log")
    assert "'gurobbi'" in message and "controller.solver" in message and "clarabel" in message


def test_an_existing_log_is_never_overwritten(capsys, tmp_path):
    (tmp_path / "x.mcap").write_text("precious")
    assert "x.mcap" in refused(capsys, *walker())
    assert (tmp_path / "x.mcap").read_text() == "precious"


def test_a_log_that_appears_meanwhile_is_not_overwritten(capsys, tmp_path, monkeypatch):
    from sim.commands import run

    monkeypatch.setattr(run, "check_new_log", lambda path: path.write_text("precious"))
    assert "x.mcap" in refused(capsys, *walker("--steps", "1"))
    assert (tmp_path / "x.mcap").read_text() == "precious"


def test_a_log_where_none_can_be(capsys):
    assert "nowhere" in refused(capsys, "--log", "nowhere/x.mcap")
    assert "/proc/x.mcap" in refused(capsys, "--log", "/proc/x.mcap")


SETTINGS = {
    "--plant.timestep 3e-4": ["plant.timestep", "0.0003 s", "0.001 s"],
    "--plant.timestep 0": ["plant.timestep", "above 0"],
    "--plant.mass-factor.left-tibia -1": ["plant.mass_factor.left_tibia", "-1.0", "above 0"],
    "--controller.kp nan 1 1 1": ["controller.kp", "nan"],
    "--start.q-offset 0 0 0 0 inf": ["start.q_offset", "inf"],
    "--controller.horizon 0": ["controller.horizon", "0 ticks"],
    "--controller.periode 1e-3": ["--controller.periode", "--controller.period"],
    "--steps many": ["steps", "integer"],
}


@pytest.mark.parametrize("line", SETTINGS)
def test_a_setting_that_can_not_be(capsys, line):
    message = refused(capsys, *line.split(), "--no-log")
    for word in SETTINGS[line]:
        assert word in message, message


FILES = {
    "[plant]\ntimestp = 1e-3\n": ["plant.timestp", "plant.timestep"],
    "steps = 'ten'\n": ["steps", "'ten'"],
    "steps = true\n": ["steps", "True"],
    "[controller]\nkp = [1.0, 2.0]\n": ["controller.kp", "4"],
    "[plant.mass_factor]\ntorso = 0\n": ["plant.mass_factor.torso", "above 0"],
    "[plant]\nmass_factor = 2\n": ["plant.mass_factor"],
    "[[pushes]]\nforce = nan\nstep = 2\n": ["pushes.0.force", "nan"],
    "[[pushes]]\nforce = 5\n": ["pushes.0", "step"],
    "steps = \n": ["TOML"],
}


@pytest.mark.parametrize("content", FILES)
def test_a_scenario_file_that_can_not_be(capsys, tmp_path, content):
    (tmp_path / "mine.toml").write_text(content)
    message = refused(capsys, "mine.toml", "--no-log")
    assert "mine.toml" in message
    for word in FILES[content]:
        assert word in message, message


def test_the_installed_program_says_it_in_one_line(tmp_path):
    """As a user meets it: a process of its own, exit code 2, one line on stderr, nothing on stdout."""
    edit(tmp_path / "walker" / "rabbit" / "gaits" / "paper.toml", "3.66", "nan")
    kept = {name: os.environ[name] for name in {"NUMBA_CACHE_DIR"} & set(os.environ)}
    done = subprocess.run(
        [sys.executable, "-m", "sim", "run", *walker()],
        capture_output=True,
        text=True,
        check=False,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", **kept},
        cwd=tmp_path,
    )
    assert done.returncode == 2 and done.stdout == "", done.stderr
    (line,) = spoken(done.stderr)
    assert "paper.toml" in line
