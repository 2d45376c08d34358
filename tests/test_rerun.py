"""A log in Rerun: the recording, and a picture of the real viewer in a browser."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from sim.bridge.run import run_scenario
from sim.cli import main
from sim.scenario import load, with_values
from tests import browser as browsers

PORTS = 19191, 19876


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    pytest.importorskip("rerun")
    folder = tmp_path_factory.mktemp("rerun")
    scenario = with_values(load("push-40N-first"), {"time_limit": 0.3, "controller.kind": "zd-pd"})
    run_scenario(scenario, log=folder / "run.mcap")
    assert main(["review", "--layout", "rerun", str(folder / "run.mcap"), str(folder / "run.rrd")]) == 0
    return folder / "run.rrd"


def rerun(*words):
    return [str(Path(sys.executable).with_name("rerun")), *map(str, words)]


def test_a_recording_has_walker_forces_plots_and_events(recording):
    done = subprocess.run(
        rerun("rrd", "print", "-v", recording), capture_output=True, text=True, timeout=60, check=True
    )
    for entity in ("/world/torso", "/world/left_tibia", "/world/ground", "/world/forces/push", "/events"):
        assert entity in done.stdout, entity
    assert "/control/u_zd/left_hip" in done.stdout and "/plant/state/torque/right_knee" in done.stdout


def test_what_it_takes_is_said_in_one_line(recording, tmp_path, capsys):
    log = recording.with_suffix(".mcap")
    for words in ([log], [log, tmp_path / "a.xml"], [log, recording]):
        assert main(["review", "--layout", "rerun", *map(str, words)]) == 2
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.campaign
def test_the_viewer_shows_the_walker_at_once(recording, tmp_path, monkeypatch):
    """Rerun's own web viewer, drawn by a software renderer: both legs, ground and a force are in the picture."""
    pytest.importorskip("PIL")
    soft = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
    monkeypatch.setattr(browsers, "FLAGS", (*(one for one in browsers.FLAGS if one != "--disable-gpu"), *soft))
    web, grpc = PORTS
    server = subprocess.Popen(
        rerun("--serve-web", "--web-viewer-port", web, "--port", grpc, recording),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # the command starts the viewer as a child of its own
    )
    try:
        time.sleep(3.0)
        with browsers.Browser(tmp_path / "profile", 1400, 900) as browser:
            source = f"rerun%2Bhttp%3A%2F%2F127.0.0.1%3A{grpc}%2Fproxy"
            browser.call("Page.navigate", url=f"http://127.0.0.1:{web}/?url={source}&renderer=webgl")
            seen, last = False, time.monotonic() + 60.0
            while not seen and time.monotonic() < last:
                time.sleep(2.0)
                with contextlib.suppress(AssertionError):  # between the empty page and the viewer's there is none
                    seen = shown(browser.screenshot(tmp_path / "rerun.png"))
            assert seen
    finally:
        os.killpg(server.pid, signal.SIGTERM)
        server.wait()


def shown(picture):
    """Whether legs, ground, a force and curves are in a picture of the viewer."""
    red, green, blue = np.moveaxis(picture.astype(int), 2, 0)
    left, right = (blue - red > 60) & (blue > 120), (red - blue > 60) & (red > 150) & (green > 60)
    force, grey = (green - red > 40) & (green - blue > 20), (abs(red - blue) < 16) & (abs(red - 190) < 15)
    half = picture.shape[1] * 2 // 5
    enough = [int(mask[60:640, :half].sum()) for mask in (left, right, force, grey)]
    curves = [int(mask[60:640, half:].sum()) for mask in (left, right, force)]
    return min(enough) > 60 and enough[3] > 3000 and min(curves) > 60
