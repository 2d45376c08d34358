"""Kernels on disk are never older than the sources they were compiled from, and always have a place."""

import os
import shutil
import subprocess
import sys

import pytest
from conftest import ROOT

from controller.common.compiled import CACHE_VARIABLE, digest

CALLEE = "from controller.common.compiled import compiled\n\n@compiled\ndef half(x):\n    return {}\n"
CALLER = (
    "from controller.common.compiled import compiled\nfrom controller.callee import half\n\n"
    "@compiled\ndef quarter(x):\n    return half(half(x))\n"
)
ASK = "from controller.caller import quarter; print(quarter(8.0), *quarter.stats.cache_hits.values())"


@pytest.fixture
def house(tmp_path):
    """A folder with a package `controller` in which one kernel calls another's file."""
    package = tmp_path / "house" / "controller"
    (package / "common").mkdir(parents=True)
    for file in ("compiled.py", "disk.py"):
        shutil.copy(ROOT / "controller" / "common" / file, package / "common")
    for folder in (package, package / "common"):
        (folder / "__init__.py").touch()
    (package / "callee.py").write_text(CALLEE.format("0.5 * x"))
    (package / "caller.py").write_text(CALLER)
    return package.parent


def ask(house, **environment):
    """What `ASK` prints in a fresh interpreter: (value and cache hits, standard error)."""
    kept = {name: value for name, value in os.environ.items() if name != CACHE_VARIABLE}
    done = subprocess.run(
        [sys.executable, "-c", ASK], cwd=house, capture_output=True, text=True, check=True, env=kept | environment
    )
    return done.stdout.split(), done.stderr


def test_a_kernel_edited_in_a_file_another_calls_takes_effect(house):
    assert ask(house)[0] == ["2.0"]
    assert ask(house)[0] == ["2.0", "1"]  # from disk
    (house / "controller" / "callee.py").write_text(CALLEE.format("0.25 * x"))
    assert ask(house)[0] == ["0.5"]
    (house / "controller" / "callee.py").write_text(CALLEE.format("0.5 * x"))
    assert ask(house)[0] == ["2.0", "1"]  # what was compiled before is still there


def test_a_digest_covers_all_that_a_module_calls(house):
    caller, other = house / "controller" / "caller.py", house / "controller" / "other.py"
    other.write_text(CALLER.replace("callee", "caller").replace("half", "quarter").replace("def quarter", "def less"))
    digests = {path: in_a_fresh_interpreter(house, path) for path in (caller, other)}
    (house / "controller" / "callee.py").write_text(CALLEE.format("x"))
    assert all(in_a_fresh_interpreter(house, path) != before for path, before in digests.items())


def in_a_fresh_interpreter(house, path):
    code = (
        f"from pathlib import Path; from controller.common.compiled import digest; print(digest(Path({str(path)!r})))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=house, capture_output=True, text=True, check=True)
    return done.stdout


def test_no_two_modules_of_kernels_share_a_digest():
    modules = [path for path in (ROOT / "controller").rglob("*.py") if "@compiled" in path.read_text()]
    assert len(modules) > 10
    assert len({digest(path) for path in modules}) == len(modules)


def test_without_a_writable_place_kernels_live_for_one_run_and_that_is_said_once(house, tmp_path):
    cache = house / "controller" / "common" / "__pycache__"
    cache.mkdir(exist_ok=True)
    (cache / "kernels").touch()  # a file where the folder should be
    (tmp_path / "home").touch()
    answer, said = ask(house, HOME=str(tmp_path / "home"), XDG_CACHE_HOME="", TMPDIR=str(tmp_path))
    assert answer == ["2.0"]
    assert said.count("\n") == 1 and CACHE_VARIABLE in said
    assert not list(tmp_path.glob("cmpc-kernels-*"))


def test_two_copies_of_the_project_share_kernels(house, tmp_path):
    kept = {CACHE_VARIABLE: str(tmp_path / "kept")}
    assert ask(house, **kept)[0] == ["2.0"]
    shutil.copytree(house, tmp_path / "copy")
    assert ask(tmp_path / "copy", **kept)[0] == ["2.0", "1"]


def test_the_users_own_place_is_taken(house, tmp_path):
    assert ask(house, **{CACHE_VARIABLE: str(tmp_path / "mine")}) == (["2.0"], "")
    assert len(list((tmp_path / "mine").glob("controller.caller-*"))) == 1


def test_a_kernel_for_any_record_is_kept_by_all_sources_of_the_controller(house):
    """What lies on disk for it names classes of records, which another version may not have."""
    kernel, other = house / "controller" / "callee.py", house / "controller" / "caller.py"
    code = f"from pathlib import Path; from controller.common.compiled import digest as d; p = Path({str(kernel)!r})"

    def digests():
        ask = f"{code}; print(d(p), d(p, whole=True))"
        done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True, cwd=house)
        return done.stdout.split()

    before = digests()
    other.write_text(other.read_text() + "# changed\n")
    after = digests()
    assert before[0] == after[0] and before[1] != after[1]
