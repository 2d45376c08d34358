"""Ticks in which nothing happens, one after the other in compiled code: look, judge, decide, push, hold.

The kernels are those that the loop calls one by one, of any plant and any law that hand them over. Where there is
something to tell, the loop goes on from within that very tick.
"""

from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from controller.common.clock import new_clock, now
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
"""How a ride ended: a tick waits for its decision, there is something to tell of it or the law's kernel came to none;
or as the last hold did."""

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
        """Kernel called as `decide(seen, step, i)`; false where that is left to `RowController.decide`."""


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
    clock: Any


@generic
def ride(parts: Any, i: int, end: int) -> tuple[int, int, int]:
    """Ticks from row `i` to before row `end`: the row it came to, how it ended there, what the judge has found.

    Of a tick that waits for its decision `tick_s` has what it has taken.
    """
    p = held(parts)
    began = 0.0
    while i < end:
        call(p.look.entry, p.look.arguments, (p.state, p.seen, i))
        found = judging.look(p.judge, p.state, p.judged, i)
        if found != 0:
            p.tick_s[i] = 0.0
            return i, LOOKED, found
        started = now(p.clock)
        decided = call(p.decide.entry, p.decide.arguments, (p.seen, p.step, i))
        moment = now(p.clock)
        p.tick_s[i] = moment - started
        if not decided:
            return i, LOOKED, 0
        if p.windows.shape[0] > 0:
            judge = p.judge[0]
            p.judged[i].pushed = act(p.windows, p.state[i].t, judge.steps + 1, judge.last_impact, p.acting)
        ended = call(p.move.entry, p.move.arguments, (p.step, i, p.forces, p.acting))
        if ended != FINE:
            return i, ended, 0
        i += 1
        if began == 0.0:
            began = started
        elif moment - began > LONGEST:
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
    clock = new_clock()
    if clock is None or not isinstance(plant, RidingPlant) or not isinstance(controller, RidingLaw):
        return None
    ways = plant.bound(block.state, block.seen, block.step, pushes.acting)
    decide = controller.bound(block.seen, block.step)
    if ways is None or decide is None:
        return None
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
            clock=clock,
        )
    )
