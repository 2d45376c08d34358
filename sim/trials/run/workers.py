"""Where trials run: in this process, on this machine's cores, or on a Dask cluster; the results are the same."""

import functools
import itertools
import json
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from sim.errors import UserError
from sim.log import provenance
from sim.trials.run.result import TrialResult
from sim.trials.run.trial import (
    LONGEST_MESSAGE,
    TrialSpec,
    axis_values,
    run_trial,
    trial_seed,
    work,
)

Execute = Callable[[Iterable[TrialSpec]], Iterator[TrialResult]]
"""Runs trials and yields their results in any order."""

CONNECT_TIMEOUT = 10.0  # [s]
LOOK_FOR_PARENT = 1.0  # [s]
IN_FLIGHT = 3  # trials a worker thread of a cluster has at hand
RESTARTS = 3  # times a trial may take its worker with it before it counts as an error


def here(specs: Iterable[TrialSpec]) -> Iterator[TrialResult]:
    """Run trials one by one in this process."""
    return map(run_trial, specs)


def local(workers: int) -> Execute:
    """Run trials in `workers` processes of this machine; one runs in this process.

    Args:
        workers: Number of processes, 1 or more.
    """
    if workers == 1:
        return here

    parent = os.getpid()

    def execute(specs: Iterable[TrialSpec]) -> Iterator[TrialResult]:
        from joblib import Parallel, delayed, parallel_config

        with parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1):
            pool = Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="3*n_jobs")
        yield from pool(delayed(_work_for)(parent, spec) for spec in specs)

    return execute


def _work_for(parent: int, spec: TrialSpec) -> TrialResult:
    """A trial in a process of this machine, which goes when its parent does: a killed campaign leaves none."""
    _follow(parent)
    return work(spec)


@functools.cache
def _follow(parent: int) -> None:
    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK_FOR_PARENT)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def connect(address: str) -> Any:
    """A client of the Dask scheduler at an address such as "tcp://host:8786".

    Raises:
        UserError: Dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise UserError("--cluster: needs Dask; install cmpc-walker[cluster]") from error
    try:
        client: Any = Client(address, timeout=CONNECT_TIMEOUT)
    except (OSError, ValueError, TimeoutError) as error:
        raise UserError(
            f"--cluster {address}: no scheduler answers within {CONNECT_TIMEOUT:g} s; must be tcp://HOST:PORT"
        ) from error
    return client


def cluster(client: Any) -> Execute:
    """Run trials on a Dask cluster.

    A worker that dies takes its trials with it; Dask runs them again elsewhere.

    Args:
        client: A connected `distributed.Client`.

    Raises:
        UserError: there are no workers, or their packages are not those of this process.
    """
    _check_versions(client)

    def execute(specs: Iterable[TrialSpec]) -> Iterator[TrialResult]:
        from distributed import as_completed

        queue = iter(specs)
        names: dict[str, TrialSpec] = {}

        def submit(some: Iterable[TrialSpec]) -> list[Any]:
            futures = []
            for spec in some:
                future = client.submit(work, spec, pure=False, retries=RESTARTS)
                names[future.key] = spec
                futures.append(future)
            return futures

        threads = sum(client.nthreads().values())
        running = as_completed(submit(itertools.islice(queue, IN_FLIGHT * max(1, threads))))
        for future in running:
            spec = names.pop(future.key)
            yield _result(future, spec)
            future.release()
            for more in submit(itertools.islice(queue, 1)):
                running.add(more)

    return execute


def _result(future: Any, spec: TrialSpec) -> TrialResult:
    """The result of a future; a trial that keeps killing its workers is an error of that trial."""
    error = future.exception()
    if error is None:
        found: TrialResult = future.result()
        return found
    if isinstance(error, UserError):  # a full disk
        raise error
    return failed(spec, f"{type(error).__name__}: {error}")


def failed(spec: TrialSpec, message: str) -> TrialResult:
    """Result of a trial that could not be run to any end."""
    study, values, _ = axis_values(spec.plan, spec.index)
    return TrialResult(
        controller=spec.controller,
        trial=spec.index,
        study=study,
        values=json.dumps(values),
        seed=trial_seed(spec.plan, spec.index),
        outcome="error",
        survived=False,
        message=" ".join(message.split())[:LONGEST_MESSAGE],
    )


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
