"""Kernels are compiled in processes beside the one that asks, which stays free to be interrupted."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import ExtensionFileLoader
from types import FrameType
from typing import NamedTuple

import pytest
from conftest import ROOT
from llvmlite.binding.executionengine import ExecutionEngine
from numba import njit
from numba.core import serialize
from numba.core.dispatcher import _DispatcherBase
from qpsolvers.solvers import clarabel_

from sim.bridge import kernels
from sim.terminal import interrupt


@pytest.mark.parametrize(("signum", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_run_that_compiles_and_its_helpers(signum, code, tmp_path):
    kept = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    command = [sys.executable, "-m", "sim", "run", "undisturbed", "--log", str(tmp_path / "a.mcap")]
    run = subprocess.Popen(command, cwd=ROOT, env=kept, stderr=subprocess.PIPE, text=True)
    assert any(line.strip() == kernels.ONCE for line in iter(run.stderr.readline, ""))  # after signs of life
    while len(helpers := children(run.pid)) < 2:
        assert run.poll() is None
    run.send_signal(signum)
    _, err = run.communicate(timeout=60)
    assert run.returncode == code
    said = err.splitlines()[-1]
    assert said == f"cmpc: interrupted by {signum.name} while kernels were compiled, before the run began"
    assert not any(os.path.exists(f"/proc/{pid}") for pid in helpers)
    assert not (tmp_path / "a.mcap").exists()


def children(pid):
    try:
        with open(f"/proc/{pid}/task/{pid}/children") as file:
            return file.read().split()
    except FileNotFoundError:
        pytest.skip("no list of child processes here")


def test_what_is_compiled_is_told_by_name_and_a_wish_to_stop_is_heeded(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    told = []
    kernels.prepare("zd-pd", "mujoco", stop=lambda: len(told) >= 2, show=lambda *what: told.append(what))
    assert [done for done, _, _ in told[:2]] == [1, 2]
    assert all(total >= done and "." in name for done, total, name in told)
    assert any(tmp_path.iterdir())


def test_every_law_and_plant_has_kernels_that_show_whether_it_is_ready():
    from controller.common.settings import BUILT_IN

    assert set(BUILT_IN) | {"mujoco", "rigid"} == set(kernels.TOPS)
    assert set(kernels.KERNELS) == set(BUILT_IN)
    assert kernels.law_of("./mine.py:make") == "zd-pd"
    for places in kernels.TOPS.values():
        assert all(callable(kernels.named(place)) for place in places)


@pytest.mark.parametrize("name", interrupt.DEAF)
def test_ctrl_c_that_meets_a_deaf_call_is_heard_after_it(name):
    owner, _, method = name.rpartition(".")
    known = {
        "ExecutionEngine": (ExecutionEngine,),
        "ExtensionFileLoader": (ExtensionFileLoader,),
        "_DispatcherBase": (_DispatcherBase,),
        "": (clarabel_, serialize),
    }
    assert any(hasattr(place, method) for place in known[owner])
    dropped = []

    def deaf() -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            dropped.append("as ctypes would")

    deaf.__code__ = deaf.__code__.replace(co_qualname=name)
    with ctrl_c_of_a_command(), interrupt.hearing_ctrl_c(), pytest.raises(KeyboardInterrupt):
        deaf()
        time.sleep(30.0)
    assert not dropped


def test_ctrl_c_while_compiled_code_makes_a_record_is_heard_after_it():
    class Pair(NamedTuple):
        left: float
        right: float

    swapped = njit(lambda pair: (pair.left, Pair(pair.right, pair.left)))
    pair = Pair(1.0, 2.0)
    assert swapped(pair) == (1.0, (2.0, 1.0))
    made = []

    def ctrl_c_in(frame: FrameType, event: str, argument: object) -> None:
        if frame.f_globals.get("__name__") == "namedtuple_Pair":
            made.append(sys.setprofile(None))
            signal.raise_signal(signal.SIGINT)

    with ctrl_c_of_a_command(), interrupt.hearing_ctrl_c(), pytest.raises(KeyboardInterrupt):
        sys.setprofile(ctrl_c_in)
        swapped(pair)
        time.sleep(30.0)
    assert made


@contextmanager
def ctrl_c_of_a_command() -> Iterator[None]:
    """Python's own handler, though workers of pytest-xdist ignore Ctrl-C; it must be the one at the end, too."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
