"""Compiled arithmetic of sensors and motors that err: row by row, around the kernels of any plant.

What is random is drawn beforehand, a number for each row of a block.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.common.compiled import Array, compiled, generic
from controller.common.entry import Bound, call
from controller.common.held import Held, held
from sim.interface import Rows

N, JOINTS = 5, 4
TORSO = 4

SENSING = np.dtype(
    [
        ("angle_bias", float, N),  # [rad]
        ("rate_bias", float, N),  # [rad/s]
        ("drift", float),  # [rad/s] of the torso's angle
        ("resolution", float),  # [rad] of the joints' angles; 0 for none
        ("differentiated", np.int64),  # whether rates are filtered differences of angles
        ("blend", float),  # share of the latest difference in them
        ("period", float),  # [s]
        ("dropout", float),  # probability that a raised contact flag is lost
        ("reads", np.int64),  # rows read
        ("past_q", float, N),
        ("past_dq", float, N),
    ],
    align=True,
)
"""How sensors err, and what they remember; SI units."""

DRIVING = np.dtype(
    [
        ("factor", float, JOINTS),  # of the motor constants
        ("resolution", float),  # [N.m]; 0 for none
        ("blend", float),  # share of the command in the torque at the end of a tick
        ("commands", np.int64),  # rows commanded
        ("torque", float, JOINTS),  # [N.m]
    ],
    align=True,
)
"""How motors err, and what they remember; SI units."""


class Sensing(NamedTuple):
    """What `sense` works on.

    Attributes:
        work: One row of `SENSING`.
        noise: Errors of a block's angles in [rad] and rates in [rad/s], (rows, 10).
        noisy: Which of them are there, (10,).
        chances: Numbers in [0, 1) that a dropout of a block's flags depends on, (rows, 2).
        flags: Contact flags as sensed, of the last ticks that matter, (delay + 1, 2).
        readings: Rows of `OBSERVATION`, likewise, (latency + 1,).
    """

    work: Rows
    noise: Array
    noisy: NDArray[np.bool_]
    chances: Array
    flags: NDArray[np.int8]
    readings: Rows


class Driving(NamedTuple):
    """What `drive` works on.

    Attributes:
        work: One row of `DRIVING`.
        noise: Errors of a block's torques in [N.m], (rows, 4); (0, 4) for none.
        waiting: The last commands that matter in [N.m], (latency + 1, 4).
        torque: One row of `STEP`: what the plant is to hold.
    """

    work: Rows
    noise: Array
    waiting: Array
    torque: Rows


class Around(NamedTuple):
    """What `look` and `move` work on: a kernel of the plant inside, and a `Sensing` or a `Driving` before it."""

    plant: Bound
    instrument: Held


@compiled
def sense(sensing: Any, seen: Any, i: int) -> None:
    """Make of what ideal sensors read in row `i` what these tell; its time stamp stays, whatever the latency."""
    p = held(sensing)
    w, o = p.work[0], seen[i]
    k = w.reads
    w.reads += 1
    reading = p.readings[k % p.readings.shape[0]]
    for j in range(N):
        q = o.q[j] + w.angle_bias[j]
        if j == TORSO:
            q = q + w.drift * o.t
        if p.noisy[j]:
            q = q + p.noise[i, j]
        if j != TORSO and w.resolution > 0.0:
            q = np.round(q / w.resolution) * w.resolution
        reading.q[j] = q
    for j in range(N):
        if w.differentiated == 0:
            dq = o.dq[j] + w.rate_bias[j]
            if p.noisy[N + j]:
                dq = dq + p.noise[i, N + j]
        elif k == 0:
            dq = o.dq[j]  # there is no past
        else:
            raw = (reading.q[j] - w.past_q[j]) / w.period
            dq = w.past_dq[j] + w.blend * (raw - w.past_dq[j])
        reading.dq[j] = dq
    for j in range(N):
        w.past_q[j], w.past_dq[j] = reading.q[j], reading.dq[j]
    delay = p.flags.shape[0] - 1
    for foot in range(2):
        p.flags[k % (delay + 1), foot] = o.contact[foot]
    for foot in range(2):
        kept = p.chances.shape[0] == 0 or p.chances[i, foot] >= w.dropout
        reading.contact[foot] = kept and p.flags[max(0, k - delay) % (delay + 1), foot] != 0
    latency = p.readings.shape[0] - 1
    late = p.readings[max(0, k - latency) % (latency + 1)]
    for j in range(N):
        o.q[j], o.dq[j] = late.q[j], late.dq[j]
    for foot in range(2):
        o.contact[foot] = late.contact[foot]


@compiled
def drive(driving: Any, step: Any, i: int) -> None:
    """What motors make of the torque commanded in row `i`: for the plant to saturate and hold."""
    p = held(driving)
    w, u = p.work[0], p.torque[0].u_total
    k = w.commands
    w.commands += 1
    latency = p.waiting.shape[0] - 1
    for j in range(JOINTS):
        p.waiting[k % (latency + 1), j] = step[i].u_total[j]
    for j in range(JOINTS):
        asked = p.waiting[max(0, k - latency) % (latency + 1), j]
        if w.resolution > 0.0:
            asked = np.round(asked / w.resolution) * w.resolution
        asked = asked * w.factor[j]
        w.torque[j] = asked if k == 0 else w.torque[j] + w.blend * (asked - w.torque[j])
        u[j] = w.torque[j] if p.noise.shape[0] == 0 else w.torque[j] + p.noise[i, j]


@generic
def look(around: Any, state: Any, seen: Any, i: int) -> None:
    """The truth in row `i`, and what these sensors tell of it."""
    p = held(around)
    call(p.plant.entry, p.plant.arguments, (state, seen, i))
    sense(p.instrument, seen, i)


@generic
def move(around: Any, step: Any, i: int, forces: Any, acting: Any) -> int:
    """Hold what these motors make of row `i`; how it ended."""
    p = held(around)
    drive(p.instrument, step, i)
    torque = held(p.instrument).torque
    ended: int = call(p.plant.entry, p.plant.arguments, (torque, 0, forces, acting))
    return ended
