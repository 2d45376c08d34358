"""Starts and ends the process that shows a run beside it."""

import contextlib
import importlib.util
import multiprocessing
import socket
from collections.abc import Iterator
from multiprocessing.synchronize import Event
from pathlib import Path

from sim.errors import UserError
from sim.log.read.follow import follow

VIEWERS = ("foxglove", "rerun")
PORTS = {"foxglove": 8765, "rerun": 9876}
HOST = "127.0.0.1"
_PACKAGES = {"foxglove": "foxglove", "rerun": "rerun"}


@contextlib.contextmanager
def live(viewer: str, log: Path, port: int | None) -> Iterator[str]:
    """Serve a log while the context lasts, and after it until it has been shown to its end or the user stops it.

    Args:
        viewer: One of `VIEWERS`.
        log: The log that is going to be written.
        port: Of the server on this machine; None for the viewer's usual one.

    Yields:
        A line for the user: where to look.

    Raises:
        UserError: the extra is missing, or the port is taken.
    """
    if importlib.util.find_spec(_PACKAGES[viewer]) is None:
        raise UserError(f'--live {viewer} needs the packages of the extra "live": pip install "cmpc-walker[live]"')
    number = PORTS[viewer] if port is None else port
    if not 1 <= number <= 65535:
        raise UserError(f"--live-port {number}: must be within 1 and 65535")
    with contextlib.closing(socket.socket()) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, number))
        except OSError as error:
            raise UserError(f"--live-port {number}: cannot be served: {error.strerror}") from error
    made = multiprocessing.get_context("spawn")
    over = made.Event()
    process = made.Process(target=_serve, args=(viewer, log, number, over), daemon=True)
    process.start()
    address = {
        "foxglove": f"ws://{HOST}:{number} (Foxglove or Lichtblick: open connection, Foxglove WebSocket)",
        "rerun": f"rerun+http://{HOST}:{number}/proxy (rerun --connect rerun+http://{HOST}:{number}/proxy)",
    }[viewer]
    try:
        yield f"live at {address}; it begins when a viewer connects"
    finally:
        over.set()
        with contextlib.suppress(KeyboardInterrupt):
            process.join()
        process.terminate()


def _serve(viewer: str, log: Path, port: int, over: Event) -> None:
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the run; the run ends this
    pieces = follow(log, over.is_set)
    if viewer == "foxglove":
        from sim.review.live.foxglove import serve

        serve(pieces, HOST, port, over)
    else:
        from sim.review.live.rerun import serve as serve_rerun

        serve_rerun(pieces, port)
