"""What a log says about where it came from."""

import subprocess
import tomllib
from importlib.metadata import version

import pytest
from conftest import ROOT

from sim.log import provenance
from sim.log.provenance import GitState, git_state, package_versions, platform_name


def git(folder, *arguments):
    identity = ["-c", "user.name=Test", "-c", "user.email=test@example.invalid"]
    done = subprocess.run(
        ["git", *identity, *arguments], cwd=folder, check=True, capture_output=True, text=True, timeout=30
    )
    return done.stdout.strip()


@pytest.fixture
def checkout(tmp_path):
    git(tmp_path, "init", "-q")
    (tmp_path / "a.txt").write_text("a")
    git(tmp_path, "add", "a.txt")
    git(tmp_path, "commit", "-q", "-m", "First")
    return tmp_path


def test_a_clean_checkout_has_its_revision(checkout):
    assert git_state(checkout) == GitState(git(checkout, "rev-parse", "HEAD"), False)


def test_a_change_of_a_tracked_file_makes_it_dirty(checkout):
    (checkout / "a.txt").write_text("b")
    assert git_state(checkout).dirty is True


def test_new_files_do_not_make_it_dirty(checkout):
    """Logs and notes beside the code change nothing about it."""
    (checkout / "b.txt").write_text("b")
    assert git_state(checkout).dirty is False


def test_before_the_first_commit_there_is_no_revision(tmp_path):
    git(tmp_path, "init", "-q")
    assert git_state(tmp_path).revision is None


def test_an_installation_inside_another_checkout_has_no_revision(checkout):
    (checkout / "site-packages").mkdir()
    assert git_state(checkout / "site-packages") == GitState(None, None)


def test_without_git_there_is_no_revision(checkout, monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert git_state(checkout) == GitState(None, None)


def test_asking_does_not_touch_the_checkout(checkout):
    before = (checkout / ".git" / "index").stat().st_mtime_ns
    git_state(checkout)
    assert (checkout / ".git" / "index").stat().st_mtime_ns == before


def test_versions_are_those_of_the_installed_distributions():
    found = package_versions()
    assert found == {name: version(name) for name in provenance.PACKAGES}  # all are required, so all are installed


def test_every_engine_model_and_solver_the_program_requires_is_recorded():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    required = {line.split(">")[0].split("<")[0].split("=")[0].strip() for line in project["dependencies"]}
    without_influence = {
        "rich",
        "jinja2",
        "matplotlib",
        "foxglove-schemas-protobuf",
        "zstandard",
        "lz4",
        "threadpoolctl",
        "shtab",
    }  # show or pack results or complete words, change none, change none
    assert required - without_influence <= set(provenance.PACKAGES)


def test_a_package_that_is_missing_is_left_out(monkeypatch):
    monkeypatch.setattr(provenance, "PACKAGES", ("numpy", "no-such-package"))
    assert list(package_versions()) == ["numpy"]


def test_platform_is_one_line():
    assert "Python 3." in platform_name() and "\n" not in platform_name()
