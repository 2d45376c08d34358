"""A block of ticks as MCAP message records: the columns of a run, copied field by field into bytes laid out once."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from sim.interface import Vector
from sim.log.format.fields import CHANNELS, ChannelTable, Field
from sim.log.format.layout import HEADER, layout_of
from sim.log.format.schema import descriptor
from sim.loop import Ticks


@dataclass(frozen=True, slots=True, eq=False)
class _Slice:
    """One channel's part of a tick.

    Attributes:
        dtype: View of its message record.
        template: The record with every number zero.
        fields: What it holds.
        offset: Byte offset within the tick.
    """

    dtype: np.dtype
    template: bytes
    fields: tuple[Field, ...]
    offset: int


class TickBlock:
    """Takes ticks and keeps them as message records.

    Attributes:
        count: Ticks taken.
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
    def room(self) -> int:
        """How many ticks still fit."""
        return self._capacity - self.count

    def add(self, ticks: Ticks, force_error: Vector) -> None:
        """Take ticks, no more than there is room for; every number is copied.

        Args:
            ticks: What happened.
            force_error: Real minus expected contact force over the last hold at each in [N], (n, 2).
        """
        start, n = self.count, len(ticks)
        rows = self._bytes[start : start + n]
        numbers = ticks.first + np.arange(n)
        self._ticks[start : start + n] = numbers
        columns = {"state": ticks.state, "seen": ticks.seen, "step": ticks.step}
        own = {"timing.tick": ticks.tick_s, "error.force": force_error}
        for part in self._slices:
            records = rows[:, part.offset : part.offset + part.dtype.itemsize].view(part.dtype)[:, 0]
            records["_tick"] = numbers
            for field in part.fields:
                source, _, name = field.of.partition(".")
                column: NDArray[Any] = own[field.of] if field.of in own else columns[source][name]
                records[field.name] = column[(slice(None), *field.at)]  # type: ignore[arg-type]
        self.count += n

    def pack(self, period_ns: int) -> tuple[bytes, dict[int, NDArray[np.uint64]]]:
        """Message records of the ticks, in order, and their index; the block stays as it is.

        Args:
            period_ns: Control period in [ns].

        Returns:
            The records, and channel id -> (log time in [ns], offset) of each message, (count, 2).
        """
        n = self.count
        rows = self._bytes[:n]
        times = self._ticks[:n].astype(np.uint64) * np.uint64(period_ns)
        starts = np.arange(n, dtype=np.uint64) * np.uint64(self.stride)
        index = {}
        for part, channel_id in zip(self._slices, self._ids, strict=True):
            size = part.dtype.itemsize
            records = rows[:, part.offset : part.offset + size].view(part.dtype)[:, 0]
            records["_time_ns"] = times
            records["_publish_ns"] = times
            index[channel_id] = np.column_stack((times, starts + np.uint64(part.offset)))
        return rows.tobytes(), index

    def clear(self) -> None:
        """Forget the ticks."""
        self.count = 0


def _slice(channel: ChannelTable, channel_id: int, offset: int) -> _Slice:
    layout = layout_of(descriptor(channel))
    length = HEADER - 9 + len(layout.template)
    head = struct.pack("<BQHIQQ", Opcode.MESSAGE, length, channel_id, 0, 0, 0)
    return _Slice(layout.record_dtype, head + layout.template, channel.fields, offset)
