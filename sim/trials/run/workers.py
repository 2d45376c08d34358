"""Where trials run: in worker processes of this machine, or on a Dask cluster; the results are the same.

On a cluster each thread of a worker keeps a process of its own for trials, so that a trial which hangs or ends its
process is killed and tried again there as it is here, and takes no neighbour along.
"""

import itertools
import logging
import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from controller.common import outside
from controller.common.settings import BUILT_IN
from sim.errors import UserError
from sim.log import provenance
from sim.runner import End, Ended, Pool
from sim.runner.nursery import nursery
from sim.runner.tasks import PRINTED
from sim.trials.plan import Plan
from sim.trials.run.origin import origin
from sim.trials.run.result import ERROR, GAVE_UP, TrialResult
from sim.trials.run.trial import Point, TrialSpec, compile_for, result_without_run, run_trial, warm_up, what_to_compile

Stop = Callable[[], str | None]
Id = tuple[str, int] | tuple[str, int, Point]
"""Controller and number of a trial, and its point where the study asks as it learns."""

Execute = Callable[[Iterable[Id], Stop], Iterator[tuple[TrialResult, str]]]
"""Runs trials and yields in any order their results and what they ran with; stops when there is a reason to."""

CONNECT_TIMEOUT = 10.0  # [s]
GRACE = 1.0  # [s] a trial has beyond its wall limit to give itself up between two ticks, before it is killed
IN_FLIGHT = 3  # trials a worker thread of a cluster has at hand
RESTARTS = 5  # workers a trial may lose on a cluster before it counts as an error
SLICE = 0.2  # [s] between looks at a cluster's scheduler
GONE = "--cluster: the scheduler is gone; results so far are kept: the same command goes on"


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """What all trials of a campaign share.

    Attributes:
        plan: The plan.
        folder: Of the results; None to keep no logs.
        sources: Text of the file of each controller from outside by its kind: a worker may have another, or none.
    """

    plan: Plan
    folder: str | None
    sources: Mapping[str, bytes] = field(default_factory=dict)

    @classmethod
    def of(cls, plan: Plan, folder: Path | None) -> "Campaign":
        """The campaign of a plan, whose controllers from outside are as they stand now."""
        sources = {kind: outside.find(kind).text for kind in plan.controllers if kind not in BUILT_IN}
        return cls(plan=plan, folder=str(folder) if folder else None, sources=sources)

    def spec(self, trial: Id) -> TrialSpec:
        """One of its trials."""
        point = trial[2] if len(trial) > 2 else None
        return TrialSpec(plan=self.plan, controller=trial[0], index=trial[1], logs=self.logs, point=point)

    def arrive(self) -> None:
        """Let a worker process use the controllers from outside as they stood when the campaign began."""
        for kind, text in self.sources.items():
            outside.remember(kind, text)

    @property
    def logs(self) -> str | None:
        """Folder of its logs."""
        return f"{self.folder}/logs" if self.folder else None


def _prepare(campaign: Campaign, trial: Id) -> None:
    campaign.arrive()
    warm_up(campaign.spec(trial))


def _work(campaign: Campaign, trial: Id) -> tuple[TrialResult, str]:
    campaign.arrive()
    result = run_trial(campaign.spec(trial))
    return result, origin(campaign.plan.scenario, trial[0])


def _pool(campaign: Campaign, workers: int) -> Pool:
    return Pool(
        _work,
        campaign,
        workers=workers,
        deadline=campaign.plan.wall_limit + GRACE,
        retries=campaign.plan.retries,
        prepare=_prepare,
        log=f"{campaign.folder}/{PRINTED}" if campaign.folder else None,
    )


def _outcome(campaign: Campaign, end: End) -> tuple[TrialResult, str]:
    """The result of a trial however it ended."""
    if end.how is Ended.DONE:
        found: tuple[TrialResult, str] = end.value
        return found
    outcome = GAVE_UP if end.how is Ended.HUNG else ERROR
    row = result_without_run(campaign.spec(end.argument), outcome, end.message)
    return row, origin(campaign.plan.scenario, end.argument[0])


def local(campaign: Campaign, workers: int) -> Execute:
    """Run trials in `workers` processes of this machine, 1 or more."""

    def execute(trials: Iterable[Id], stop: Stop) -> Iterator[tuple[TrialResult, str]]:
        _warm(campaign, stop)
        with _pool(campaign, workers) as pool:
            for end in pool.run(trials, stop):
                yield _outcome(campaign, end)

    return execute


def _warm(campaign: Campaign, stop: Stop) -> None:
    """Compile and load once, for all workers to come; what is the user's own code is left to them."""
    scenario = campaign.plan.scenario
    for kind in campaign.plan.controllers:
        if not stop():
            built_in = kind if kind in BUILT_IN else "zd-pd"
            nursery().warm(compile_for, what_to_compile(scenario, kind), origin(scenario, built_in), stop)


def connect(address: str) -> Any:
    """A client of the Dask scheduler at an address such as "tcp://host:8786".

    Raises:
        UserError: Dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise UserError("--cluster: needs Dask; install cmpc-walker[cluster]") from error
    for name in ("distributed", "tornado", "asyncio", *logging.root.manager.loggerDict):
        if name.partition(".")[0] in (
            "distributed",
            "tornado",
            "asyncio",
        ):  # what goes wrong is said in one line, by us
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client: Any = Client(address, timeout=CONNECT_TIMEOUT)
    except (OSError, ValueError, TimeoutError) as error:
        raise UserError(
            f"--cluster {address}: no scheduler answers within {CONNECT_TIMEOUT:g} s; must be tcp://HOST:PORT"
        ) from error
    return client


def cluster(campaign: Campaign, client: Any) -> Execute:
    """Run trials on a Dask cluster.

    A worker that is lost takes its trials with it; they are run again elsewhere.

    Args:
        campaign: What all trials share.
        client: A connected `distributed.Client`.

    Raises:
        UserError: there are no workers, or their packages are not those of this process.
    """
    _check_versions(client)

    def execute(trials: Iterable[Id], stop: Stop) -> Iterator[tuple[TrialResult, str]]:
        waiting = iter(trials)
        ready: queue.SimpleQueue[Any] = queue.SimpleQueue()
        running: dict[str, tuple[Any, Id]] = {}
        lost: dict[Id, int] = {}

        def submit(trial: Id) -> None:
            future = client.submit(_in_a_child, campaign, trial, pure=False)
            running[future.key] = (future, trial)
            future.add_done_callback(ready.put)

        try:
            threads = sum(client.nthreads().values())
        except OSError as error:
            raise UserError(GONE) from error
        for trial in itertools.islice(waiting, IN_FLIGHT * max(1, threads)):
            submit(trial)
        seen = time.monotonic()
        try:
            while running and not stop():
                try:
                    future = ready.get(timeout=SLICE)
                except queue.Empty:
                    seen = _still_there(client, seen)
                    continue
                _, trial = running.pop(future.key)
                found = _fetched(future)
                if isinstance(found, UserError):  # a full disk
                    raise found
                if isinstance(found, BaseException):
                    seen = _still_there(client, seen)
                    lost[trial] = lost.get(trial, 0) + 1
                    if lost[trial] <= RESTARTS:
                        submit(trial)
                        continue
                    what = f"{type(found).__name__}: {found}"
                    found = End(argument=trial, how=Ended.RAISED, message=what)
                yield _outcome(campaign, found)
                for more in itertools.islice(waiting, 1):
                    submit(more)
        finally:
            _leave(client, [future for future, _ in running.values()])

    return execute


def _in_a_child(campaign: Campaign, trial: Id) -> End:
    """A trial in a process of this thread of a cluster's worker, kept for those that follow."""
    pool = getattr(_own, "pool", None)
    if pool is None or _own.campaign != campaign:
        if pool is not None:
            pool.close()
        _warm(campaign, lambda: None)
        pool = _own.pool = _pool(campaign, 1)
        _own.campaign = campaign
        with _lock:
            _pools.append(pool)
    (end,) = pool.run([trial])
    return end


_own = threading.local()
_pools: list[Pool] = []
_lock = threading.Lock()


def _close_children() -> None:
    """End the processes that a cluster's worker keeps for trials."""
    with _lock:
        for pool in _pools:
            pool.close()
    nursery().close()


def _leave(client: Any, futures: list[Any]) -> None:
    """Ask the cluster for nothing more, and leave no process there."""
    if client.status != "running":
        return
    try:
        client.cancel(futures)
        client.run(_close_children)
    except Exception:  # it is gone, and its processes with it
        return


def _fetched(future: Any) -> End | BaseException:
    """What came of a trial on a cluster, or why nothing did: its worker or the scheduler is gone."""
    try:
        found: End = future.result(timeout=CONNECT_TIMEOUT)
    except Exception as error:
        return error
    return found


def _still_there(client: Any, seen: float) -> float:
    """The time in [s], if the scheduler can be reached; else when it last could.

    Raises:
        UserError: it has been gone for too long.
    """
    now = time.monotonic()
    comm = getattr(client, "scheduler_comm", None)
    if client.status == "running" and not (comm is None or comm.comm.closed()):
        return now
    if client.status == "closed" or now - seen > CONNECT_TIMEOUT:
        raise UserError(GONE)
    time.sleep(SLICE)
    return seen


def _check_versions(client: Any) -> None:
    own = provenance.package_versions()
    try:
        found = client.run(provenance.package_versions)
    except Exception as error:
        raise UserError(f"--cluster: its workers cannot import this program: {error}") from error
    if not found:
        raise UserError("--cluster: the scheduler has no workers; start some with dask worker ADDRESS")
    for worker, versions in found.items():
        for name in sorted(own.keys() | versions.keys()):
            if own.get(name) != versions.get(name):
                raise UserError(
                    f"--cluster: worker {worker} has {name} {versions.get(name, 'not installed')}, this process "
                    f"{own.get(name, 'none')}; results would differ: install the same versions"
                )
