"""What time it is, for compiled code: the clock that `time.perf_counter` reads, where the system has it.

Common ground of both worlds: it knows nothing of a walker.
"""

import time
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from controller.common.compiled import inlined

MONOTONIC = getattr(time, "CLOCK_MONOTONIC", None)  # not on Windows
_clock_gettime: Any = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.intp))


class Clock(NamedTuple):
    """Attributes: number: of the clock; moment: it writes there, (2,), s and ns; address: of that memory."""

    number: int
    moment: NDArray[np.int64]
    address: int


def new_clock() -> Clock | None:
    """A clock, None where the system has none for compiled code."""
    if MONOTONIC is None:
        return None
    moment = np.zeros(2, dtype=np.int64)
    return Clock(MONOTONIC, moment, int(moment.__array_interface__["data"][0]))


@inlined
def now(clock: Clock) -> float:
    """Seconds since some moment of the past."""
    _clock_gettime(clock.number, clock.address)
    return clock.moment[0] + 1e-9 * clock.moment[1]
