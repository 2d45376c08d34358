"""What runs in other processes: a template, which imports and compiles once, and the workers it forks.

The template runs no job. It answers one request at a time on its control socket and ends, its workers with it, when
that socket closes: whoever asked is gone, however it went. A fork of a warm template costs 10 ms; a new process with
all that a controller compiles takes seconds.
"""

import contextlib
import ctypes
import os
import pickle
import signal
import socket
import struct
import sys
import time
import traceback
import warnings
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

HEADER = struct.Struct("!I")
LONGEST_REQUEST = 1 << 26  # bytes
REAP = 0.02  # [s] between looks at a worker that is about to end
PR_SET_PDEATHSIG = 1

SPAWN, REAP_OR_KILL, WARM = "spawn", "reap", "warm"


def send(control: socket.socket, message: Any, handles: tuple[int, ...] = ()) -> None:
    """Send a message and open files over a socket."""
    data = pickle.dumps(message)
    if handles:
        socket.send_fds(control, [HEADER.pack(len(data))], list(handles))
    else:
        control.sendall(HEADER.pack(len(data)))
    control.sendall(data)


def receive(control: socket.socket) -> tuple[Any, list[int]]:
    """The next message with its files.

    Raises:
        EOFError: the other side is gone.
    """
    head, handles, _, _ = socket.recv_fds(control, HEADER.size, 1)
    if len(head) < HEADER.size:
        head += _exactly(control, HEADER.size - len(head))
    (size,) = HEADER.unpack(head)
    if size > LONGEST_REQUEST:
        raise EOFError
    return pickle.loads(_exactly(control, size)), handles


def _exactly(control: socket.socket, size: int) -> bytes:
    found = b""
    while len(found) < size:
        part = control.recv(size - len(found))
        if not part:
            raise EOFError
        found += part
    return found


def template(handle: int) -> None:
    """Serve requests until the control socket closes."""
    for signum in (signal.SIGINT, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)
    _die_with_parent()
    warnings.simplefilter("ignore")  # what solvers warn of is counted in results, and would bury the progress
    control = socket.socket(fileno=handle)
    workers: set[int] = set()
    try:
        while True:
            (kind, value), handles = receive(control)
            if kind == SPAWN:
                (work,) = handles
                pid = os.fork()
                if pid == 0:
                    control.close()
                    _worker(work, *value)
                os.close(work)
                workers.add(pid)
                send(control, pid)
            elif kind == REAP_OR_KILL:
                pid, grace = value
                send(control, _reap(pid, grace))
                workers.discard(pid)
            else:
                send(control, _warm(value))
    except (EOFError, OSError):
        pass
    finally:
        for pid in workers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
    os._exit(0)


def _reap(pid: int, grace: float) -> int:
    """Exit code of a worker, minus the signal that ended it; it is killed unless it ends within `grace` in [s]."""
    until = time.monotonic() + grace
    while True:
        found, status = os.waitpid(pid, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() >= until:
            os.kill(pid, signal.SIGKILL)
            return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        time.sleep(REAP)


def _warm(call: bytes) -> str:
    """Make a call whose traces all later workers inherit; its error is for the job that makes it again."""
    try:
        function, arguments, folder = pickle.loads(call)
        os.chdir(folder)
        function(*arguments)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def _die_with_parent() -> None:
    """Ask Linux for SIGKILL when the parent ends, should it end without closing its sockets in order."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _worker(handle: int, log: str | None, folder: str) -> None:
    """Do one job after the other in a folder until nobody asks any more; does not return."""
    try:
        _die_with_parent()
        os.chdir(folder)
        output = os.open(log or os.devnull, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        os.dup2(output, 1)
        os.dup2(output, 2)
        _serve(Connection(handle))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        os._exit(0)
    except BaseException:
        traceback.print_exc()
    os._exit(1)


def _serve(asked: Connection) -> None:
    function, prepare, context = asked.recv()
    asked.send(("ready", None))
    while True:
        argument = asked.recv()
        try:
            if prepare:
                prepare(context, argument)
            asked.send(("started", None))
            answer = ("done", function(context, argument))
        except Exception as error:
            answer = ("raised", error_words(error))
        sys.stdout.flush()
        sys.stderr.flush()
        try:
            asked.send(answer)
        except (pickle.PicklingError, TypeError, AttributeError) as error:
            asked.send(("raised", error_words(error)))


def error_words(error: BaseException) -> tuple[bool, str, str]:
    """Whether it is the user's, its message and its traceback."""
    from sim.errors import UserError

    whose = isinstance(error, UserError)
    return whose, str(error) if whose else f"{type(error).__name__}: {error}", traceback.format_exc()


def command(handle: int) -> list[str]:
    """Command line of a template, which finds the modules that this process finds."""
    here = str(Path(__file__).resolve().parents[2])
    paths = [here, *(path for path in sys.path if path != here)]
    code = f"import sys; sys.path[:] = {paths!r}; from sim.runner.child import template; template({handle})"
    return [sys.executable, "-c", code]
