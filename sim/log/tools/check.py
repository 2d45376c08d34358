"""Is a log sound? CRCs, summary against data, gaps in the ticks, messages against schemas, attachments."""

import json
import tomllib
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, ChunkIndex, MetadataIndex, Schema, Statistics

from sim.errors import UserError
from sim.log.read import Log
from sim.log.read.attachments import check_xml
from sim.log.read.reader import log_of, read_bytes
from sim.log.read.scan import Scan, parse, scan, walk
from sim.log.tools.recover import gaps
from sim.scenario import from_toml


def check(path: Path) -> tuple[Log, list[str]]:
    """Everything wrong with a log, one sentence each; none if it is sound.

    Raises:
        UserError: it cannot be opened or is no MCAP file.
    """
    data = read_bytes(path)
    found = scan(data)
    log = log_of(path, found)
    problems = [f"byte {at}: {text}" for at, text in found.problems]
    if not log.complete:
        problems.append("the log was not finished: the run was killed, or the file is cut off")
    else:
        problems += _summary(data, found)
    problems += [f"{topic} lacks the ticks {first} to {last}" for topic, first, last in gaps(log)]
    problems += _messages(log)
    problems += _attachments(log)
    if "run" not in log.metadata:
        problems.append('metadata "run" is missing')
    if "result" not in log.metadata:
        problems.append('metadata "result" is missing: the run did not come to its end')
    return log, problems


def _summary(data: bytes, found: Scan) -> Iterator[str]:
    """Compare the summary section with the data it summarises."""
    counts = {key: len(records) for key, records in found.messages.items()}
    kept = [record for _, record in found.kept]
    kinds = {
        Opcode.SCHEMA: Schema,
        Opcode.CHANNEL: Channel,
        Opcode.STATISTICS: Statistics,
        Opcode.CHUNK_INDEX: ChunkIndex,
        Opcode.ATTACHMENT_INDEX: AttachmentIndex,
        Opcode.METADATA_INDEX: MetadataIndex,
    }
    seen: dict[int, list[object]] = {kind: [] for kind in kinds}
    for at, opcode, body in walk(memoryview(data), found.end):
        if opcode in kinds:
            try:
                seen[opcode].append(parse(kinds[Opcode(opcode)], body))
            except ValueError as error:
                yield f"byte {at}: {error}"
                return
    for opcode, name in ((Opcode.SCHEMA, "schemas"), (Opcode.CHANNEL, "channels")):
        if seen[opcode] != [record for code, record in found.kept if code == opcode]:
            yield f"the {name} of the summary are not those of the data"
    if len(seen[Opcode.CHUNK_INDEX]) != found.chunks:
        yield f"the summary lists {len(seen[Opcode.CHUNK_INDEX])} chunks, there are {found.chunks}"
    for opcode, kind in ((Opcode.ATTACHMENT_INDEX, Opcode.ATTACHMENT), (Opcode.METADATA_INDEX, Opcode.METADATA)):
        listed = [getattr(record, "name", "") for record in seen[opcode]]
        if listed != [record.name for code, record in found.kept if code == kind]:
            yield f"the {kind.name.lower()} names of the summary are not those of the data"
    for statistics in seen[Opcode.STATISTICS]:
        assert isinstance(statistics, Statistics)
        if statistics.channel_message_counts != counts or statistics.message_count != sum(counts.values()):
            yield "the statistics count other messages than there are"
    if not seen[Opcode.STATISTICS] and kept:
        yield "the summary has no statistics"


def _messages(log: Log) -> Iterator[str]:
    """Read every message by its schema; time must follow the ticks."""
    period = log.metadata.get("run", {}).get("period_ns", "")
    for topic in log.channels:
        try:
            if not log.has_layout(topic):
                log.messages(topic)
                continue
            rows = log.channel(topic)
        except UserError as error:
            yield str(error)
            continue
        if period.isdecimal() and len(period) < 12:
            times = rows["_tick"].astype(np.uint64) * np.uint64(int(period))
            if not np.array_equal(rows["_time_ns"], times):
                yield f"{topic}: times are not tick times period"
        if (np.diff(rows["_tick"].astype(np.int64)) <= 0).any():
            yield f"{topic}: ticks do not increase"


def _attachments(log: Log) -> Iterator[str]:
    """Parse what is attached; compare it with the digests written before the run."""
    try:
        digests = json.loads(log.metadata.get("run", {}).get("sha256", "{}"))
        wanted = {str(name): str(digest) for name, digest in digests.items()}
    except (ValueError, RecursionError, AttributeError):
        yield "the digests of the attachments cannot be read"
        wanted = {}
    yield from changed_attachments(log, wanted)
    if "scenario.toml" not in log.attachments:
        yield "attachment scenario.toml is missing"
    for name, (_, data) in log.attachments.items():
        try:
            if name == "scenario.toml":
                from_toml(data.decode("utf-8"), trusted=False)
            elif name.endswith(".toml"):
                tomllib.loads(data.decode("utf-8"))
            elif name.endswith((".xml", ".urdf")):
                check_xml(name, data)
        except (ValueError, RecursionError) as error:  # a UserError is a ValueError
            yield f"attachment {name}: {error}"


def changed_attachments(log: Log, digests: dict[str, str]) -> list[str]:
    """A sentence for each attachment that is missing or not the one the run began with.

    Args:
        log: The log.
        digests: Name -> SHA-256 as hexadecimal digits, from the metadata "run".
    """
    changed = []
    for name, digest in digests.items():
        if name not in log.attachments:
            changed.append(f"attachment {name} is missing")
        elif sha256(log.attachments[name][1]).hexdigest() != digest:
            changed.append(f"attachment {name} is not the one the run began with")
    return changed + [
        f"attachment {name} was added later" for name in log.attachments if digests and name not in digests
    ]
