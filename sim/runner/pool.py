"""A pool of worker processes, each of which can be killed without harm to the others.

A worker has its next job at hand while it does one, so that it never waits for this process. Jobs come back in order,
so the first without an answer is the one that a dying worker was at: it is suspect, and is done again alone, those
behind it are innocent and go to other workers.
"""

import collections
import contextlib
import dataclasses
import os
import pickle
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from multiprocessing.connection import Connection, wait
from typing import Any, Self

from sim.errors import UserError
from sim.runner.nursery import ENDING, nursery

AT_HAND = 2  # jobs of a worker, the one it is at included
AHEAD = 1 << 14  # [B] an argument that is sent ahead; it lies in the socket while the worker sends a long result
SLICE = 0.1  # [s] between looks at the clock
PREPARE_LIMIT = 600.0  # [s] for what a job needs before its own clock starts, such as compiling
MOST_LOST = 5  # workers in a row that may end before they are ready, before no more are started


class Ended(Enum):
    """How a job ended."""

    DONE = "done"
    RAISED = "raised"
    CRASHED = "crashed"
    HUNG = "hung"


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """The end of a job.

    Attributes:
        argument: What the job was given.
        how: How it ended.
        value: What it returned.
        message: What went wrong, in a line.
        detail: The traceback of an exception.
    """

    argument: Any
    how: Ended
    value: Any = None
    message: str = ""
    detail: str = ""


@dataclass(slots=True, kw_only=True, eq=False)
class _Job:
    argument: Any
    crashes: int = 0
    sent: bool = False


@dataclass(slots=True, kw_only=True, eq=False)
class _Worker:
    pid: int
    made_by: int
    link: Connection
    jobs: collections.deque[_Job] = dataclasses.field(default_factory=collections.deque)
    since: float = 0.0  # [s], when it began what it is at
    ready: bool = False
    started: bool = False
    alone: bool = False


class Pool:
    """Worker processes that apply one function to many arguments."""

    def __init__(
        self,
        function: Callable[[Any, Any], Any],
        context: Any = None,
        *,
        workers: int,
        deadline: float | None = None,
        retries: int = 2,
        prepare: Callable[[Any, Any], None] | None = None,
        log: str | None = None,
    ) -> None:
        """Start nothing yet.

        Args:
            function: Called as function(context, argument) in a worker; a module's own, found there by its name.
            context: Sent to each worker once.
            workers: Number of processes, 1 or more.
            deadline: Longest time of a job in [s] before its worker is killed; None for no limit.
            retries: How often a job that took its worker along is tried again, alone.
            prepare: Called before the function; its time does not count, within `PREPARE_LIMIT`.
            log: File that takes what workers print.
        """
        self._head = pickle.dumps((function, prepare, context))
        self._number, self._deadline, self._retries, self._log = workers, deadline, retries, log
        self._workers: list[_Worker] = []
        self._lost = 0

    def run(self, arguments: Iterable[Any], stop: Callable[[], object] = lambda: None) -> Iterator[End]:
        """Do jobs, in any order.

        Args:
            arguments: One for each job; taken as they are needed.
            stop: Asked ten times a second; anything true ends the run, and the jobs that are running.

        Raises:
            UserError: no worker can be started.
        """
        queue = iter(arguments)
        again: collections.deque[_Job] = collections.deque()  # innocent
        suspects: collections.deque[_Job] = collections.deque()
        finished = False
        try:
            while not stop():
                for worker in self._ready(again, suspects, finished):
                    room = 0 if worker.alone else AT_HAND - len(worker.jobs)
                    for _ in range(room):
                        job = again.popleft() if again else None
                        if job is None and not finished:
                            job = next((_Job(argument=one) for one in queue), None)
                            finished = job is None
                        if job is None:
                            break
                        self._give(worker, job)
                    if finished and not again and suspects and not worker.jobs:
                        worker.alone = True
                        self._give(worker, suspects.popleft())
                busy = [worker for worker in self._workers if worker.jobs]
                if not busy and finished and not again and not suspects:
                    return
                yield from self._collect(busy, again, suspects)
        finally:
            if any(worker.jobs for worker in self._workers):
                self.close()

    def _ready(
        self, again: collections.deque[_Job], suspects: collections.deque[_Job], finished: bool
    ) -> list[_Worker]:
        """Workers in order of what they have at hand, new ones among them while there is work for them."""
        wanted = self._number if not finished else min(self._number, len(self._busy()) + len(again) + len(suspects))
        while len(self._workers) < wanted:
            self._workers.append(self._new())
        return sorted(self._workers, key=lambda worker: len(worker.jobs))

    def _busy(self) -> list[_Worker]:
        return [worker for worker in self._workers if worker.jobs]

    def _new(self) -> _Worker:
        if self._lost > MOST_LOST:
            raise UserError(f"{self._lost} worker processes in a row ended before they were ready")
        pid, socket, made_by = nursery().spawn(self._log)
        worker = _Worker(pid=pid, made_by=made_by, link=Connection(socket.detach()))
        with contextlib.suppress(OSError):
            worker.link.send_bytes(self._head)
        return worker

    def _give(self, worker: _Worker, job: _Job) -> None:
        job.sent = False
        worker.jobs.append(job)
        self._send(worker)

    @staticmethod
    def _send(worker: _Worker) -> None:
        """Send what the worker may have: its first job, and the next where its argument is short.

        A worker that is sending a long result reads nothing: a long argument sent then would hold both for ever.
        """
        for place, job in enumerate(worker.jobs):
            if job.sent:
                continue
            argument = pickle.dumps(job.argument)
            if place and len(argument) > AHEAD:
                return
            if not place:
                worker.since, worker.started = time.monotonic(), False
            job.sent = True
            with contextlib.suppress(OSError):  # it is dead, as its other end will tell
                worker.link.send_bytes(argument)

    def _collect(
        self, busy: list[_Worker], again: collections.deque[_Job], suspects: collections.deque[_Job]
    ) -> Iterator[End]:
        by_link = {worker.link: worker for worker in busy}
        for link in wait(list(by_link), timeout=SLICE):
            worker = by_link[link]  # type: ignore[index]
            try:
                kind, value = worker.link.recv()
            except (EOFError, OSError, pickle.UnpicklingError):
                yield from self._buried(worker, again, suspects)
                continue
            if kind == "ready":
                worker.ready, self._lost = True, 0
                continue
            if kind == "started":
                worker.since, worker.started = time.monotonic(), True
                continue
            job = worker.jobs.popleft()
            worker.since, worker.started, worker.alone = time.monotonic(), False, False
            self._send(worker)
            if kind == "done":
                yield End(argument=job.argument, how=Ended.DONE, value=value)
                continue
            users, message, detail = value
            if users:
                raise UserError(message)
            yield End(argument=job.argument, how=Ended.RAISED, message=message, detail=detail)
        now = time.monotonic()
        for worker in [worker for worker in busy if worker in self._workers and worker.jobs]:
            limit = self._deadline if worker.started else PREPARE_LIMIT
            if limit is not None and now - worker.since > limit and not worker.link.poll():
                job = worker.jobs.popleft()
                again.extendleft(reversed(worker.jobs))
                self._remove(worker, 0.0)
                what = "" if worker.started else " before its clock started"
                yield End(argument=job.argument, how=Ended.HUNG, message=f"killed after {limit:g} s of wall time{what}")

    def _buried(
        self, worker: _Worker, again: collections.deque[_Job], suspects: collections.deque[_Job]
    ) -> Iterator[End]:
        """Sort the jobs of a dead worker: one is suspect, the others innocent."""
        suspect, code = worker.jobs.popleft(), self._remove(worker, ENDING)
        again.extendleft(reversed(worker.jobs))
        self._lost += not worker.ready
        suspect.crashes += 1
        if suspect.crashes <= self._retries:
            suspects.append(suspect)
            return
        times = f"{suspect.crashes} times" if suspect.crashes > 1 else "once"
        yield End(
            argument=suspect.argument,
            how=Ended.CRASHED,
            message=f"ended its process {times}, the last time by {_cause_of_death(code)}",
        )

    def _remove(self, worker: _Worker, grace: float) -> int | None:
        self._workers.remove(worker)
        worker.link.close()
        return nursery().reap(worker.pid, worker.made_by, grace)

    def close(self) -> None:
        """End all workers at once, whatever they are at."""
        until = time.monotonic() + ENDING
        for worker in self._workers:
            worker.link.close()
        for worker in list(self._workers):
            self._remove(worker, 0.0 if worker.jobs else max(0.0, until - time.monotonic()))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def cores() -> int:
    """Processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _cause_of_death(code: int | None) -> str:
    if code is None:
        return "an unknown cause"
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"
