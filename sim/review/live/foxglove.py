"""Foxglove's WebSocket protocol: the log's own channels and bytes, in real time, to whoever subscribes.

A client that does not read loses its oldest messages in the server's queue for it; nobody else waits for it.
"""

import time
from collections.abc import Callable, Iterable
from multiprocessing.synchronize import Event
from threading import Event as Flag

import foxglove
from foxglove import Channel, Schema
from foxglove.websocket import ChannelView, Client, ServerListener

from sim.log.format.layout import HEADER
from sim.log.read.follow import Piece
from sim.log.read.log import time_ns

BACKLOG = 65_536  # messages of a client: some ten seconds of a run
PATIENCE = 60.0  # [s] for the first client, once the run is over
SETTLES = 0.5  # [s] in which a client subscribes to all it wants, and in which the last messages leave
SLICE = 0.005  # [s] that messages may come early


class _Listener(ServerListener):
    """Notes the first subscription."""

    def __init__(self) -> None:
        self.subscribed = Flag()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Somebody looks."""
        self.subscribed.set()


def serve(pieces: Iterable[Piece], host: str, port: int, over: Event) -> None:
    """Serve a log until it has been shown.

    Args:
        pieces: Its chunks as they come.
        host: Address to listen on.
        port: Of the server.
        over: Set when the run is over; without a client it is waited for `PATIENCE` after that.
    """
    listener = _Listener()
    server = foxglove.start_server(
        name="cmpc", host=host, port=port, server_listener=listener, message_backlog_size=BACKLOG
    )
    channels: dict[int, Channel] = {}
    begins: float | None = None
    for piece in pieces:
        for number, (channel, schema) in piece.channels.items():
            if number not in channels:
                made = Schema(name=schema.name, encoding=schema.encoding, data=schema.data)
                channels[number] = Channel(
                    channel.topic, schema=made, message_encoding=channel.message_encoding, metadata=channel.metadata
                )
        if begins is None:
            if not _somebody(listener.subscribed, over.is_set):
                break
            begins = time.monotonic()
        for number, record in piece.messages:
            at = time_ns(record)
            early = begins + 1e-9 * at - time.monotonic()
            if early > SLICE:
                time.sleep(early)
            if number in channels:
                channels[number].log(record[HEADER:], log_time=at)
    time.sleep(SETTLES)
    server.stop()


def _somebody(subscribed: Flag, over: Callable[[], bool]) -> bool:
    """Whether a client comes."""
    waited = 0.0
    while not subscribed.wait(0.1):
        waited += 0.1 if over() else 0.0
        if waited > PATIENCE:
            return False
    time.sleep(SETTLES)
    return True
