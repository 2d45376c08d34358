"""MCAP's reference implementation in JavaScript reads a log: every channel, every message, every CRC.

Needs Node and `npm ci --prefix tests/node`; skipped without.
"""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from sim.bridge.run import run_scenario
from sim.log.read import read_log
from sim.scenario import load, with_values

NODE = Path(__file__).resolve().parent / "node"
pytestmark = [
    pytest.mark.node,
    pytest.mark.skipif(not shutil.which("node"), reason="Node is not installed"),
    pytest.mark.skipif(
        not (NODE / "node_modules/@mcap/core").exists(), reason="@mcap/core is missing: npm ci --prefix tests/node"
    ),
]


def read(path):
    command = ["node", str(NODE / "read_log.mjs"), str(path)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("node") / "run.mcap"
    run_scenario(with_values(load("push-40N-first"), {"steps": 1}), log=path)
    return path


def test_every_channel_and_message_is_read(path):
    log, done = read_log(path), read(path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["done"] and int(found["statistics"]) == found["streamed"]
    assert {t: c["count"] for t, c in found["channels"].items()} == {t: len(log.records(t)) for t in log.channels}
    assert found["channels"]["/control"]["metadata"] == ["descriptions", "units"]
    assert found["attachments"] == {name: len(data) for name, (_, data) in log.attachments.items()}
    assert found["metadata"] == ["run", "result"]


def test_values_are_those_that_were_logged(path):
    log, found = read_log(path), json.loads(read(path).stdout)["channels"]
    control, state = log.channel("/control")[-1], log.channel("/plant/state")[-1]
    last = found["/control"]["last"]
    assert (last["tick"], int(last["time"])) == (control["_tick"], control["_time_ns"])
    assert last["value"]["u_mpc"]["right_knee"] == control["u_mpc.right_knee"]
    assert (
        found["/plant/state"]["last"]["value"]["contact_force"]["left"]["normal"] == state["contact_force.left.normal"]
    )
    _, horizon = log.messages("/prediction")[-1]
    assert found["/prediction"]["last"]["value"]["y"]["swing_knee"] == list(horizon.y.swing_knee)
    _, impact = log.messages("/prediction/impact")[-1]
    assert found["/prediction/impact"]["last"]["value"]["foreseen"] == impact.foreseen


@pytest.mark.parametrize("part", [0.3, 0.6, 0.9])
def test_it_sees_damage_too(path, tmp_path, part):
    data = bytearray(path.read_bytes())
    data[int(part * len(data))] ^= 4
    (tmp_path / "bad.mcap").write_bytes(data)
    assert read(tmp_path / "bad.mcap").returncode != 0
