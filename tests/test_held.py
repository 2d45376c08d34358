"""A tuple handed over once is the same tuple to compiled code and to Python, for as long as somebody holds it."""

import gc
import os
import subprocess
import sys
import weakref

import numpy as np
import pytest
from conftest import ROOT
from numba import njit
from numba.core.errors import NumbaError

from controller.common.held import Held, held


def outer(x):
    """Plain tuples: what is compiled is kept on disk, where a class of a test could not be found again."""
    return (x, 2.0, True), np.zeros((2, 2), dtype=np.bool_), np.zeros(3, dtype=np.int8)


@njit
def mark(those):
    (x, factor, flag), flags, codes = held(those)
    flags[1, 0] = True
    codes[2] = -5
    x[0] += 1.0
    return factor * x.sum() if flag else -1.0


def test_compiled_code_reads_and_writes_the_arrays_of_python():
    value = outer(np.arange(4.0))
    those = Held(value)
    assert mark(those) == 2.0 * 7.0
    (x, _, _), flags, codes = value
    assert x[0] == 1.0 and flags[1, 0] and codes.tolist() == [0, 0, -5]
    x[:] = 1.0
    assert mark(those) == 2.0 * 5.0


@njit
def held_first(those):
    return held(those)[0]


@njit
def listed(those):
    narrow, flag, (x, pair), one, code, y = held(those)
    return (narrow, flag, pair[0], pair[1], one, code, x[1, 2], y[3], x.strides[1], y.strides[0], x.size)


def test_numbers_of_every_kind_lie_where_compiled_code_looks():
    """Between narrow ones and flags are gaps, and nested tuples of one type are arrays to it; strides as they are."""
    x, y = np.arange(12.0).reshape(3, 4)[:, ::-1], np.arange(8)[::2]
    value = np.int8(-3), True, (x, (7, 8)), np.float32(0.5), np.int32(1 << 20), y
    assert listed(Held(value)) == (-3, True, 7, 8, 0.5, 1 << 20, 5.0, 6, -8, 16, 12)


def test_what_compiled_code_would_read_otherwise_is_refused():
    """Nor is one class of arrays taken for another, whatever came first."""
    with pytest.raises(TypeError, match=r"complex128 cannot be handed over"):
        Held((1.0, 1j))
    assert mark(Held(outer(np.arange(4.0)))) == 14.0
    with pytest.raises(NumbaError, match="MaskedArray"):
        Held(outer(np.ma.array(np.arange(4.0), mask=[0, 1, 0, 0])))
    assert held_first(Held((np.uint8(200), 0.5))) == 200


def test_arrays_live_as_long_as_the_handle_and_no_longer():
    x = np.zeros(1000)
    watched = weakref.ref(x)
    those = Held(outer(x))
    del x
    gc.collect()
    assert watched() is not None and mark(those) == 2.0
    del those
    gc.collect()
    assert watched() is None


FIRST = """
from controller.common.compiled import generic
from controller.common.held import held

@generic
def first(those):
    return held(those)[0]
"""
RECORD = """
from typing import Any, NamedTuple

class Record(NamedTuple):
    x: Any
"""
THEIRS = "import strangers; from kernel import first; from controller.common.held import Held"
OURS = "from kernel import first; from controller.common.held import Held"


def test_what_a_stranger_kept_on_disk_is_no_obstacle(tmp_path):
    """A kernel that takes records of any class, compiled for one that another process has not got."""
    for name, text in (("both/kernel.py", FIRST), ("theirs/strangers.py", RECORD)):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(text)

    def run(code, *folders):
        path = os.pathsep.join(map(str, (ROOT, *(tmp_path / folder for folder in folders))))
        kept = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept"), "PYTHONPATH": path}
        done = subprocess.run([sys.executable, "-c", code], check=True, env=kept, capture_output=True, text=True)
        assert done.stderr == ""

    theirs = f"{THEIRS}; assert first(Held(strangers.Record(2.5))) == 2.5"
    run(theirs, "both", "theirs")
    assert list((tmp_path / "kept").rglob("*.nbc"))
    run(f"{OURS}; assert first(Held((1.0, True))) == 1.0", "both")
    run(theirs, "both", "theirs")
