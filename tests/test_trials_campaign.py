"""Long proofs about campaigns, minutes each: kills, a cluster, ten thousand trials, full disks, runs from ids.

Left out unless asked for: `make trials-proof`.
"""

import contextlib
import os
import random
import resource
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import misdeeds
import pytest
from spoken import spoken

from sim.bridge.run import run_scenario
from sim.trials.run import TrialResult
from sim.trials.run.folder import FILE
from sim.trials.run.recall import stored_scenario
from sim.trials.run.result import result_without_times
from sim.trials.run.store import Store

pytestmark = pytest.mark.campaign

ROOT = Path(__file__).parent.parent
CLI = [sys.executable, "-m", "sim", "trials"]

PLAN = """
seed = 5
controllers = [{controllers}]
[scenario]
steps = {steps}
[[montecarlo]]
trials = {trials}
[[montecarlo.axes]]
paths = ["plant.mass_factor.torso"]
distribution = "log-normal"
centre = 1
spread = 0.5
[[montecarlo.axes]]
paths = ["{path}"]
distribution = "uniform"
low = {low}
high = {high}
"""
NOISE = {"path": "sensors.angle_noise", "low": 0, "high": 0.01}
ROUGH = {"path": "plant.ground.rough.height", "low": 0, "high": 0.02}


def write(folder: Path, **values: object) -> Path:
    path = folder / "plan.toml"
    path.write_text(PLAN.format(**values))
    return path


def start(plan: Path, out: Path, *options: str, **how: object) -> subprocess.Popen:
    command = [*CLI, str(plan), "--out", str(out), "--quiet", *options]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **how)


def finish(process: subprocess.Popen, code: int = 0) -> str:
    _, err = process.communicate(timeout=3600)
    assert process.returncode == code, err
    return err


def results(out: Path) -> list[TrialResult]:
    with Store(out / FILE) as store:
        return [result_without_times(row) for row in store.results()]


def count(out: Path) -> int:
    with (
        contextlib.suppress(sqlite3.Error),
        contextlib.closing(sqlite3.connect(f"file:{out / FILE}?mode=ro", uri=True)) as db,
    ):
        return int(db.execute("SELECT count(*) FROM trials").fetchone()[0])
    return 0


def test_twenty_kills_lose_and_double_nothing(tmp_path: Path) -> None:
    """Kill -9 of the parent twenty times, some while it starts, others a random number of results later."""
    plan = write(tmp_path, controllers='"zd-pd"', steps=1, trials=500, **NOISE)
    finish(start(plan, tmp_path / "undisturbed"))
    expected, out, moment = results(tmp_path / "undisturbed"), tmp_path / "killed", random.Random(1)
    for kill in range(20):
        before = count(out)
        process = start(plan, out)
        if kill % 4 == 0:
            time.sleep(moment.uniform(0.2, 3.0))
        else:
            wanted = before + moment.randint(1, 24)
            while count(out) < wanted and process.poll() is None:
                time.sleep(0.01)
        assert process.poll() is None, "it ended before it was killed"
        process.kill()
        process.communicate()
        assert count(out) >= before
    assert 0 < count(out) < 500
    finish(start(plan, out))
    found = results(out)
    assert [row.trial for row in found] == list(range(500)) and found == expected
    assert 100 < sum(row.survived for row in found) < 500


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_a_cluster_on_loopback_finds_the_same_though_a_worker_is_killed(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    plan = write(tmp_path, controllers='"zd-pd", "c-mpc"', steps=2, trials=60, **ROUGH)
    finish(start(plan, tmp_path / "local", "--workers", "2"))
    with Cluster(tmp_path) as cluster:
        process = start(plan, tmp_path / "cluster", "--cluster", cluster.address)
        while count(tmp_path / "cluster") < 20 and process.poll() is None:
            time.sleep(0.05)
        assert process.poll() is None
        _kill_group(cluster.workers[0])
        finish(process)
    assert results(tmp_path / "cluster") == results(tmp_path / "local")


class Cluster:
    """A Dask scheduler and two workers on this machine, as processes of their own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.address = folder, f"tcp://127.0.0.1:{free_port()}"
        self.workers: list[subprocess.Popen] = []

    def __enter__(self) -> "Cluster":
        self.begin()
        return self

    def begin(self) -> None:
        """Start what is not there."""
        port = self.address.rpartition(":")[2]
        self.scheduler = self._run("scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")
        self.workers = [self.worker(), self.worker()]
        _wait_for_workers(self.address, 2)

    def worker(self) -> subprocess.Popen:
        return self._run("worker", self.address, "--nthreads", "1", "--nworkers", "1", "--no-dashboard")

    def _run(self, kind: str, *options: str) -> subprocess.Popen:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *options]
        where = {"cwd": self.folder, "env": {**os.environ, "PYTHONPATH": str(ROOT)}}
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        return subprocess.Popen(command, start_new_session=True, **where, **silent)

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            _kill_group(process)
            process.wait()

    def __exit__(self, *_: object) -> None:
        self.end()


def processes() -> dict[int, tuple[int, str]]:
    """Every process of this machine that runs: its parent and its command line."""
    found = {}
    for folder in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            state, parent = (folder / "stat").read_text().rpartition(")")[2].split()[:2]
            if state != "Z":
                found[int(folder.name)] = int(parent), (folder / "cmdline").read_text().replace("\0", " ")
    return found


def descendants(pid: int) -> list[int]:
    """Processes that a process started, and those that they started."""
    every, found = processes(), [pid]
    for one in found:
        found += [child for child, (parent, _) in every.items() if parent == one]
    return found[1:]


def nothing_is_left(pids: list[int]) -> bool:
    """Whether processes end within a minute, those on a busy machine too."""
    until = time.monotonic() + 60.0
    while (left := set(pids) & processes().keys()) and time.monotonic() < until:
        time.sleep(0.1)
    return not left


@pytest.mark.parametrize("where", ["1 worker", "2 workers", "a cluster"])
def test_of_two_hundred_trials_twenty_five_misbehave_and_no_other_is_touched(where: str, tmp_path: Path) -> None:
    """10 abort, 5 hang in C and hold the interpreter, 5 raise, 5 return NaN: 175 are those of a clean campaign."""
    (tmp_path / "clean.toml").write_text(misdeeds.plan(200, False, 60.0))
    (tmp_path / "odd.toml").write_text(misdeeds.plan(200, True, 15.0))
    with contextlib.ExitStack() as stack:
        options = ["--workers", where[0]]
        if where == "a cluster":
            pytest.importorskip("distributed")
            options = ["--cluster", stack.enter_context(Cluster(tmp_path)).address]
        took, seen = {}, set()
        for name in ("clean", "odd"):
            began = time.perf_counter()
            process = start(tmp_path / f"{name}.toml", tmp_path / name, *options)
            while process.poll() is None:
                seen |= set(descendants(process.pid))
                time.sleep(0.5)
            finish(process)
            took[name] = time.perf_counter() - began
        assert nothing_is_left(sorted(seen))
    hung = 5 * 16.0 / (1 if where[0] == "1" else 2)
    print(f"{where}: clean {took['clean']:.1f} s, with misdeeds {took['odd']:.1f} s, of which {hung:.0f} s of hanging")
    misdeeds.check(results(tmp_path / "odd"), results(tmp_path / "clean"))


def test_a_hundred_kills_of_campaign_worker_and_scheduler_change_no_row(tmp_path: Path) -> None:
    """70 here, of the campaign, its template or a worker; 30 of campaign, worker and scheduler of a cluster."""
    plan = write(tmp_path, controllers='"zd-pd"', steps=1, trials=1200, **NOISE)
    finish(start(plan, tmp_path / "undisturbed"))
    expected, moment = results(tmp_path / "undisturbed"), random.Random(2)
    out, kills = tmp_path / "killed", dict.fromkeys(("campaign", "process of it"), 0)
    process = start(plan, out)
    while sum(kills.values()) < 70:
        time.sleep(moment.uniform(0.1, 3.0))
        target = moment.choice(sorted(kills))
        victims = [process.pid] if target == "campaign" else descendants(process.pid)
        if process.poll() is None and victims:
            with contextlib.suppress(ProcessLookupError):
                os.kill(moment.choice(victims), signal.SIGKILL)
                kills[target] += 1
        if target == "campaign" or process.poll() is not None:
            process.communicate()
            if count(out) == len(expected):  # all is done before the kills are
                out = out.with_name(f"{out.name}-again")
            process = start(plan, out)
    finish(process)
    assert results(out) == expected
    print(f"here: {kills}")
    pytest.importorskip("distributed")
    out, kills = tmp_path / "on-cluster", dict.fromkeys(("campaign", "scheduler", "worker"), 0)
    with Cluster(tmp_path) as cluster:
        process = start(plan, out, "--cluster", cluster.address)
        while sum(kills.values()) < 30:
            time.sleep(moment.uniform(1.0, 6.0))
            target = moment.choice(sorted(kills))
            kills[target] += 1
            if target == "worker":
                victim = moment.randrange(2)
                _kill_group(cluster.workers[victim])
                cluster.workers[victim] = cluster.worker()
            elif target == "scheduler":
                _kill_group(cluster.scheduler)
                _, err = process.communicate(timeout=300)
                assert process.returncode in (0, 2) and len(spoken(err)) == (process.returncode == 2), err
                cluster.end()
                cluster.begin()
            else:
                process.kill()
                process.communicate()
            if process.poll() is not None:
                if count(out) == len(expected):
                    out = out.with_name(f"{out.name}-again")
                process = start(plan, out, "--cluster", cluster.address)
        finish(process)
    assert results(out) == expected
    print(f"on a cluster: {kills}")


def _kill_group(process: subprocess.Popen) -> None:
    """A Dask worker and the nanny that would start another."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _wait_for_workers(address: str, number: int) -> None:
    from distributed import Client

    with Client(address, timeout=60) as client:
        client.wait_for_workers(number, timeout=120)


def test_ten_thousand_trials_leave_memory_flat_and_a_small_file(tmp_path: Path) -> None:
    """Walkers that start tilted beyond the fall angle: a trial is its plant and its result, and little else.

    The page at the end reads all results at once, and may take as much again as they do.
    """
    plan = write(tmp_path, controllers='"zd-pd"', steps=1, trials=10_000, path="start.torso_offset", low=1.25, high=1.5)
    process, out, resident = start(plan, tmp_path / "out"), tmp_path / "out", []
    while process.poll() is None:
        with contextlib.suppress(OSError, IndexError):
            pages = int(Path(f"/proc/{process.pid}/statm").read_text().split()[1])
            resident.append((count(out), pages * resource.getpagesize() / 1e6))
        time.sleep(1.0)
    finish(process)
    assert len(results(out)) == 10_000
    early = [mb for done, mb in resident if 1000 <= done <= 3000]
    late = [mb for done, mb in resident if 8000 <= done < 10_000]
    page = max(mb for _, mb in resident)
    print(
        f"parent: {max(early):.0f} MB early, {max(late):.0f} MB late, {page:.0f} MB with the page;"
        f" files: {sorted(os.listdir(out))}"
    )
    assert max(late) < max(early) + 10.0 and page < max(early) + 150.0
    assert sum(path.stat().st_size for path in out.glob(f"{FILE}*")) < 50e6
    assert {path.name for path in out.glob(f"{FILE}*")} == {FILE}, "the write-ahead log was not closed"


def test_fifty_random_trials_run_again_from_their_ids_bit_for_bit(tmp_path: Path) -> None:
    plan, out = write(tmp_path, controllers='"zd-pd", "c-mpc"', steps=3, trials=60, **ROUGH), tmp_path / "out"
    finish(start(plan, out))
    rows = results(out)
    chosen = random.Random(0).sample(rows, 50)
    assert {row.outcome for row in chosen} == {"completed", "fell"}
    for row in chosen:
        again = run_scenario(stored_scenario(f"{out}#{row.controller}/{row.trial}"))
        assert (again.outcome, again.ticks, again.state_digest) == (row.outcome, row.ticks, row.state_digest)


def test_a_full_disk_loses_nothing(tmp_path: Path) -> None:
    """Files may not grow beyond a limit; the campaign stops in one line and goes on when there is room."""
    plan, out = write(tmp_path, controllers='"zd-pd"', steps=1, trials=120, **NOISE), tmp_path / "out"
    limit = 150_000  # bytes

    def confine() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    # Kernels on disk are as large; they are there from the trials before or compiled without being kept.
    err = finish(start(plan, out, "--workers", "1", preexec_fn=confine), code=2)
    (line,) = spoken(err)
    assert FILE in line and "results so far are kept" in line
    kept = count(out)
    assert 0 < kept < 120
    finish(start(plan, out))
    finish(start(plan, tmp_path / "roomy"))
    assert results(out) == results(tmp_path / "roomy")
