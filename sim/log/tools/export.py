"""A log as tables for other programs: one CSV or Parquet file a channel, units in the header."""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from sim.errors import UserError
from sim.log.read.frames import Event, Frame, Run
from sim.log.tools.text import file_stem

FORMATS = ("csv", "parquet")


def export(run: Run, folder: Path, kind: str, topics: Iterable[str] | None = None) -> list[Path]:
    """Write frames, events and attachments.

    Args:
        run: The log.
        folder: Where to; made if missing. No existing file is overwritten.
        kind: One of `FORMATS`.
        topics: Channels to write; None for every table, the events and the attachments.

    Returns:
        The files, in order.

    Raises:
        UserError: no such channel, a file exists already or cannot be written, or a package is missing.
    """
    frames = [run[topic] for topic in topics] if topics is not None else list(run.frames.values())
    write = _parquet_writer() if kind == "parquet" else _write_csv
    plan: list[tuple[Path, Any]] = [(folder / f"{file_stem(frame.topic)}.{kind}", frame) for frame in frames]
    if topics is None:
        plan.append((folder / "events.csv", run.events))
        for name, (_, data) in run.log.attachments.items():
            plan.append((folder / "attachments" / file_stem(name), data))
    taken = set()
    for path, _ in plan:
        if path in taken or path.exists():
            raise UserError(f"{path}: exists already and is never overwritten; choose another folder")
        taken.add(path)
    try:
        for path, what in plan:
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(what, bytes):
                path.write_bytes(what)
            elif isinstance(what, Frame):
                write(path, what)
            else:
                _write_events(path, what)
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return [path for path, _ in plan]


def _title(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _write_csv(path: Path, frame: Frame) -> None:
    """Numbers as the shortest text that reads back equal; codes of words as words."""
    columns: list[list[Any]] = [frame.tick.tolist(), frame.t.round(9).tolist()]
    for name, column in frame.items():
        words = frame.enums.get(name)
        values = column.tolist()
        columns.append(
            [words.get(v, v) for v in values] if words else [int(v) for v in values] if column.dtype == bool else values
        )
    with open(path, "x", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["tick", "t [s]", *(_title(name, frame.units[name]) for name in frame)])
        writer.writerows(zip(*columns, strict=True))


def _write_events(path: Path, events: Iterable[Event]) -> None:
    with open(path, "x", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["t [s]", "level", "name", "message"])
        writer.writerows((round(e.t, 9), e.level, e.name, e.message) for e in events)


def _parquet_writer() -> Any:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise UserError('--format parquet needs the package pyarrow: pip install "cmpc-walker[parquet]"') from None

    def write(path: Path, frame: Frame) -> None:
        arrays, fields = [pyarrow.array(frame.tick), pyarrow.array(frame.t)], []
        fields += [
            pyarrow.field("tick", arrays[0].type),
            pyarrow.field("t", arrays[1].type, metadata={"unit": "s"}),
        ]
        for name, column in frame.items():
            arrays.append(pyarrow.array(column))
            notes = {"unit": frame.units[name], "description": frame.descriptions[name]}
            fields.append(pyarrow.field(name, arrays[-1].type, metadata=notes))
        table = pyarrow.table(arrays, schema=pyarrow.schema(fields))
        pyarrow.parquet.write_table(table, path)

    return write
