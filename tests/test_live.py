"""A run while it goes on: the growing log read piece by piece, over a WebSocket, as a page that renews itself."""

import json
import os
import struct
import threading
import time

import pytest

from sim.bridge.run import run_scenario
from sim.cli import main
from sim.log.read import read_log
from sim.log.read.follow import follow
from sim.review.follow import RENEW, follow_page
from sim.scenario import load, with_values

PORT = 18765
FEW = {"time_limit": 0.45, "controller.kind": "zd-pd"}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("live") / "run.mcap"
    run_scenario(with_values(load("push-40N-first"), FEW), log=path)
    return path


def test_a_growing_log_is_read_to_its_last_message(path, tmp_path):
    """Written in pieces that end anywhere; every message comes once, as it stands in the log."""
    whole, target, done = path.read_bytes(), tmp_path / "growing.mcap", threading.Event()

    def write():
        with target.open("wb", buffering=0) as file:
            for at in range(0, len(whole), 50_001):
                file.write(whole[at : at + 50_001])
                time.sleep(0.01)
        done.set()

    writer = threading.Thread(target=write)
    writer.start()
    found = {}
    for piece in follow(target, done.is_set):
        for number, record in piece.messages:
            found.setdefault(piece.channels[number][0].topic, []).append(record)
    writer.join()
    log = read_log(path)
    assert {topic: log.records(topic) for topic in log.channels if log.records(topic)} == found


def test_a_cut_log_is_read_as_far_as_it_goes(path, tmp_path):
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    count = sum(len(piece.messages) for piece in follow(tmp_path / "cut.mcap", lambda: True))
    assert 0 < count < sum(len(read_log(path).records(topic)) for topic in read_log(path).channels)
    assert list(follow(tmp_path / "none.mcap", lambda: True)) == []


def test_a_page_follows_its_log(path, tmp_path):
    whole, log, target, told = path.read_bytes(), tmp_path / "a.mcap", tmp_path / "a.html", []
    log.write_bytes(whole[: len(whole) * 2 // 3])

    def tell(line):
        told.append((line, f'http-equiv="refresh" content="{RENEW}"' in target.read_text()))
        log.write_bytes(whole)

    assert follow_page(log, target, tell)
    assert [renews for _, renews in told] == [True, False]
    assert "so far" in told[0][0] and "whole" in told[-1][0]
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a.html", "a.mcap"]


def client(port, read=True):
    """Messages by topic that a WebSocket client of Foxglove's protocol is sent; one that stalls reads nothing."""
    websockets = pytest.importorskip("websockets.sync.client")
    topics, counts, last = {}, {}, time.monotonic() + 30.0
    while True:
        try:
            socket = websockets.connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"], max_size=None)
            break
        except OSError:
            assert time.monotonic() < last, "nobody serves"
            time.sleep(0.05)
    with socket:
        from websockets.exceptions import ConnectionClosed

        try:
            while True:
                message = socket.recv(timeout=20)
                if isinstance(message, str):
                    told = json.loads(message)
                    if told["op"] == "advertise":
                        topics |= {one["id"]: one["topic"] for one in told["channels"]}
                        wanted = [{"id": one["id"], "channelId": one["id"]} for one in told["channels"]]
                        socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
                        while not read:
                            time.sleep(0.1)
                elif message[0] == 1:
                    topic = topics[struct.unpack_from("<I", message, 1)[0]]
                    counts[topic] = counts.get(topic, 0) + 1
        except ConnectionClosed:
            return counts


def test_a_client_is_sent_every_message(tmp_path, capsys):
    pytest.importorskip("foxglove")
    pytest.importorskip("websockets")
    found = {}
    reader = threading.Thread(target=lambda: found.update(client(PORT)), daemon=True)
    reader.start()
    words = ["--controller", "zd-pd", "--time-limit", "0.45", "--log", str(tmp_path / "run.mcap"), "--quiet"]
    assert main(["run", "push-40N-first", *words, "--live", "--live-port", str(PORT)]) == 0
    reader.join(10.0)
    log = read_log(tmp_path / "run.mcap")
    assert found == {topic: len(log.records(topic)) for topic in log.channels if log.records(topic)}
    assert found["/plant/state"] == 450
    assert f"ws://127.0.0.1:{PORT}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--no-log", "--live"], "--live and --no-log: must be one of them"),
        (["--live", "--live-port", "0"], "--live-port 0: must be within 1 and 65535"),
    ],
)
def test_bad_input_is_one_line(tmp_path, monkeypatch, capsys, words, message):
    pytest.importorskip("foxglove")
    monkeypatch.chdir(tmp_path)
    assert main(["run", "undisturbed", *words]) == 2
    err = capsys.readouterr().err
    assert message in err and err.count("\n") == 1


@pytest.mark.campaign
def test_the_loop_is_not_slowed(tmp_path, capsys):
    """CPU time of the running process, without, with a client that reads, and with one that stalls."""
    pytest.importorskip("foxglove")
    base = ["run", "push-25N", "--steps", "20", "--quiet"]
    times = {"without": [], "reads": [], "stalls": []}
    main([*base, "--log", str(tmp_path / "warm.mcap")])
    for turn in range(3):
        for number, how in enumerate(times):
            port, log = PORT + 10 * turn + number, tmp_path / f"{turn}{how}.mcap"
            words = [*base, "--log", str(log)]
            if how != "without":
                threading.Thread(target=_quietly, args=(port, how == "reads"), daemon=True).start()
                words += ["--live", "--live-port", str(port)]
            times[how].append(_cpu(words, tmp_path))
    with capsys.disabled():
        least = {how: min(some) for how, some in times.items()}
        shares = ", ".join(f"{how} {value / least['without']:.3f}" for how, value in least.items())
        print(f"\nCPU of the process that runs, over that without --live: {shares}")
    assert max(least.values()) <= 1.05 * least["without"]


def _quietly(port, read):
    import contextlib

    with contextlib.suppress(Exception):
        client(port, read)


def _cpu(words, folder):
    """User time in [s] of a run in a process of its own, its viewer's server left out."""
    import subprocess
    import sys

    code = (
        "import resource, sys; from sim.cli import main; import sim.commands.run as r; walk = r._walk\n"
        "def timed(*a, **k):\n"
        "    before = resource.getrusage(resource.RUSAGE_SELF); out = walk(*a, **k)\n"
        "    after = resource.getrusage(resource.RUSAGE_SELF)\n"
        "    print('CPU', after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, file=sys.stderr)\n"
        "    return out\n"
        "if __name__ == '__main__':\n"
        "    r._walk = timed; main(sys.argv[1:])\n"
    )
    script = folder / "timed.py"
    script.write_text(code)
    environment = os.environ | {"PYTHONPATH": os.getcwd()}
    command = [sys.executable, str(script), *words]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120, check=True)
    return float(next(line for line in done.stderr.splitlines() if line.startswith("CPU")).split()[1])
