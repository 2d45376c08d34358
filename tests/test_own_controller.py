"""The tutorial runs as it stands, and the public face is what docs/api.md says."""

import inspect
import re
import runpy
import shlex
import subprocess
import sys

import pytest
from conftest import ROOT

import controller
import sim
from sim import cli
from sim.trials.run.recall import open_results

TEXT = (ROOT / "docs" / "own-controller.md").read_text()
API = (ROOT / "docs" / "api.md").read_text()
FILES = dict(re.findall(r"^```(?:python|toml)\n# (\w+\.\w+)\n(.*?)^```$", TEXT, re.M | re.S))
COMMANDS = [line for block in re.findall(r"^```sh\n(.*?)^```$", TEXT, re.M | re.S) for line in block.splitlines()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where a reader has followed the tutorial."""
    path = tmp_path_factory.mktemp("tutorial")
    for name, text in FILES.items():
        (path / name).write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(path)
        patch.syspath_prepend(str(path))
        for line in COMMANDS:
            assert cli.main([*shlex.split(line)[1:], *["--quiet"] * ("review" not in line)]) == 0, line
        runpy.run_path("walk.py")
    return path


def test_the_files_and_commands_of_the_tutorial_run(folder):
    assert {"pd.py", "lqr.py", "policy.py", "pd.toml", "all.toml", "walk.py"} <= set(FILES) and len(COMMANDS) == 7
    assert len(FILES["pd.py"].splitlines()) <= 40
    logs = {name: sim.read(folder / f"{name}.mcap") for name in ("pd", "lqr", "policy", "again")}
    outcomes = {name: log.result["outcome"] for name, log in logs.items()}
    assert outcomes == {"pd": "completed", "lqr": "completed", "policy": "fell", "again": "completed"}
    assert logs["lqr"]["/diagnostics"].units == {"cost_to_go": "1", "clock": "rad"}
    assert (logs["lqr"]["/diagnostics"]["clock"] == logs["lqr"]["/control"]["theta"]).all()


def test_trials_hold_every_controller_beside_the_papers(folder):
    with open_results(folder / "all-trials") as results:
        outcomes = {(row.controller, row.trial): row.outcome for row in results}
    assert len(outcomes) == 8 and "error" not in outcomes.values()
    assert all(outcomes["c-mpc", trial] == "completed" for trial in (0, 1))
    assert all(outcomes["./policy.py", trial] == "fell" for trial in (0, 1))


def test_the_page_plots_a_controllers_own_figures(folder):
    page = (folder / "both.html").read_text()
    assert "own-cost_to_go" in page and "own-clock" in page and "own-effort" in page


LEAST = """
class Limp:
    def reset(self, stance): pass
    def step(self, observation): return [0.0] * 4
make = Limp
"""
EVERYWHERE = """
cmpc run undisturbed --controller limp.py --log limp.mcap
cmpc trials pd.toml --controllers limp.py,zd-pd --out limp-trials
cmpc review limp.mcap --out limp.html
"""


def test_a_controller_in_run_trials_and_review_takes_few_lines(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert len((LEAST + EVERYWHERE).split("\n")) <= 15
    (folder / "limp.py").write_text(LEAST)
    (folder / "pd.toml").write_text(FILES["all.toml"])
    for line in EVERYWHERE.split("\n")[1:-1]:
        assert cli.main([*shlex.split(line)[1:], *["--quiet"] * ("review" not in line)]) == 0, line


def test_the_public_face_is_documented_and_loads_nothing_before_it_is_used():
    for package in (sim, controller):
        for name in package.__all__:
            assert f"`{name}" in API or f"`sim.{name}" in API or f"sim.{name}" in API, name
            value = getattr(package, name)
            assert name.isupper() or name == "__version__" or inspect.getdoc(value), name
    listed = re.findall(r"^\| `sim\.(\w+)", API, re.M)
    assert sorted(listed) == sorted(sim.__all__)
    code = "import sim, controller, sys; print({'numpy', 'mujoco', 'numba', 'pinocchio'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout == "set()\n"
    with pytest.raises(AttributeError, match="it has ControlStep"):
        _ = sim.nothing
