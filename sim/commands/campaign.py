"""What the actions of `cmpc trials` share: run a campaign, show how far it is, write its pages."""

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from controller.common import outside
from controller.common.settings import BUILT_IN
from sim.commands.options import add_quiet
from sim.errors import UserError
from sim.settings import flags
from sim.terminal.console import next_step

if TYPE_CHECKING:
    from sim.terminal.progress import Update
    from sim.trials.plan import Plan
    from sim.trials.run import Results
    from sim.trials.run.campaign import Progress, Report
    from sim.trials.run.store import Counts


def add_running(parser: flags.Parser) -> None:
    """Add the options of whatever runs a campaign."""
    text = "processes on this machine (default: one a core)"
    parser.add_argument("--workers", type=flags.whole(1), metavar="INT", help=text)
    parser.add_argument("--cluster", metavar="tcp://HOST:PORT", help="run on the Dask cluster of this scheduler")
    parser.add_argument("--mix", action="store_true", help="add to results of other versions, sources or files")
    add_quiet(parser)


def run_campaign(plan: "Plan", out: Path, found: Namespace, *, restart: bool = False, retry: Sequence[str] = ()) -> int:
    """Run what is missing of a plan, and write its pages; the exit code.

    Args:
        plan: The plan.
        out: Folder of the results.
        found: The options of `add_running`.
        restart: Whether to begin anew.
        retry: Outcomes of trials to try again.

    Raises:
        UserError: as `sim.trials.run.run_plan`, or --workers and --cluster are both given.
    """
    from sim.terminal.interrupt import stop_on_signal
    from sim.terminal.progress import progress_bar
    from sim.trials.run import run_plan

    if found.workers is not None and found.cluster is not None:
        raise UserError("--workers and --cluster: must be one of them; a cluster brings its own workers")
    client = None
    if found.cluster is not None:
        from sim.trials.run.workers import connect

        client = connect(found.cluster)
    try:
        with stop_on_signal() as stop, progress_bar(plan.name, "trials", quiet=found.quiet) as update:
            results = run_plan(
                plan,
                out,
                workers=found.workers,
                client=client,
                restart=restart,
                mix=found.mix,
                retry=retry,
                report=_reporter(update) if update else None,
                stop=stop,
            )
    finally:
        if client is not None:
            client.close()
    if results.interrupted:
        print(f"{results.interrupted}; the same command goes on from here", file=sys.stderr)
        results.store.close()
        return 128 + stop.signum
    write_pages(results, out)
    results.store.close()
    return 0


def _reporter(update: "Update") -> "Report":
    def report(progress: "Progress") -> None:
        survived = ", ".join(_counted(name, counts) for name, counts in sorted(progress.counts.items()))
        update(progress.done, progress.known, f"survived: {survived}")

    return report


def _counted(name: str, counts: "Counts") -> str:
    unknown = f" ({counts.unknown} without a result)" if counts.unknown else ""
    return f"{name} {counts.survived}/{counts.known}{unknown}"


def kinds_of(text: str) -> tuple[str, ...]:
    """Kinds of controller from text with commas between them, or "all".

    Raises:
        UserError: one is not known, given twice, or there is none.
    """
    kinds = BUILT_IN if text == "all" else tuple(word.strip() for word in text.split(","))
    for kind in kinds:
        if kind not in BUILT_IN and not outside.is_named(kind):
            guess = flags.nearest(kind, BUILT_IN)
            raise UserError(
                f"--controllers {text}: no controller {kind!r}; {guess}must be all, or of {', '.join(BUILT_IN)}, "
                f"or {outside.LEGAL}"
            )
        if kinds.count(kind) > 1:
            raise UserError(f"--controllers {text}: {kind} is given twice; must be once each")
    return tuple(kinds)


def write_pages(results: "Results", out: Path) -> None:
    """Write the pages of results and print what they come to.

    Raises:
        UserError: the folder cannot be written.
    """
    from sim.trials.report.report import write_report
    from sim.trials.report.summary import summarise

    page = write_report(results, out)
    print(summarise(results))
    print(f"page: {page}")
    fallen = next((result for result in results if result.fell), None)
    if fallen is not None:
        trial = f"{out}#{fallen.controller}/{fallen.trial}"
        next_step(f"cmpc run --from-trial {trial}", "one that fell, with its log")
