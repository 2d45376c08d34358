"""A run killed at any moment leaves a log that loses at most the last half second."""

import os
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from sim.log.read import read_log
from sim.log.tools.check import check
from sim.log.tools.recover import recover

ROOT = Path(__file__).resolve().parent.parent
KILLS = 20

CHILD = """
import os, struct, sys, time
from pathlib import Path
from sim.bridge.run import run_scenario
from sim.scenario import load, with_values

scenario = with_values(load("undisturbed"), {"steps": 100})
run_scenario(with_values(scenario, {"time_limit": 0.01}))  # compile before the clock runs
for number in range(int(sys.argv[1])):
    ticks = -1
    def stop():
        global ticks
        ticks += 1
        os.pwrite(told, struct.pack("<q", ticks), 0)
    folder = Path(sys.argv[2])
    told = os.open(folder / f"{number}.tick", os.O_RDWR | os.O_CREAT)
    pid = os.fork()
    if not pid:
        run_scenario(scenario, log=folder / f"{number}.mcap", stop=stop)
        os._exit(0)
    print(pid, flush=True)
    os.waitpid(pid, 0)
"""


def test_twenty_killed_runs_lose_at_most_half_a_second(tmp_path):
    rng = np.random.default_rng(3)
    parent = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(KILLS), str(tmp_path)], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    for number in range(KILLS):
        pid, at = int(parent.stdout.readline()), int(rng.integers(210, 2000))
        deadline = time.monotonic() + 60
        while reached(tmp_path / f"{number}.tick") < at:
            time.sleep(0.001)
            assert time.monotonic() < deadline, "the run does not go on"
        os.kill(pid, signal.SIGKILL)
    assert parent.wait(30) == 0
    for number in range(KILLS):
        path, saved = tmp_path / f"{number}.mcap", tmp_path / f"{number}-saved.mcap"
        ran = reached(tmp_path / f"{number}.tick")
        assert not read_log(path).complete
        result = recover(path, saved)
        ticks = read_log(saved).channel("/control")["_tick"]
        assert ticks.tolist() == list(range(len(ticks)))
        assert len(ticks) >= ran - 500, f"{ran - len(ticks)} ms of run {number} are lost"
        assert result.lost
        _, problems = check(saved)
        assert problems == ['metadata "result" is missing: the run did not come to its end']


def reached(path):
    """Ticks a run has done so far."""
    data = path.read_bytes() if path.exists() else b""
    return struct.unpack("<q", data)[0] if len(data) == 8 else -1
