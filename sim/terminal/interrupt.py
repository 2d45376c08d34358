"""Ctrl-C, SIGTERM and a lost connection (SIGHUP) as a request to stop; Ctrl-C heard where compiling would lose it."""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
DEAF = (
    "ExecutionEngine._raw_object_cache_notify",  # what LLVM calls when llvmlite has compiled a kernel
    "ExtensionFileLoader.create_module",
    "ExtensionFileLoader.exec_module",
    "_DispatcherBase.typeof_pyval",  # what Numba's dispatcher calls for a type it has not met
    "_numba_unpickle",  # and compiled code, for the class of a record that it returns
    "clarabel_solve_problem",  # Clarabel asks for signals while it solves, and takes an exception for its own end
)
"""Functions under which an exception gets lost on its way through compiled code, or becomes another.

Compiled code makes its records, too; what makes one is a nameless function in a module of its own (`RECORD`).
"""
RECORD = "namedtuple_"  # how the name of that module begins, in every Python since 3.7


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


def _is_deaf(frame: FrameType) -> bool:
    return frame.f_code.co_qualname in DEAF or frame.f_globals.get("__name__", "").startswith(RECORD)


def _interrupt(frame: FrameType, event: str, argument: object) -> None:
    """What a frame is traced with that is to be interrupted where it goes on."""
    sys.settrace(None)
    frame.f_trace = None
    raise KeyboardInterrupt


@contextmanager
def hearing_ctrl_c() -> Iterator[None]:
    """Raise `KeyboardInterrupt` on Ctrl-C, after the call where it would be lost (main thread only)."""
    here = threading.current_thread() is threading.main_thread()
    if not here or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def handle(signum: int, frame: FrameType | None) -> None:
        caller = None  # of the outermost such call
        while frame is not None:
            if _is_deaf(frame):
                caller = frame.f_back
            frame = frame.f_back
        if caller is None:
            raise KeyboardInterrupt
        caller.f_trace = _interrupt
        sys.settrace(lambda *_: None)  # lets Python look at frames' own

    signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
