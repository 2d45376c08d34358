"""Run a plan: ask what is missing, run it, keep each result, ask again.

What to run next follows from the plan and the results there are, never from anything remembered, so a
campaign goes on after a kill as it would have without.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import Any, Self

from sim.errors import UserError
from sim.runner import cores
from sim.trials.plan import CertificateStudy, MarginStudy, Plan, ReliabilityStudy
from sim.trials.plan.limits import limits_of
from sim.trials.plan.margin import next_positions
from sim.trials.plan.plan import differences
from sim.trials.run import workers as pools
from sim.trials.run.folder import FILE, LOGS, locked, set_aside
from sim.trials.run.origin import origin, origin_differences
from sim.trials.run.replay import Replays
from sim.trials.run.result import TrialResult
from sim.trials.run.store import Counts, Store

CHANGE_NO_RESULT = ("wall_limit", "retries", "logs", "log_every", "description", "limits")
"""Settings of a plan that may change while its campaign goes on."""

MOST_DIFFERENCES = 5  # shown when a plan has changed

Stop = Callable[[], str | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """How far a campaign is.

    Attributes:
        done: Trials with a result, of all controllers.
        known: Trials known to be needed; margin studies find more as they go.
        new: Results since this call began.
        counts: How the results ended, by controller.
    """

    done: int
    known: int
    new: int
    counts: dict[str, Counts]


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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.store.close()

    def _repr_html_(self) -> str:
        """How many walked and fell, for a notebook."""
        counted: dict[tuple[str, str], list[int]] = {}
        for result in self:
            row = counted.setdefault((result.study, result.controller), [0, 0, 0])
            row[0 if result.survived else 1 if result.known else 2] += 1
        head = "".join(f"<th>{name}</th>" for name in ("study", "controller", "walked", "fell", "without a result"))
        rows = (
            "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in (*names, *counts)) + "</tr>"
            for names, counts in counted.items()
        )
        return (
            f"<p>{escape(self.plan.name)} {escape(self.interrupted)}</p><table><tr>{head}</tr>{''.join(rows)}</table>"
        )

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


def pending(plan: Plan, store: Store, replays: Replays | None = None) -> list[pools.Id]:
    """What can be run now; empty when the plan is complete.

    Args:
        plan: The plan.
        store: Its results.
        replays: Of this plan and store, kept from the last time to save going through all answers again.
    """
    done = store.done()
    found: list[pools.Id] = []
    replays = replays or Replays(plan, store)
    for start, study in plan.offsets():
        if isinstance(study, ReliabilityStudy | CertificateStudy):
            found += [trial for c in plan.controllers for trial in replays.missing(study, start, c)]
            continue
        if isinstance(study, MarginStudy):
            wanted = [(c, index) for c in plan.controllers for index in _next_of_margin(study, start, c, store)]
        else:
            wanted = [(c, index) for c in plan.controllers for index in range(start, start + study.size)]
        found += [trial for trial in wanted if trial not in done]
    return sorted(found, key=lambda trial: (trial[1], trial[0]))


def _next_of_margin(study: MarginStudy, start: int, controller: str, store: Store) -> list[int]:
    found: dict[int, None] = {}

    def known(first: int, end: int) -> Iterator[tuple[int, bool]]:
        survivals = store.survivals(controller, start + first, start + end)
        return ((index - start, ok) for index, ok in survivals.items())

    for number, axis in enumerate(study.axes):
        fates = study.by_position(number, known)
        survived = {position: all(oks) for position, oks in fates.items() if len(oks) == study.draws}
        for side in (-1, 1):
            for position in next_positions(axis, side, survived):
                first = start + study.first_index(number) + position
                found |= dict.fromkeys(first + draw * study.lattice for draw in range(study.draws))
    return list(found)


def run_plan(
    plan: Plan,
    out: Path | str | None = None,
    *,
    workers: int | None = None,
    client: Any = None,
    restart: bool = False,
    mix: bool = False,
    retry: Sequence[str] = (),
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
        mix: Whether to add to results found with other versions, sources or files.
        retry: Outcomes of trials to try again, their rows forgotten.
        report: Told after each result.
        stop: Asked a few times a second; a reason ends the campaign early.

    Raises:
        UserError: the folder holds results of a different plan, or found with something else; it cannot be written; the
            plan's limits are of another walker.
    """
    if workers is not None and workers < 1:
        raise UserError(f"--workers = {workers}: must be 1 or above")
    if plan.limits and not retry:
        limits_of(plan.limits, plan.scenario)
    folder = Path(out).absolute() if out is not None else None
    campaign = pools.Campaign.of(plan, folder)
    execute = pools.cluster(campaign, client) if client is not None else pools.local(campaign, workers or cores())
    if folder is None:
        return _run(plan, Store(None, write=True), execute, report, stop)
    with locked(folder):
        if restart:
            set_aside(folder)
        store = Store(folder / FILE, write=True)
        try:
            plan = _agreed(plan, store, folder)
            if retry:
                store.forget(retry)
            if not mix:
                _check_origins(plan, store, folder, machine=client is None)
            for left_over in (folder / LOGS).glob("*.partial"):
                left_over.unlink()
            return _run(plan, store, execute, report, stop)
        except BaseException:
            store.close()
            raise


def _agreed(plan: Plan, store: Store, folder: Path) -> Plan:
    """The plan to run on a store: the one given, with the pairs of axes that have been added to its studies.

    Raises:
        UserError: the store holds results of a plan that differs.
    """
    there = store.plan()
    if there is not None and _only_more_pairs(there, plan):
        store.set_plan(plan)
        return plan
    if there is not None and _only_more_pairs(plan, there):
        return replace(plan, reliability=there.reliability)
    changed = differences(there, plan) if there is not None else []
    changed = [line for line in changed if line.partition(":")[0] not in CHANGE_NO_RESULT]
    if not changed:
        return plan
    raise UserError(
        f"--out {folder}: holds results of a plan that differs: {_some(changed)}. "
        "Use another folder, or --restart, which keeps them as a backup"
    )


def _only_more_pairs(there: Plan, plan: Plan) -> bool:
    """Whether a plan is another with more pairs of axes at the end of its studies' own, which they come to last."""
    if len(there.reliability) != len(plan.reliability):
        return False
    both = list(zip(there.reliability, plan.reliability, strict=True))
    more = all(new.pairs[: len(old.pairs)] == old.pairs for old, new in both)
    alike = replace(plan, reliability=tuple(replace(new, pairs=old.pairs) for old, new in both))
    changed = {line.partition(":")[0] for line in differences(there, alike)}
    return more and alike.reliability != plan.reliability and changed <= {*CHANGE_NO_RESULT}


def _check_origins(plan: Plan, store: Store, folder: Path, *, machine: bool) -> None:
    """Refuse to add to results that were found with something else."""
    for controller in plan.controllers:
        here = origin(plan.scenario, controller)
        for there in store.origins_of(controller):
            changed = origin_differences(there, here, machine=machine)
            if changed:
                raise UserError(
                    f"--out {folder}: holds results of {controller} found with something else: {_some(changed)}. "
                    "Use another folder, --restart, which keeps them as a backup, or --mix, which adds to them"
                )


def _some(changed: list[str]) -> str:
    more = f"; and {len(changed) - MOST_DIFFERENCES} more" if len(changed) > MOST_DIFFERENCES else ""
    return "; ".join(changed[:MOST_DIFFERENCES]) + more


def _run(plan: Plan, store: Store, execute: pools.Execute, report: Report | None, stop: Stop | None) -> Results:
    if store.plan() is None:
        store.set_plan(plan)
    reason: str | None = None
    new = 0

    def ask() -> str | None:
        nonlocal reason
        reason = reason or (stop() if stop else None)
        return reason

    replays = Replays(plan, store)
    while (missing := pending(plan, store, replays)) and not ask():
        counts = store.counts()
        done = sum(one.done for one in counts.values())
        known = done + len(missing)
        for result, facts in execute(missing, ask):
            store.add(result, facts)
            new, done = new + 1, done + 1
            before = counts.get(result.controller, Counts())
            counts[result.controller] = Counts(
                survived=before.survived + result.survived, known=before.known + result.known, done=before.done + 1
            )
            if report:
                report(Progress(done=done, known=known, new=new, counts=dict(counts)))
    return Results(plan=plan, store=store, interrupted=reason or "")
