"""Ticks in which nothing happens, one after the other in compiled code: look, judge, decide, push, hold.

The kernels are those that the loop calls one by one, of any plant and any law that hand them over. Where there is
something to tell, the loop goes on from within that very tick.
"""

import time
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numba import types
from numpy.typing import NDArray

from controller.common.compiled import generic
from controller.common.entry import Bound, call
from controller.common.held import Held, held
from sim.interface import Controller, Plant, Rows
from sim.loop import judge as judging
from sim.loop.judge import Judge
from sim.loop.pushes import Pushes, act
from sim.loop.ticks import Ticks

LONGEST = 0.02  # [s] of wall time from one look of Python's at the run to the next
LOOKED, FINE = -1, 0
"""How a ride ended: there is something to tell of a tick that waits for its decision; or as the last hold did."""

Flags = NDArray[np.bool_]


@runtime_checkable
class RidingPlant(Protocol):
    """A plant of which all that a tick needs is compiled."""

    def bound(self, state: Rows, seen: Rows, step: Rows, acting: Flags) -> tuple[Bound, Bound] | None:
        """Kernels called as `look(state, seen, i)` and as `move(step, i, forces, acting)`, of the forces loaded."""

    def heed(self, end: int, step: Rows, i: int) -> None:
        """Take note of a hold that did not end with `FINE`; raises as `Plant.move` does."""

    @property
    def forces(self) -> Rows:
        """The forces loaded, as its kernels take them."""


@runtime_checkable
class RidingLaw(Protocol):
    """A law of which all that a tick needs is compiled."""

    def bound(self, seen: Rows, step: Rows) -> Bound | None:
        """Kernel called as `decide(seen, step, i)`."""


class Parts(NamedTuple):
    """All that a ride works on."""

    look: Bound
    move: Bound
    decide: Bound
    judge: Any
    windows: Any
    forces: Any
    acting: Any
    state: Any
    seen: Any
    step: Any
    judged: Any
    tick_s: Any
    time: Any
    time_at: int


CLOCK = getattr(time, "CLOCK_MONOTONIC", None)  # not on Windows, where the loop does all
_clock_gettime: Any = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.intp))


@generic
def ride(parts: Any, clock: int, i: int, end: int) -> tuple[int, int, int]:
    """Ticks from row `i` to before row `end`: the row it came to, how it ended there, what the judge has found."""
    p = held(parts)
    began = 0.0
    while i < end:
        call(p.look.entry, p.look.arguments, (p.state, p.seen, i))
        found = judging.look(p.judge, p.state, p.judged, i)
        if found != 0:
            return i, LOOKED, found
        _clock_gettime(clock, p.time_at)
        started = p.time[0] + 1e-9 * p.time[1]
        call(p.decide.entry, p.decide.arguments, (p.seen, p.step, i))
        _clock_gettime(clock, p.time_at)
        now = p.time[0] + 1e-9 * p.time[1]
        p.tick_s[i] = now - started
        if p.windows.shape[0] > 0:
            judge = p.judge[0]
            p.judged[i].pushed = act(p.windows, p.state[i].t, judge.steps + 1, judge.last_impact, p.acting)
        ended = call(p.move.entry, p.move.arguments, (p.step, i, p.forces, p.acting))
        if ended != FINE:
            return i, ended, 0
        i += 1
        if began == 0.0:
            began = started
        elif now - began > LONGEST:
            break
    return i, FINE, 0


def ride_of(plant: Plant, controller: Controller, block: Ticks, pushes: Pushes, judge: Judge) -> Held | None:
    """What `ride` works on; None where the loop has to go from tick to tick.

    Args:
        plant: At the start of the run, its forces loaded.
        controller: The law.
        block: Rows that are filled.
        pushes: That act.
        judge: Of the run.
    """
    if CLOCK is None or not isinstance(plant, RidingPlant) or not isinstance(controller, RidingLaw):
        return None
    ways = plant.bound(block.state, block.seen, block.step, pushes.acting)
    decide = controller.bound(block.seen, block.step)
    if ways is None or decide is None:
        return None
    moment = np.zeros(2, dtype=np.int64)
    return Held(
        Parts(
            look=ways[0],
            move=ways[1],
            decide=decide,
            judge=judge.work,
            windows=pushes.windows,
            forces=plant.forces,
            acting=pushes.acting,
            state=block.state,
            seen=block.seen,
            step=block.step,
            judged=block.judged,
            tick_s=block.tick_s,
            time=moment,
            time_at=int(moment.__array_interface__["data"][0]),
        )
    )
