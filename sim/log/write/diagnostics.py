"""Figures of a law's own, as a channel whose fields are known at the first tick that has any."""

import math
import re
import struct
from collections.abc import Mapping

from mcap.opcode import Opcode

from sim.log.format.fields import DIAGNOSTICS, DIAGNOSTICS_MESSAGE, ChannelTable, Field, Kind
from sim.log.format.schema import channel_metadata, full_name, schema_of
from sim.log.write.container import McapFile

MOST_FIELDS = 100
_NAME = re.compile(r"^(.*?)\s*(?:\[([^\]]*)\])?$", re.S)
_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel id, sequence, two times


def diagnostics_table(names: Mapping[str, float]) -> ChannelTable:
    """The channel of figures by names such as "push [N]", which say their unit in brackets."""
    fields: dict[str, Field] = {}
    for name in list(names)[:MOST_FIELDS]:
        words, unit = _NAME.match(name.strip()).groups()  # type: ignore[union-attr]
        plain = re.sub(r"\W+", "_", words, flags=re.ASCII).strip("_") or "figure"
        plain = plain if plain[0].isalpha() else f"n{plain}"
        number = 1
        while plain in fields:
            number += 1
            plain = f"{plain.rstrip('0123456789')}{number}"
        fields[plain] = Field(plain, Kind.DOUBLE, unit or "1", f"{words}, by the controller")
    return ChannelTable(DIAGNOSTICS, DIAGNOSTICS_MESSAGE, tuple(fields.values()))


def _tag(number: int) -> bytes:
    """Protobuf's tag of a double."""
    key = number << 3 | 1
    return bytes((key,)) if key < 0x80 else bytes((key & 0x7F | 0x80, key >> 7))


class Diagnostics:
    """Writes the channel."""

    def __init__(self, file: McapFile, first: Mapping[str, float]) -> None:
        """Args: file: the log; first: figures of the first tick that has any, whose names are those of the run."""
        self.names = tuple(first)[:MOST_FIELDS]
        table = diagnostics_table(first)
        self.channel = file.channel(table.topic, full_name(table), schema_of(table), channel_metadata(table))
        tags = [_tag(number) for number in range(1, len(self.names) + 1)]
        self._fields = tuple(zip(tags, self.names, strict=True))
        self._pack = struct.Struct("<" + "".join(f"{len(tag)}sd" for tag in tags)).pack

    def record(self, k: int, time_ns: int, figures: Mapping[str, float]) -> bytes:
        """The message record of a tick; a figure that is not there is NaN."""
        pairs = [x for tag, name in self._fields for x in (tag, figures.get(name, math.nan))]
        data = self._pack(*pairs)
        return _HEAD.pack(Opcode.MESSAGE, _HEAD.size - 9 + len(data), self.channel, k, time_ns, time_ns) + data
