"""A tuple handed over once is the same tuple to compiled code and to Python, for as long as somebody holds it."""

import gc
import weakref
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from controller.held import Held, held


class Inner(NamedTuple):
    x: Any
    factor: float
    flag: bool


class Outer(NamedTuple):
    inner: Inner
    flags: Any
    codes: Any


def outer(x):
    return Outer(Inner(x, 2.0, True), np.zeros((2, 2), dtype=np.bool_), np.zeros(3, dtype=np.int8))


@njit
def mark(those):
    t = held(those)
    t.flags[1, 0] = True
    t.codes[2] = -5
    t.inner.x[0] += 1.0
    return t.inner.factor * t.inner.x.sum() if t.inner.flag else -1.0


def test_compiled_code_reads_and_writes_the_arrays_of_python():
    value = outer(np.arange(4.0))
    those = Held(value)
    assert mark(those) == 2.0 * 7.0
    assert value.inner.x[0] == 1.0 and value.flags[1, 0] and value.codes.tolist() == [0, 0, -5]
    value.inner.x[:] = 1.0
    assert mark(those) == 2.0 * 5.0


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
