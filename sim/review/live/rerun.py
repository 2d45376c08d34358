"""Rerun's server: what is drawn of a log, as it grows."""

import time
from collections.abc import Iterable
from itertools import groupby

import rerun as rr

from sim.log.read.follow import Piece
from sim.review.rerun import NAME, Drawer, blueprint

KEPT = 60.0  # [s] after the end in which a viewer may still fetch the recording


def serve(pieces: Iterable[Piece], port: int) -> None:
    """Serve a log until a while after its end; a viewer that comes late gets all of it.

    Args:
        pieces: Its chunks as they come.
        port: Of the server.
    """
    recording = rr.RecordingStream(NAME)
    recording.serve_grpc(grpc_port=port, default_blueprint=blueprint())
    drawer = Drawer(recording)
    for piece in pieces:
        for number, records in groupby(sorted(piece.messages, key=lambda one: one[0]), key=lambda one: one[0]):
            if number in piece.channels:
                drawer.take(piece.channels[number][0].topic, [record for _, record in records])
    recording.flush()
    time.sleep(KEPT)
