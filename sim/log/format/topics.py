"""Which channels are this program's own, and which of them a finished log must have."""

from sim.log.format.fields import CHANNELS, DIAGNOSTICS, DIAGNOSTICS_MESSAGE, PACKAGE, TABLES
from sim.log.format.schema import full_name

EVENTS = "/events"

OWN = {channel.topic: full_name(channel) for channel in TABLES} | {
    DIAGNOSTICS: f"{PACKAGE}.{DIAGNOSTICS_MESSAGE}",
    "/tf": "foxglove.FrameTransforms",
    "/scene": "foxglove.SceneUpdate",
    "/forces": "foxglove.SceneUpdate",
    EVENTS: "foxglove.Log",
}
"""Topic -> name of its message. A channel with another topic or message is foreign: kept, shown, never judged."""

PER_TICK = frozenset(channel.topic for channel in CHANNELS)
"""Channels with one message a tick."""

REQUIRED = (*(channel.topic for channel in CHANNELS), EVENTS)
"""Channels without which a log does not tell its run."""

FORMAT = 2
"""Version of topics, fields and metadata that is written; every one from 1 on is read.

1: the first. 2: the result is signed.
"""

SIGNED_SINCE = 2
