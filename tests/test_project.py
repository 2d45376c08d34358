"""The files around the code: pinned versions cover what is required, on every machine."""

import os
import re
import subprocess
import sys
import tomllib

from conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PINS = (ROOT / "constraints.txt").read_text().splitlines()


def name(requirement):
    return re.match(r"[A-Za-z0-9._-]+", requirement)[0].lower().replace("_", "-")


def test_constraints_are_exact_versions_and_nothing_else():
    for line in PINS:
        assert re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][0-9A-Za-z.]*", line), line
    assert len({name(line) for line in PINS}) == len(PINS)


def test_everything_required_is_pinned():
    extras = PROJECT["optional-dependencies"]
    required = {name(r) for r in PROJECT["dependencies"] + [r for group in extras.values() for r in group]}
    assert required - {PROJECT["name"]} <= {name(line) for line in PINS}


def test_a_users_own_files_do_not_hide_ours_from_import_cmpc(tmp_path):
    site, own = tmp_path / "site", tmp_path / "own"
    site.mkdir()
    own.mkdir()
    (site / "cmpc.py").write_text((ROOT / "sim" / "front.py").read_text())
    for name in ("sim.py", "controller.py", "models.py"):
        (own / name).write_text("raise SystemExit('the own one')\n")
    (own / "walk.py").write_text("import cmpc, sim\nprint(cmpc.load('undisturbed').name, sim.__file__)\n")
    (own / "late.py").write_text(
        "import sys\nsys.modules['sim'] = type(sys)('sim')\nsys.modules['sim'].__file__ = '/x/y/sim.py'\nimport cmpc\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}

    def python(*words):
        return subprocess.run([sys.executable, *words], cwd=own, env=environment, capture_output=True, text=True)

    done = python("walk.py")
    assert done.stdout.split() == ["undisturbed", str(ROOT / "sim" / "__init__.py")], done.stderr
    assert "/x/y/sim.py hides the package sim of cmpc-walker" in python("late.py").stderr
    assert python("-P", "-m", "cmpc", "--version").stdout.startswith("cmpc ")


def test_the_package_says_whose_and_what_it_is():
    assert PROJECT["authors"] and PROJECT["license"] == "Apache-2.0"
    versions = [word.rpartition(" ")[2] for word in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", word)]
    assert versions == ["3.11", "3.12", "3.13", "3.14"] and PROJECT["requires-python"] == ">=3.11,<3.15"
