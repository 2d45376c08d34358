"""Where workers come from: one template process, started with the first worker, that forks them."""

import atexit
import functools
import os
import pickle
import select
import socket
import subprocess
import threading
import time
from collections.abc import Callable
from typing import Any

from sim.errors import UserError
from sim.runner import child

START_LIMIT = 120.0  # [s] for a template to import what it needs
WARM_LIMIT = 600.0  # [s] to compile everything, on a busy machine
REAP_LIMIT = 60.0  # [s]
ENDING = 0.5  # [s] a process may take to end once its socket is closed
SLICE = 0.1  # [s] between looks at the clock
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Each worker has a processor to itself: two libraries with two threads each would be in each other's way."""


class Lost(Exception):
    """The template ended; its workers went with it."""


class Nursery:
    """Forks, reaps and kills workers, through a template process."""

    def __init__(self) -> None:
        """Start nothing yet."""
        self._lock = threading.RLock()
        self._template: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._warm: dict[bytes, str] = {}

    def spawn(self, log: str | None) -> tuple[int, socket.socket, int]:
        """A new worker in this process's folder: its number, the socket to it, the number of the template that made it.

        Args:
            log: File that takes what the worker prints; None to drop it.

        Raises:
            UserError: no process can be started.
        """
        for attempt in (1, 2, 3):
            mine, theirs = socket.socketpair()
            try:
                with self._lock:
                    pid = self._ask((child.SPAWN, (log, os.getcwd())), START_LIMIT, (theirs.fileno(),))
                    assert self._template is not None
                    return pid, mine, self._template.pid
            except Lost:
                mine.close()
                if attempt == 3:
                    raise UserError("worker processes cannot be started: their template ended three times") from None
            finally:
                theirs.close()
        raise AssertionError

    def reap(self, pid: int, made_by: int, grace: float) -> int | None:
        """Exit code of a worker, minus its signal, None if nobody knows; it is killed unless it ends within `grace`."""
        with self._lock:
            if self._template is None or self._template.pid != made_by:
                return None
            try:
                found: int = self._ask((child.REAP_OR_KILL, (pid, grace)), REAP_LIMIT + grace)
            except Lost:
                return None
            return found

    def warm(
        self, function: Callable[..., None], arguments: tuple[Any, ...], stamp: str, stop: Callable[[], object]
    ) -> None:
        """Make a call in the template once, whose traces all later workers inherit.

        Args:
            function: What to call.
            arguments: Its arguments.
            stamp: What its files were; when that changes, a new template begins without a trace of the old ones.
            stop: Asked while it lasts; anything true ends the template.
        """
        call = pickle.dumps((function, arguments, os.getcwd()))
        with self._lock:
            if self._warm.get(call) == stamp and self._template and self._template.poll() is None:
                return
            if call in self._warm and self._warm[call] != stamp:
                self.close()
            known = dict(self._warm)
            try:
                self._ask((child.WARM, call), WARM_LIMIT, stop=stop)
            except Lost:  # the call took the template along; the job that makes it again will tell
                known.pop(call, None)
            self._warm = known | {call: stamp}

    def _ask(
        self,
        request: Any,
        limit: float,
        handles: tuple[int, ...] = (),
        stop: Callable[[], object] = lambda: None,
    ) -> Any:
        control, until = self._started(), time.monotonic() + limit
        try:
            control.settimeout(limit)
            child.send(control, request, handles)
            while not select.select([control], [], [], SLICE)[0]:
                if stop() or time.monotonic() > until:
                    raise TimeoutError
            return child.receive(control)[0]
        except (OSError, EOFError) as error:  # TimeoutError is one
            self.close()
            raise Lost from error

    def _started(self) -> socket.socket:
        if self._control is not None and self._template is not None and self._template.poll() is None:
            return self._control
        self.close()
        mine, theirs = socket.socketpair()
        environment = os.environ | {name: os.environ.get(name, "1") for name in THREADS}
        try:
            self._template = subprocess.Popen(
                child.command(theirs.fileno()),
                pass_fds=(theirs.fileno(),),
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                start_new_session=True,  # a terminal's signals are for this process, which then ends its workers
            )
        except OSError as error:
            mine.close()
            raise UserError(f"worker processes cannot be started: {error.strerror}") from error
        finally:
            theirs.close()
        self._control = mine
        return mine

    def close(self) -> None:
        """End the template and all its workers."""
        with self._lock:
            if self._control is not None:
                self._control.close()
            if self._template is not None:
                try:
                    self._template.wait(timeout=ENDING)
                except subprocess.TimeoutExpired:
                    self._template.kill()
                    self._template.wait()
            self._control = self._template = None
            self._warm = {}


@functools.cache
def nursery() -> Nursery:
    """The nursery of this process."""
    found = Nursery()
    atexit.register(found.close)
    return found


if hasattr(os, "register_at_fork"):  # a template and its workers belong to the process that started them
    os.register_at_fork(after_in_child=nursery.cache_clear)
