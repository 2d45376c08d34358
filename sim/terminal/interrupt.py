"""Ctrl-C, SIGTERM and a lost connection (SIGHUP) as a request to stop; Ctrl-C heard where compiling would lose it."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
DEAF = (
    "ExecutionEngine._raw_object_cache_notify",  # what LLVM calls when llvmlite has compiled a kernel
    "ExtensionFileLoader.create_module",
    "ExtensionFileLoader.exec_module",
    "clarabel_solve_problem",  # Clarabel asks for signals while it solves, and takes an exception for its own end
)
"""Functions under which an exception gets lost on its way through compiled code, or becomes another."""
AGAIN = 0.003  # [s] from an interrupt that met such a call to the next try


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


@contextmanager
def hearing_ctrl_c() -> Iterator[None]:
    """Raise `KeyboardInterrupt` on Ctrl-C, after the call where it would be lost (main thread only)."""
    here = threading.current_thread() is threading.main_thread()
    if not here or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def handle(signum: int, frame: FrameType | None) -> None:
        while frame is not None:
            if frame.f_code.co_qualname in DEAF:
                again = threading.Timer(AGAIN, os.kill, (os.getpid(), signum))
                again.daemon = True
                again.start()
                return
            frame = frame.f_back
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
