"""A block of ticks: values staged as doubles, turned into MCAP message records all at once."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from sim.interface import ControlStep, Observation, PlantState, Vector
from sim.log.format.fields import (
    CHANNELS,
    LEG_CODES,
    LINKS,
    ChannelTable,
    Field,
    Kind,
)
from sim.log.format.layout import HEADER, layout_of
from sim.log.format.schema import descriptor

_NONE_PENETRATING = (False,) * len(LINKS)


def _from_array(field: Field) -> bool:
    return field.kind is Kind.DOUBLE and "." in field.name


_ALL = [(channel.topic, field) for channel in CHANNELS for field in channel.fields]
_ARRAYS = [(topic, field.name) for topic, field in _ALL if _from_array(field)]
_SCALARS = [(topic, field.name) for topic, field in _ALL if not _from_array(field)]
_COLUMN = {key: column for column, key in enumerate(_ARRAYS + _SCALARS)}
"""(Topic, field) -> staging column: what comes in arrays first, then the single numbers; joined apart, the
two cost half of what they cost together."""


@dataclass(frozen=True, slots=True, eq=False)
class _Slice:
    """One channel's part of a tick.

    Attributes:
        dtype: View of its message record.
        template: The record with every number zero.
        names: Field names.
        columns: Staging column of each field.
        offset: Byte offset within the tick.
    """

    dtype: np.dtype
    template: bytes
    names: tuple[str, ...]
    columns: tuple[int, ...]
    offset: int


class TickBlock:
    """Stages ticks and packs them.

    Attributes:
        count: Ticks staged.
        stride: Bytes of one tick's message records.
    """

    def __init__(self, capacity: int, channel_ids: Sequence[int]) -> None:
        """Make an empty block.

        Args:
            capacity: Ticks it can hold.
            channel_ids: MCAP channel ids, in the order of `CHANNELS`.
        """
        self.count = 0
        self._capacity = capacity
        self._values = np.empty((capacity, len(_COLUMN)))
        self._ticks = np.empty(capacity, dtype=np.int64)
        self._ids = tuple(channel_ids)
        slices: list[_Slice] = []
        self.stride = 0
        for channel, channel_id in zip(CHANNELS, channel_ids, strict=True):
            slices.append(_slice(channel, channel_id, self.stride))
            self.stride += slices[-1].dtype.itemsize
        self._slices = tuple(slices)
        template = np.frombuffer(b"".join(s.template for s in slices), np.uint8)
        self._bytes = np.tile(template, (capacity, 1))

    @property
    def full(self) -> bool:
        """Whether no further tick fits."""
        return self.count == self._capacity

    def add(
        self,
        k: int,
        state: PlantState,
        observation: Observation,
        step: ControlStep,
        status: int,
        force_error: Vector,
        tick_s: float,
    ) -> None:
        """Stage one tick; every array is copied. Arrays, then single numbers, each in table order.

        Args:
            k: Tick number.
            state: Truth at the tick.
            observation: What the controller saw.
            step: What it decided.
            status: Code of `step.status`.
            force_error: Real minus expected contact force over the last hold in [N], (2,).
            tick_s: Controller wall time in [s].
        """
        row = self._values[self.count]
        np.concatenate(
            (
                # /plant/state
                state.q,
                state.dq,
                state.hip,
                state.dhip,
                state.foot.ravel(),
                state.clearance,
                state.torque,
                state.contact_force.ravel(),
                state.push,
                # /control
                observation.q,
                observation.dq,
                step.u_zd,
                step.u_mpc,
                step.u_total,
                step.y,
                step.dy,
                step.contact_force,
                # /mpc
                step.residuals,
                # /prediction/error
                force_error,
            ),
            out=row[: len(_ARRAYS)],
        )
        touching = state.penetrating
        row[len(_ARRAYS) :] = (
            # /plant/state
            *state.contact,
            *(tuple(link in touching for link in LINKS) if touching else _NONE_PENETRATING),
            # /control
            *observation.contact,
            step.theta,
            step.dtheta,
            step.s,
            step.impact_in,
            LEG_CODES[step.stance],
            step.fallback,
            # /mpc
            step.slack,
            step.iterations,
            step.active,
            status,
            # /timing
            tick_s,
            step.solve_s,
        )
        self._ticks[self.count] = k
        self.count += 1

    def pack(self, period_ns: int) -> tuple[bytes, dict[int, NDArray[np.uint64]]]:
        """Message records of the staged ticks, in order, and their index; the block stays as it is.

        Args:
            period_ns: Control period in [ns].

        Returns:
            The records, and channel id -> (log time in [ns], offset) of each message, (count, 2).
        """
        n = self.count
        rows = self._bytes[:n]
        ticks = self._ticks[:n].astype(np.uint64)
        times = ticks * np.uint64(period_ns)
        starts = np.arange(n, dtype=np.uint64) * np.uint64(self.stride)
        index = {}
        for part, channel_id in zip(self._slices, self._ids, strict=True):
            size = part.dtype.itemsize
            records = rows[:, part.offset : part.offset + size].view(part.dtype)[:, 0]
            records["_tick"] = ticks
            records["_time_ns"] = times
            records["_publish_ns"] = times
            for column, name in zip(part.columns, part.names, strict=True):
                records[name] = self._values[:n, column]
            index[channel_id] = np.column_stack((times, starts + np.uint64(part.offset)))
        return rows.tobytes(), index

    def clear(self) -> None:
        """Forget the staged ticks."""
        self.count = 0


def _slice(channel: ChannelTable, channel_id: int, offset: int) -> _Slice:
    layout = layout_of(descriptor(channel))
    length = HEADER - 9 + len(layout.template)
    head = struct.pack("<BQHIQQ", Opcode.MESSAGE, length, channel_id, 0, 0, 0)
    columns = tuple(_COLUMN[channel.topic, name] for name in layout.names)
    return _Slice(layout.record_dtype, head + layout.template, layout.names, columns, offset)
