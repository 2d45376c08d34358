"""The log of one run: every tick, every event, and all it takes to run it again."""

import contextlib
import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.data_stream import RecordBuilder
from mcap.records import Message
from numpy.typing import NDArray

from sim.errors import UserError
from sim.interface import LEGS, PlantState
from sim.log.format.fields import CHANNELS, PREDICTED_IMPACT, PREDICTION
from sim.log.format.schema import SCHEMA, channel_metadata, closure, full_name
from sim.log.write.arrows import GroundAngle, arrows_of, force_update
from sim.log.write.block import TickBlock
from sim.log.write.container import McapFile
from sim.log.write.diagnostics import Diagnostics
from sim.log.write.header import RunHeader
from sim.log.write.prediction import Hindsight, horizon_message
from sim.log.write.scene import frame_transforms, scene_update, set_time
from sim.loop import RunSummary, Ticks

CHUNK_TICKS = 200
"""Ticks a chunk: about 230 KiB, and what a killed process loses at most."""

FRAME_RATE = 60.0  # [1/s] of /tf; viewers warn above it
MOST_UNLISTED = 20
"""Statuses missing from the table that are told as events, each once; texts may carry numbers."""

LEVELS = {
    "debug": Log.DEBUG,
    "info": Log.INFO,
    "warning": Log.WARNING,
    "error": Log.ERROR,
    "fatal": Log.FATAL,
}
"""Level of an event -> foxglove.Log level."""


class _Extra(NamedTuple):
    """A message of no fixed size, waiting for its chunk: `row` ticks of the block come before it."""

    row: int
    channel_id: int
    time_ns: int
    record: bytes


class Recorder:
    """Context manager that writes the log; leaving it finishes the file, whatever happened inside."""

    def __init__(self, path: Path | str, header: RunHeader, period: float) -> None:
        """Create the log and write all that is known before the first tick.

        Args:
            path: The log to be; must not exist.
            header: What runs.
            period: Control period in [s].

        Raises:
            UserError: the file exists already or cannot be written.
        """
        self._period_ns = round(period * 1e9)
        if self._period_ns <= 0:
            raise ValueError(f"period is {period} s; it must be at least 1e-9 s")
        self._femur_length = {leg: header.link_lengths[f"{leg}_femur"] for leg in LEGS}
        self._ground = GroundAngle(header.ground)
        self._hindsight = Hindsight()
        self.frame_every = max(1, round(1 / (FRAME_RATE * period)))
        self._extras: list[_Extra] = []
        self._unlisted: set[str] = set()
        self._diagnostics: Diagnostics | None = None
        self._more_figures = False
        self._last = 0
        self._file = McapFile(Path(path))
        try:
            self._begin(header)
        except BaseException:
            with contextlib.suppress(UserError):
                self._file.finish()
            raise

    def _begin(self, header: RunHeader) -> None:
        file = self._file
        file.metadata("run", header.metadata(self._period_ns))
        for name, (media_type, data) in header.all_attachments().items():
            file.attachment(name, media_type, data)
        ids = [file.channel(c.topic, full_name(c), SCHEMA, channel_metadata(c)) for c in CHANNELS]
        self._block = TickBlock(CHUNK_TICKS, ids)
        self._prediction, self._impact = (
            file.channel(c.topic, full_name(c), SCHEMA, channel_metadata(c)) for c in (PREDICTION, PREDICTED_IMPACT)
        )
        foxglove = (("/tf", FrameTransforms), ("/scene", SceneUpdate), ("/forces", SceneUpdate), ("/events", Log))
        self._tf, self._scene, self._forces, self._events = (
            file.channel(topic, kind.DESCRIPTOR.full_name, closure(kind.DESCRIPTOR.file), {})
            for topic, kind in foxglove
        )
        self.event(0, "info", "run", header.headline)
        self._add_extra(0, self._scene, scene_update(header.link_lengths, header.ground), 0)

    def ticks(self, ticks: Ticks) -> None:
        """Log ticks.

        Raises:
            UserError: the log cannot be written any further.
        """
        done = 0
        while done < len(ticks):
            if not self._block.room:
                self._flush()
            piece = ticks.part(done, min(len(ticks), done + self._block.room), ticks.first + done)
            self._add(piece)
            done += len(piece)

    def _add(self, ticks: Ticks) -> None:
        first, n = ticks.first, len(ticks)
        for k in sorted({k for k in (*ticks.texts, *ticks.frames, *ticks.diagnostics) if first <= k < first + n}):
            if k in ticks.diagnostics:
                self._diagnose(k, ticks.diagnostics[k], self._block.count + k - first)
            if k in ticks.texts:
                self._note_unlisted(k, ticks.texts[k], self._block.count + k - first)
            if k in ticks.frames:
                self._add_frame(k, ticks, self._block.count + k - first)
        self._last = first + n - 1
        self._block.add(ticks, self._hindsight.look(ticks))

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Log an event.

        Args:
            k: Tick number.
            level: One of `LEVELS`.
            name: What kind: "impact", "push", "fallback", or how the run ended.
            message: One line for people.
        """
        self._add_event(k, level, name, message, self._block.count)
        if name == "impact":
            self._add_extra(k, self._impact, self._hindsight.impact(k), self._block.count)

    def result(self, summary: RunSummary) -> None:
        """Log how the run ended, as the metadata record "result".

        Args:
            summary: The figures of the run; texts as they are, all else as JSON; signed.
        """
        self._flush()
        figures = dataclasses.asdict(summary).items()
        texts = {k: v if isinstance(v, str) else json.dumps(v) for k, v in figures}
        self._file.metadata("result", self._file.signed(texts))

    def close(self) -> None:
        """Write what is staged and finish the file; a second call does nothing.

        Raises:
            UserError: it cannot be written; what was written before can be read.
        """
        if self._file.finished:
            return
        try:
            self._flush()
        finally:
            self._file.finish()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
            return
        self.event(self._last, "error", "error", f"{type(error).__name__}: {error}")
        with contextlib.suppress(UserError):  # the first error is the one to report
            self.close()

    def _add_event(self, k: int, level: str, name: str, message: str, row: int) -> None:
        entry = Log(level=LEVELS[level], message=message, name=name)
        set_time(entry.timestamp, k * self._period_ns)
        self._add_extra(k, self._events, entry.SerializeToString(deterministic=True), row)

    def _add_frame(self, k: int, ticks: Ticks, row: int) -> None:
        """What is drawn: links, forces, and what the controller expects."""
        time_ns = k * self._period_ns
        frame, number = ticks.frames[k], k - ticks.first
        state = PlantState.of(ticks.state[number], frame.applied)
        self._add_extra(k, self._tf, frame_transforms(time_ns, state, self._femur_length), row)
        arrows = arrows_of(state, self._ground, self._femur_length)
        if arrows:
            lifetime_ns = round(1.5 * self.frame_every * self._period_ns)
            self._add_extra(k, self._forces, force_update(time_ns, arrows, lifetime_ns), row)
        if frame.plan is not None:
            impact_in = int(ticks.step["impact_in"][number])
            message = horizon_message(frame.plan, self._period_ns * 1e-9, impact_in)
            self._add_extra(k, self._prediction, message, row)

    def _diagnose(self, k: int, figures: Mapping[str, float], row: int) -> None:
        if self._diagnostics is None:
            self._diagnostics = Diagnostics(self._file, figures)
        if len(figures) > len(self._diagnostics.names) and not self._more_figures:
            self._more_figures = True
            more = [name for name in figures if name not in self._diagnostics.names]
            text = f"not at the first tick, not logged: {', '.join(more)[:200]}"
            self._add_event(k, "warning", "diagnostics", text, row)
        time_ns = k * self._period_ns
        record = self._diagnostics.record(k, time_ns, figures)
        self._extras.append(_Extra(row, self._diagnostics.channel, time_ns, record))

    def _note_unlisted(self, k: int, status: str, row: int) -> None:
        if status not in self._unlisted and len(self._unlisted) < MOST_UNLISTED:
            self._unlisted.add(status)
            self._add_event(k, "warning", "status", f'status "{status}" is logged as "other"', row)

    def _add_extra(self, k: int, channel_id: int, data: bytes, row: int) -> None:
        time_ns = k * self._period_ns
        message = Message(channel_id, log_time=time_ns, data=data, publish_time=time_ns, sequence=k)
        builder = RecordBuilder()
        message.write(builder)
        self._extras.append(_Extra(row, channel_id, time_ns, builder.end()))

    def _flush(self) -> None:
        """Write the staged ticks and the messages between them as one chunk."""
        if not (self._block.count or self._extras):
            return
        rows, index = self._block.pack(self._period_ns)
        data, index = _interleave(rows, self._block.stride, index, self._extras)
        self._file.chunk(data, index)
        self._block.clear()
        self._extras.clear()


def _interleave(
    rows: bytes, stride: int, index: dict[int, NDArray[np.uint64]], extras: list[_Extra]
) -> tuple[bytes, dict[int, NDArray[np.uint64]]]:
    """Put the extra messages between the ticks and move the offsets of what follows them.

    Args:
        rows: Message records of n ticks.
        stride: Bytes of one tick.
        index: Channel id -> (log time, offset within `rows`), (n, 2).
        extras: In order of `row`.
    """
    shift = np.zeros(len(rows) // stride + 1, dtype=np.uint64)
    parts: list[bytes] = []
    found: dict[int, list[tuple[int, int]]] = {}
    done = added = 0
    for extra in extras:
        parts.append(rows[done : extra.row * stride])
        done = extra.row * stride
        found.setdefault(extra.channel_id, []).append((extra.time_ns, done + added))
        parts.append(extra.record)
        added += len(extra.record)
        shift[extra.row :] += np.uint64(len(extra.record))
    parts.append(rows[done:])
    moved = {key: entries + np.column_stack((0 * shift[:-1], shift[:-1])) for key, entries in index.items()}
    merged = {key: entries for key, entries in moved.items() if len(entries)}
    merged |= {key: np.array(entries, dtype=np.uint64) for key, entries in found.items()}
    return b"".join(parts), merged
