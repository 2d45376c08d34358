"""Run a plan: ask what is missing, run it, keep each result, ask again.

What to run next follows from the plan and the results there are, never from anything remembered, so a
campaign goes on after a kill as it would have without.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim.errors import UserError
from sim.log import provenance
from sim.trials.plan import MarginStudy, Plan
from sim.trials.plan.margin import next_positions
from sim.trials.plan.plan import differences
from sim.trials.run import workers as pools
from sim.trials.run.result import TrialResult
from sim.trials.run.store import FILE, LOGS, Store, locked, set_aside
from sim.trials.run.trial import TrialSpec

MOST_DIFFERENCES = 5  # shown when a plan has changed
MOST_CRASHES = 3  # times in a row a pool of processes may break

Stop = Callable[[], str | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """How far a campaign is.

    Attributes:
        done: Trials with a result, of all controllers.
        known: Trials known to be needed; margin studies find more as they go.
        new: Results since this call began.
        survived: (survived, done) by controller.
    """

    done: int
    known: int
    new: int
    survived: dict[str, tuple[int, int]]


Report = Callable[[Progress], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Results:
    """Results of a plan.

    Attributes:
        plan: The plan.
        store: Where the results are.
        interrupted: Why the campaign stopped early, empty if it is complete.
    """

    plan: Plan
    store: Store
    interrupted: str = ""

    def __iter__(self) -> Iterator[TrialResult]:
        """Results in order of controller and trial."""
        return self.store.results()

    def frame(self) -> Any:
        """The results as a pandas DataFrame, with a column for each axis, "axis: name".

        Raises:
            UserError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise UserError("a data frame needs pandas; install cmpc-walker[frame]") from error
        import dataclasses

        rows = [
            dataclasses.asdict(result) | {f"axis: {name}": value for name, value in result.axis_values.items()}
            for result in self
        ]
        return pandas.DataFrame(rows)


def pending(plan: Plan, store: Store) -> list[tuple[str, int]]:
    """(controller, trial) of what can be run now; empty when the plan is complete."""
    done = store.done()
    found = []
    for start, study in plan.offsets():
        if isinstance(study, MarginStudy):
            wanted = [(c, index) for c in plan.controllers for index in _next_of_margin(study, start, c, store)]
        else:
            wanted = [(c, index) for c in plan.controllers for index in range(start, start + study.size)]
        found += [trial for trial in wanted if trial not in done]
    return sorted(found, key=lambda trial: (trial[1], trial[0]))


def _next_of_margin(study: MarginStudy, start: int, controller: str, store: Store) -> list[int]:
    found: dict[int, None] = {}
    for number, axis in enumerate(study.axes):
        low, high = axis.ends
        zero = start + study.first_index(number)
        survivals = store.survivals(controller, zero + low, zero + high + 1)
        survived = {index - zero: ok for index, ok in survivals.items()}
        for side in (-1, 1):
            found |= dict.fromkeys(zero + position for position in next_positions(axis, side, survived))
    return list(found)


def run_plan(
    plan: Plan,
    out: Path | str | None = None,
    *,
    workers: int | None = None,
    client: Any = None,
    restart: bool = False,
    report: Report | None = None,
    stop: Stop | None = None,
) -> Results:
    """Run a plan, or what is left of it.

    Args:
        plan: The plan.
        out: Folder of the results, made if missing; None keeps them in memory.
        workers: Processes on this machine; one a core by default.
        client: A `distributed.Client`, to run on its cluster instead.
        restart: Whether to set results of another plan aside instead of refusing.
        report: Told after each result.
        stop: Asked after each result; a reason ends the campaign early.

    Raises:
        UserError: the folder holds results of a different plan, or cannot be written.
    """
    if workers is not None and workers < 1:
        raise UserError(f"--workers = {workers}: must be 1 or above")
    execute = pools.cluster(client) if client is not None else pools.local(workers or cores())
    if out is None:
        store = Store(None, write=True)
        return _run(plan, store, None, execute, report, stop)
    folder = Path(out).absolute()
    with locked(folder):
        if restart:
            set_aside(folder)
        store = Store(folder / FILE, write=True)
        try:
            _check_plan(plan, store, folder)
            logs = folder / LOGS
            for left_over in logs.glob("*.partial"):
                left_over.unlink()
            return _run(plan, store, logs, execute, report, stop)
        except BaseException:
            store.close()
            raise


def cores() -> int:
    """Processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _check_plan(plan: Plan, store: Store, folder: Path) -> None:
    there = store.plan()
    if there is None or there == plan:
        return
    changed = differences(there, plan)
    more = f"; and {len(changed) - MOST_DIFFERENCES} more" if len(changed) > MOST_DIFFERENCES else ""
    raise UserError(
        f"--out {folder}: holds results of a plan that differs: {'; '.join(changed[:MOST_DIFFERENCES])}{more}. "
        "Use another folder, or --restart, which keeps them as a backup"
    )


def _run(
    plan: Plan, store: Store, logs: Path | None, execute: pools.Execute, report: Report | None, stop: Stop | None
) -> Results:
    if store.plan() is None:
        store.set_plan(plan, provenance.package_versions())
    crashes = new = 0
    while missing := pending(plan, store):
        counts = store.counts()
        done = sum(number for _, number in counts.values())
        known = done + len(missing)
        specs = (
            TrialSpec(plan=plan, controller=controller, index=index, logs=str(logs) if logs else None)
            for controller, index in missing
        )
        try:
            for result in execute(specs):
                store.add(result)
                new, done, crashes = new + 1, done + 1, 0
                survived, number = counts.get(result.controller, (0, 0))
                counts[result.controller] = (survived + result.survived, number + 1)
                if report:
                    report(Progress(done=done, known=known, new=new, survived=dict(counts)))
                reason = stop() if stop else None
                if reason:
                    return Results(plan=plan, store=store, interrupted=reason)
        except RuntimeError as error:  # loky's TerminatedWorkerError is one
            crashes += 1
            if not _is_crash(error) or crashes > MOST_CRASHES:
                raise
    return Results(plan=plan, store=store)


def _is_crash(error: Exception) -> bool:
    """Whether a worker process died, by the hand of the system or of a user."""
    return type(error).__name__ in ("TerminatedWorkerError", "BrokenProcessPool")
