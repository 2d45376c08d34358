"""Is a log sound? CRCs, gaps in the ticks, messages against schemas, attachments, signature, figures against ticks."""

import json
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, ChunkIndex, MetadataIndex, Schema, Statistics

from controller.common import toml
from sim.errors import UserError
from sim.log.format.topics import PER_TICK, REQUIRED
from sim.log.read import Log
from sim.log.read.attachments import check_xml
from sim.log.read.reader import log_of, read_bytes
from sim.log.read.scan import Scan, parse, scan, walk
from sim.log.tools.judged import judged_problems
from sim.log.tools.recover import gaps
from sim.log.tools.signed import signature_problems
from sim.scenario import from_toml


def check(path: Path) -> tuple[Log, list[str]]:
    """Everything wrong with a log, one sentence each; none if it is sound.

    Raises:
        UserError: it cannot be opened or is no MCAP file.
    """
    data = read_bytes(path)
    walked = scan(data)
    log = log_of(path, walked)
    problems = [f"byte {at}: {text}" for at, text in log.problems]
    if log.unknown_format:
        problems.append(f"the log {log.unknown_format}")
    if log.complete:
        problems += _summary(data, walked)
    elif log.ended:
        problems.append("the file lacks its closing bytes; its data are all there")
    else:
        problems.append("the log was not finished: the run was killed, or the file is cut off")
    problems += [f"channel {topic} is missing" for topic in REQUIRED if not log.is_own(topic)]
    lacking = gaps(log)
    problems += [f"{topic} lacks the ticks {first} to {last}" for topic, first, last in lacking]
    problems += _messages(log)
    problems += _attachments(log)
    if "run" not in log.metadata:
        problems.append('metadata "run" is missing')
    elif log.format is None and not log.unknown_format:
        problems.append("the log does not name its format")
    if "result" not in log.metadata:
        problems.append('metadata "result" is missing: the run did not come to its end')
    problems += signature_problems(log)
    if not lacking and "recovery" not in log.metadata:
        problems += judged_problems(log)
    return log, problems


def _summary(data: bytes, walked: Scan) -> Iterator[str]:
    """Compare what the summary section repeats with the data; a file may do without."""
    counts = {key: len(records) for key, records in walked.messages.items()}
    kinds = {
        Opcode.SCHEMA: Schema,
        Opcode.CHANNEL: Channel,
        Opcode.STATISTICS: Statistics,
        Opcode.CHUNK_INDEX: ChunkIndex,
        Opcode.ATTACHMENT_INDEX: AttachmentIndex,
        Opcode.METADATA_INDEX: MetadataIndex,
    }
    seen: dict[int, list[Any]] = {kind: [] for kind in kinds}
    for at, opcode, body in walk(memoryview(data), walked.end):
        if opcode in kinds:
            try:
                seen[opcode].append(parse(kinds[Opcode(opcode)], body))
            except ValueError as error:
                yield f"byte {at}: {error}"
                return
    for opcode, name in ((Opcode.SCHEMA, "schemas"), (Opcode.CHANNEL, "channels")):
        listed = {record.id: record for record in seen[opcode]}
        if listed and listed != {record.id: record for code, record in walked.kept if code == opcode}:
            yield f"the {name} of the summary are not those of the data"
    if seen[Opcode.CHUNK_INDEX] and len(seen[Opcode.CHUNK_INDEX]) != len(walked.chunks):
        yield f"the summary lists {len(seen[Opcode.CHUNK_INDEX])} chunks, there are {len(walked.chunks)}"
    for opcode, kind in ((Opcode.ATTACHMENT_INDEX, Opcode.ATTACHMENT), (Opcode.METADATA_INDEX, Opcode.METADATA)):
        names = sorted(record.name for record in seen[opcode])
        if names and names != sorted(record.name for code, record in walked.kept if code == kind):
            yield f"the {kind.name.lower()} names of the summary are not those of the data"
    for statistics in seen[Opcode.STATISTICS]:
        known = {key: count for key, count in statistics.channel_message_counts.items() if count}
        if known != counts or statistics.message_count != sum(counts.values()):
            yield "the statistics count other messages than there are"


def _messages(log: Log) -> Iterator[str]:
    """Read every message by its schema; time must follow the ticks."""
    period = log.metadata.get("run", {}).get("period_ns", "")
    whole = set(log.channel("/plant/state")["_tick"].tolist()) if log.has_layout("/plant/state") else set()
    for topic in log.own:
        try:
            if not log.has_layout(topic):
                for _ in log.decoded(topic):
                    pass
            else:
                rows = log.channel(topic)
        except UserError as error:
            yield str(error)
            continue
        if log.malformed.get(topic):
            yield f"{log.malformed[topic]} messages of {topic} do not match the schema"
        if topic not in PER_TICK or not log.has_layout(topic):
            continue
        ticks = rows["_tick"].astype(np.int64)
        if period.isdecimal() and len(period) < 12:
            times = rows["_tick"].astype(np.uint64) * np.uint64(int(period))
            if not np.array_equal(rows["_time_ns"], times):
                yield f"{topic}: times are not tick times period"
        if (np.diff(ticks) <= 0).any():
            yield f"{topic} has a tick twice"
        if set(ticks.tolist()) != whole:
            yield f"{topic} has other ticks than /plant/state"


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
                toml.loads(data.decode("utf-8"))
            elif name.endswith((".xml", ".urdf")):
                check_xml(name, data)
        except ValueError as error:  # a UserError is one
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
