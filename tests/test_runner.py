"""The runner: what one job does to its process is no matter of the others, and none is left when nobody asks."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sim.errors import UserError
from sim.runner import Ended, Pool

ROOT = Path(__file__).parent.parent
HERE = Path(__file__).stem


def job(factor: int, what):
    """A number is multiplied; a word is a misdeed."""
    if what == "abort":
        os.abort()
    if what == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "leave":
        os._exit(3)
    if what == "hang":
        signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
        time.sleep(600)
    if what == "raise":
        raise ArithmeticError("no such number")
    if what == "refuse":
        raise UserError("not legal")
    if what == "unpicklable":
        return lambda: None
    if isinstance(what, Path):
        first = not what.exists()
        what.touch()
        if first:
            os.abort()
        return "second time"
    return what * factor


@pytest.mark.parametrize("workers", [1, 2])
def test_misdeeds_are_those_of_their_job_alone(workers: int, tmp_path: Path) -> None:
    misdeeds = ["abort", "kill", "leave", "hang", "raise", "unpicklable", tmp_path / "once"]
    arguments = [one for pair in zip(range(7), misdeeds, strict=True) for one in pair] + list(range(7, 40))
    with Pool(job, 10, workers=workers, deadline=1.0, retries=1) as pool:
        ends = {end.argument: end for end in pool.run(arguments)}
        pids = [worker.pid for worker in pool._workers]
    assert len(ends) == len(arguments)
    assert all(ends[n].how is Ended.DONE and ends[n].value == 10 * n for n in range(40))
    assert {ends[word].how for word in ("abort", "kill", "leave")} == {Ended.CRASHED}
    assert "2 times" in ends["abort"].message and "SIGABRT" in ends["abort"].message
    assert "SIGKILL" in ends["kill"].message and "exit code 3" in ends["leave"].message
    assert ends["hang"].how is Ended.HUNG and "after 1 s" in ends["hang"].message
    assert ends["raise"].how is Ended.RAISED and ends["raise"].message == "ArithmeticError: no such number"
    assert ends["unpicklable"].how is Ended.RAISED
    assert ends[tmp_path / "once"].value == "second time"
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)


def test_long_results_and_long_arguments_do_not_wait_for_each_other() -> None:
    arguments = [bytes([i]) * 2_000_000 for i in range(4)]
    with Pool(job, 2, workers=1, deadline=60.0) as pool:
        assert [end.value for end in pool.run(arguments)] == [2 * argument for argument in arguments]


def folder_of_work(_: object, __: object) -> str:
    return os.getcwd()


def test_workers_are_where_their_pool_is_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        with Pool(folder_of_work, workers=1, log="printed") as pool:
            found += [Path(end.value).name for end in pool.run([0])]
        assert (tmp_path / name / "printed").exists()
    assert found == ["one", "two"]


def test_a_user_s_error_is_the_caller_s() -> None:
    with Pool(job, 1, workers=1) as pool, pytest.raises(UserError, match="not legal"):
        list(pool.run([1, "refuse"]))


def test_a_request_to_stop_ends_what_is_running() -> None:
    with Pool(job, 1, workers=2) as pool:
        began = time.monotonic()
        assert [end.value for end in pool.run([1, "hang", "hang"], lambda: time.monotonic() - began > 2.0)] == [1]
        assert time.monotonic() - began < 60.0 and pool._workers == []


def test_workers_that_are_killed_or_lose_their_template_are_replaced() -> None:
    from sim.runner.nursery import nursery

    with Pool(job, 2, workers=2) as pool:
        seen = []
        for end in pool.run(range(200)):
            seen.append(end.value)
            if len(seen) in (20, 60):
                os.kill(pool._workers[0].pid, signal.SIGKILL)
            if len(seen) == 100:
                os.kill(nursery()._template.pid, signal.SIGKILL)
    assert sorted(seen) == [2 * n for n in range(200)]


def test_no_process_is_left_when_the_caller_is_killed(tmp_path: Path) -> None:
    code = (
        f"import sys; sys.path.insert(0, {str(ROOT / 'tests')!r})\n"
        f"import {HERE}, pathlib; from sim.runner import Pool; from sim.runner.nursery import nursery\n"
        f"pool = Pool({HERE}.job, 1, workers=2)\n"
        "for end in pool.run([1, 1, 'hang', 'hang']):\n"
        f"    pathlib.Path({str(tmp_path / 'pids')!r}).write_text(\n"
        "        ' '.join(str(w.pid) for w in pool._workers) + f' {nursery()._template.pid}')\n"
    )
    caller = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT)
    pids = tmp_path / "pids"
    while not pids.exists() and caller.poll() is None:
        time.sleep(0.05)
    time.sleep(0.5)
    caller.kill()
    caller.wait()
    left = [Path(f"/proc/{pid}") for pid in pids.read_text().split()]
    until = time.monotonic() + 60.0
    while any(map(_alive, left)) and time.monotonic() < until:
        time.sleep(0.05)
    assert len(left) == 3 and not any(map(_alive, left))


def _alive(process: Path) -> bool:
    try:
        return (process / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
