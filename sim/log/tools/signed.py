"""Whether a log is the one that its run signed."""

import json

from sim.log.format import seal
from sim.log.format.topics import SIGNED_SINCE
from sim.log.read import Log
from sim.log.read.log import time_ns


def is_signed(log: Log) -> bool:
    """Whether a log has a result with a signature; those of format 1 have none."""
    return seal.KEY in log.metadata.get("result", {})


def signature_problems(log: Log) -> list[str]:
    """What of a log is not as it was signed, a sentence each; none where it has no result, or is of format 1."""
    result = dict(log.metadata.get("result", {}))
    if not result:
        return []
    if seal.KEY not in result:
        return ["the result is not signed"] if (log.format or 0) >= SIGNED_SINCE else []
    try:
        written = json.loads(result.pop(seal.KEY))
    except (ValueError, RecursionError):
        written = None
    return seal.differences(written, signature_now(log, result), log.own)


def signature_now(log: Log, result: dict[str, str]) -> dict[str, object]:
    """The signature that a log's content would get today.

    Args:
        log: The log.
        result: Its metadata record "result" without a signature.
    """
    own = log.own
    messages = {t: seal.digest_of((time_ns(record), record) for record in log.records(t)) for t in own}
    channels = {}
    for topic in own:
        schema = log.schemas[log.channels[topic].schema_id]
        channels[topic] = (schema.name, schema.data, log.channels[topic].metadata)
    about = seal.about(log.metadata.get("run", {}), log.attachments, channels)
    now = seal.signature(result, messages, about)
    plain: dict[str, object] = json.loads(json.dumps(now))  # as it reads back
    return plain
