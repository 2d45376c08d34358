"""Ctrl-C, SIGTERM and a lost connection (SIGHUP) as a request to stop, so that a run can finish its log."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopRequest:
    """Remembers the first signal that came.

    Attributes:
        signum: Number of the signal, 0 if none came.
    """

    def __init__(self) -> None:
        self.signum = 0

    def __call__(self) -> str | None:
        """Why to stop, None to go on."""
        return f"interrupted by {signal.Signals(self.signum).name}" if self.signum else None

    def handle(self, signum: int, frame: FrameType | None) -> None:
        """Note the first signal; a second one does not wait for the run to stop."""
        if self.signum:
            raise KeyboardInterrupt
        self.signum = signum


@contextmanager
def stop_on_signal() -> Iterator[StopRequest]:
    """Turn SIGINT, SIGTERM and SIGHUP into a `StopRequest` while the context lasts (main thread only)."""
    request = StopRequest()
    if threading.current_thread() is not threading.main_thread():
        yield request
        return
    before = {signum: signal.signal(signum, request.handle) for signum in SIGNALS}
    try:
        yield request
    finally:
        for signum, handler in before.items():
            signal.signal(signum, handler)
