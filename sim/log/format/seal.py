"""The signature of a result: digests chained over the messages of each channel, and over what the log says of them.

It has no secret, so it proves no author: it shows that a log was changed after its run, unless whoever changed it
made a new signature too. Against that `cmpc log check` judges the ticks again, and `cmpc replay` runs them again.

A digest covers log time, publish time and content of each message, in order of time; messages of one time in order
of their bytes. So it stays the same however a file is chunked, compressed, sorted or renumbered.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

SIGNED_FROM = 15
"""Byte of a message record at which its log time begins: opcode, length, channel and sequence come before."""

DIGITS = 32  # hexadecimal digits of a digest that are written: 128 bits
KEY = "signature"
"""Entry of the metadata "result" that holds the signature."""


class Seal:
    """Digest of one channel, chunk by chunk; messages must come in order of time."""

    def __init__(self) -> None:
        """Start empty."""
        self.count = 0
        self._hash = sha256()
        self._time = -1
        self._waiting: list[bytes] = []  # of one time: what will have to be sorted

    def add(self, time_ns: int, record: bytes) -> None:
        """Take in one message record."""
        if time_ns != self._time:
            self._settle()
            self._time = time_ns
        self._waiting.append(record[SIGNED_FROM:])
        self.count += 1

    def add_block(self, data: NDArray[np.uint8], index: NDArray[np.uint64]) -> None:
        """Take in messages of a chunk.

        Args:
            data: Bytes of the chunk.
            index: (log time in [ns], offset within `data`) of each message, (n, 2).
        """
        times, offsets = index[:, 0], index[:, 1].astype(np.intp)
        lengths = sliding_window_view(data, 8)[offsets + 1]
        size = 9 + int.from_bytes(lengths[0].tobytes(), "little")
        if len(times) < 4 or not (times[1:] > times[:-1]).all() or (lengths != lengths[0]).any():
            for time_ns, offset, length in zip(times.tolist(), offsets.tolist(), lengths, strict=True):
                end = offset + 9 + int.from_bytes(length.tobytes(), "little")
                self.add(time_ns, data[offset:end].tobytes())
            return
        self.add(int(times[0]), data[offsets[0] : offsets[0] + size].tobytes())
        self._settle()
        rows = sliding_window_view(data, size - SIGNED_FROM)[offsets[1:-1] + SIGNED_FROM]
        self._hash.update(rows.tobytes())
        self.count += len(rows)
        self.add(int(times[-1]), data[offsets[-1] : offsets[-1] + size].tobytes())

    def _settle(self) -> None:
        for part in sorted(self._waiting) if len(self._waiting) > 1 else self._waiting:
            self._hash.update(part)
        self._waiting.clear()

    def digest(self) -> str:
        """Digest of all so far."""
        self._settle()
        return self._hash.hexdigest()[:DIGITS]


def digest_of(records: Iterable[tuple[int, bytes]]) -> tuple[int, str]:
    """Count and digest of a whole channel: (log time in [ns], message record), in order of time."""
    seal = Seal()
    for time_ns, record in records:
        seal.add(time_ns, record)
    return seal.count, seal.digest()


def about(
    metadata: Mapping[str, str],
    attachments: Mapping[str, tuple[str, bytes]],
    channels: Mapping[str, tuple[str, bytes, Mapping[str, str]]],
) -> dict[str, str]:
    """Digests of what a log says besides its messages.

    Args:
        metadata: The metadata record "run".
        attachments: Name -> (media type, content).
        channels: Topic -> (name of its message, schema, metadata).
    """
    files = {name: (kind, sha256(data).hexdigest()) for name, (kind, data) in attachments.items()}
    schemas = {topic: (name, sha256(data).hexdigest(), dict(m)) for topic, (name, data, m) in channels.items()}
    return {"run": _digest(dict(metadata)), "attachments": _digest(files), "schemas": _digest(schemas)}


def signature(
    result: Mapping[str, str], messages: Mapping[str, tuple[int, str]], about: Mapping[str, str]
) -> dict[str, object]:
    """The signature of a result.

    Args:
        result: The metadata record "result" without its signature.
        messages: Topic -> count and digest of its messages.
        about: What `about` gave.
    """
    parts: dict[str, object] = {**about, "messages": {topic: list(pair) for topic, pair in messages.items()}}
    return {**parts, "result": _digest([dict(result), parts])}


def differences(written: object, now: Mapping[str, object], topics: Sequence[str]) -> list[str]:
    """What a signature does not fit, a sentence each; none if it is right.

    Args:
        written: The signature in a log.
        now: The signature its content would get.
        topics: The channels to be signed.
    """
    if not isinstance(written, dict) or not isinstance(written.get("messages"), dict):
        return ["the signature of the result cannot be read"]
    wrong = []
    for part, words in (
        ("run", 'the metadata "run" is'),
        ("attachments", "the attachments are"),
        ("schemas", "the schemas or units are"),
    ):
        if written.get(part) != now[part]:
            wrong.append(f"{words} not what was signed")
    before, after = written["messages"], now["messages"]
    assert isinstance(after, dict)
    for topic in dict.fromkeys((*before, *topics)):
        if before.get(topic) != after.get(topic):
            wrong.append(f"the messages of {topic} are not those that were signed")
    if not wrong and written != now:
        wrong.append("the result is not the one that was signed")
    return wrong


def _digest(value: object) -> str:
    return sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:DIGITS]
