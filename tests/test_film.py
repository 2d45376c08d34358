"""Films and pictures; those that draw are skipped where there is no OpenGL."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim.bridge.run import run_scenario
from sim.cli import main
from sim.log.read import read_log
from sim.review.film.film import AROUND, _moments
from sim.review.film.story import Story
from sim.scenario import load, with_values

ROOT = Path(__file__).resolve().parent.parent
SIZE = ("--size", "320", "180")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("film") / "run.mcap"
    run_scenario(with_values(load("push-40N-first"), {"time_limit": 0.3, "controller.horizon": 30}), log=path)
    return path


def film(*words, **environment):
    """In a process of its own: MuJoCo chooses OpenGL when it is imported."""
    command = [sys.executable, "-m", "sim", "video", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=os.environ | environment, timeout=120)
    if "cannot draw here" in done.stderr and not environment:
        pytest.skip("no OpenGL: " + done.stderr[-200:])
    return done


def picture(path):
    image = pytest.importorskip("PIL.Image")
    return np.asarray(image.open(path).convert("RGB")).astype(int)


def count(pixels, red, green, blue):
    """Pixels of about a colour's hue."""
    part = pixels / np.maximum(pixels.max(axis=2, keepdims=True), 1)
    wanted = np.array((red, green, blue)) / max(red, green, blue)
    return int((np.abs(part - wanted).max(axis=2) < 0.2).sum())


def test_a_picture_shows_both_legs_and_both_arrows(path, tmp_path):
    pytest.importorskip("PIL")
    done = film(path, tmp_path / "a.png", "--start", 0.2, *SIZE)
    assert done.returncode == 0, done.stderr
    pixels = picture(tmp_path / "a.png")
    assert pixels.shape == (180, 320, 3)
    for name, colour in {
        "left": (33, 120, 181),
        "right": (230, 107, 26),
        "push": (204, 26, 51),
        "contact": (33, 153, 76),
    }.items():
        assert count(pixels, *colour) > 15, name
    film(path, tmp_path / "b.png", "--start", 0.25, *SIZE)
    assert (picture(tmp_path / "b.png") != pixels).any()


def test_long_rough_ground_hides_nothing(tmp_path):
    pytest.importorskip("PIL")
    ground = {"plant.ground.rough.height": 0.005, "plant.ground.rough.start": 0.5, "steps": 200}
    run_scenario(with_values(load("undisturbed"), {"time_limit": 0.05} | ground), log=tmp_path / "run.mcap")
    done = film(tmp_path / "run.mcap", tmp_path / "a.png", *SIZE)
    assert done.returncode == 0, done.stderr
    assert count(picture(tmp_path / "a.png"), 230, 107, 26) > 50


@pytest.fixture(scope="module")
def fall(tmp_path_factory):
    path = tmp_path_factory.mktemp("fall") / "run.mcap"
    run_scenario(with_values(load("undisturbed"), {"controller.kind": "zd-pd", "start.torso_lean": 0.9}), log=path)
    return path


def test_a_still_holds_many_walkers_and_two_runs_stand_side_by_side(path, fall, tmp_path):
    pytest.importorskip("PIL")
    for words in (["one.png", "--start", 0.25], ["many.png", "--strobe", 4], ["two.png"]):
        logs = [path, fall] if words[0] == "two.png" else [path]
        done = film(*logs, tmp_path / words[0], *words[1:], "--plain", *SIZE)
        assert done.returncode == 0, done.stderr

    def orange(pixels):  # faded too
        red, green, blue = np.moveaxis(pixels, 2, 0)
        return int(((red - blue > 50) & (red > green) & (green > blue)).sum())

    one, many, two = (picture(tmp_path / name) for name in ("one.png", "many.png", "two.png"))
    assert orange(many) > 1.5 * orange(one) > 50
    assert all(orange(half) > 50 for half in np.array_split(two, 2, axis=1))


def test_a_story_tells_time_step_push_limits_and_fall(path, fall):
    story = Story(read_log(path))
    moment = story.at(0.1)
    assert (moment.t, moment.step, moment.push, moment.end) == (0.1, 1, pytest.approx(40.0), "")
    assert {"left hip", "right knee", "friction"} <= set(moment.shares)
    assert max(story.at(t).shares["left hip"] for t in np.arange(0.0, 0.3, 0.001)) <= 1.0 + 1e-9
    story = Story(read_log(fall))
    assert story.at(story.began - 1e-3).fall == "" and story.at(story.began).fall
    late = story.at(story.end + 1.0)
    assert (late.t, late.end) == (story.end, "fell")


def test_bars_turn_red_at_a_limit_and_a_push_is_told(path):
    pytest.importorskip("PIL")
    from sim.review.film.caption import Captions
    from sim.review.film.story import Moment

    white = np.full((360, 640, 3), 255, np.uint8)

    def drawn(push, share):
        moment = Moment(t=1.0, step=2, push=push, shares={"left hip": share}, fall="", end="")
        return Captions("a", (640, 360)).over(white, moment, 1.0).astype(int)

    assert count(drawn(0.0, 1.0)[180:], 200, 68, 47) > 300 > count(drawn(0.0, 0.5)[180:], 200, 68, 47)
    assert count(drawn(40.0, 0.5)[:180], 200, 68, 47) > 100 > count(drawn(0.0, 0.5)[:180], 200, 68, 47)


def test_slow_motion_is_around_the_onset():
    quick = _moments(0.0, 2.0, 50.0, 1.0, 1.0, 1.0)
    slow = _moments(0.0, 2.0, 50.0, 1.0, 1.0, 0.25)
    assert len(quick) == 101 and len(slow) == pytest.approx(101 + 3 * 50 * 2 * AROUND, abs=5)
    assert {speed for t, speed in slow if abs(t - 1.0) < AROUND} == {0.25}
    assert {speed for t, speed in slow if abs(t - 1.0) > AROUND + 0.02} == {1.0}


@pytest.mark.parametrize("kind", ["mp4", "gif"])
def test_a_film_has_every_picture(path, tmp_path, kind):
    pytest.importorskip("PIL" if kind == "gif" else "imageio_ffmpeg")
    done = film(path, tmp_path / f"a.{kind}", "--end", 0.2, "--fps", 20, *SIZE)
    assert done.returncode == 0, done.stderr
    assert "(5 pictures" in done.stdout
    head = (tmp_path / f"a.{kind}").read_bytes()[:12]
    assert head[:6] == b"GIF89a" if kind == "gif" else head[4:8] == b"ftyp"


def test_without_opengl_the_packages_are_named(path, tmp_path):
    pytest.importorskip("PIL")
    done = film(path, tmp_path / "a.png", MUJOCO_GL="disable")
    assert done.returncode == 2 and "libegl1" in done.stderr and "libosmesa6" in done.stderr
    assert done.stderr.strip().splitlines()[-1].startswith("cmpc: error: ")
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["a.avi"], "must end in one of .mp4, .gif, .png"),
        (["a.png", "--start", "9"], "--start 9 s: must be within 0 and"),
        (["a.png", "--end", "nan"], "--end nan s: must be a time of 0 s or above"),
        (["a.png", "--strobe", "3", "--end", "-1"], "--end -1 s: must be a time of 0 s or above"),
        (["nowhere/a.gif"], "nowhere is no folder"),
        (["a.png", "--fps", "0"], "--fps 0 1/s"),
        (["a.png", "--size", "5", "9999999"], "each must be within"),
        (["a.png", "--speed", "-1"], "--speed -1"),
        (["a.png", "--slow", "0"], "--slow 0"),
        (["a.png", "--strobe", "1"], "--strobe 1: must be within 2 and 40"),
        (["a.mp4", "--strobe", "3"], "must end in .png"),
        ([], "the file to write"),
    ],
)
def test_bad_input_is_one_line(path, tmp_path, capsys, monkeypatch, words, message):
    pytest.importorskip("PIL")
    monkeypatch.chdir(tmp_path)
    assert main(["video", str(path), *words]) == 2
    err = capsys.readouterr().err
    assert message in err and err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_an_existing_film_is_kept(path, tmp_path, capsys):
    pytest.importorskip("PIL")
    (tmp_path / "a.png").write_bytes(b"precious")
    assert main(["video", str(path), str(tmp_path / "a.png")]) == 2
    assert (tmp_path / "a.png").read_bytes() == b"precious"


def test_a_viewer_needs_a_display(capsys, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert main(["run", "--viewer", "--no-log"]) == 2
    assert "needs a display" in capsys.readouterr().err
