"""What a process of this program costs: the way to its first tick, and memory over a long run."""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from sim.bench.figure import Figure

_FIRST_TICK = """
from sim.bridge.run import prepare, run_scenario
from sim.scenario import load
undisturbed = load("undisturbed")
prepare(undisturbed)
run_scenario(undisturbed, stop=lambda: "first tick", prepared=True)
"""


def start_up(steps: int) -> list[Figure]:
    """Process start to first tick, kernels on disk and not."""

    def seconds(**environment: str) -> float:
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", _FIRST_TICK], check=True, env={**os.environ, **environment})
        return time.perf_counter() - began

    with tempfile.TemporaryDirectory() as cache:
        first = seconds(NUMBA_CACHE_DIR=cache)
        warm = min(seconds(NUMBA_CACHE_DIR=cache) for _ in range(3))
    return [
        Figure(name="start to first tick, kernels on disk", value=warm, unit="s", target="<= 1"),
        Figure(name="start to first tick, first ever", value=first, unit="s", target="<= 12"),
    ]


_LONG_RUN = """
import sys, json
from pathlib import Path
from sim.bridge.run import run_scenario
from sim.scenario import load, with_values
kind, seconds, folder = sys.argv[1], float(sys.argv[2]), sys.argv[3]
scenario = with_values(load("undisturbed"), {"steps": 10**6, "time_limit": seconds, "controller.kind": kind})
resident = []
def look(steps, t):
    if t >= len(resident) * seconds / 50:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        resident.append((t, pages))
run_scenario(scenario, log=Path(folder) / "long.mcap", progress=look)
print(json.dumps(resident))
"""


def memory(steps: int) -> list[Figure]:
    """Resident memory over a long run with its log."""
    if not Path("/proc/self/statm").exists():
        return []
    duration = 600.0 if steps > 3 else 60.0  # [s] simulated
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", _LONG_RUN, "zd-pd", str(duration), folder]
        out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    t, pages = np.array(json.loads(out)).T
    settled = pages[t >= min(60.0, duration / 2)]
    growth = float(settled.max() - settled[0]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    return [Figure(name=f"memory growth over {duration:.0f} s simulated, after the first minute", value=growth,
                   unit="MB", target="<= 5")]  # fmt: skip
