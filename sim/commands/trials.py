"""`cmpc trials`: run a plan of many trials, look at one of them, rebuild the page."""

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sim import flags
from sim.errors import UserError

if TYPE_CHECKING:
    from sim.trials.campaign import Results

EPILOG = """\
also:
  cmpc trials --list                    the plans that come with the program
  cmpc trials show DIR --trial ID       one trial and its figures; ID is CONTROLLER/NUMBER
  cmpc trials report DIR                write the page, the table and the plots again
  cmpc run --from-trial DIR#ID          run one trial again, with its full log

A campaign that was stopped or killed goes on when the same command is given again.

exit code: 0 complete, 2 bad input, 130 and 143 interrupted by Ctrl-C and SIGTERM
"""


def main(argv: Sequence[str]) -> int:
    """Run `cmpc trials`; returns the exit code."""
    if argv and argv[0] == "show":
        return _show(argv[1:])
    if argv and argv[0] == "report":
        return _report(argv[1:])
    parser = _parser()
    found = parser.parse(argv)
    if found.help:
        parser.print_help()
        return 0
    if found.list:
        _print_list()
        return 0
    if found.plan is None or found.out is None:
        raise UserError("cmpc trials needs a plan and --out DIR; see cmpc trials --help, or --list for plans")
    return _run(found)


def _parser() -> flags.Parser:
    parser = flags.Parser(
        prog="cmpc trials",
        usage="cmpc trials PLAN|FILE.toml --out DIR [options]",
        description="Run the trials of a plan and leave a database, a table, plots and a page in DIR.",
        epilog=EPILOG,
    )
    parser.add_argument("plan", nargs="?", metavar="PLAN|FILE.toml", help="a shipped plan or a plan file")
    own = parser.add_argument_group("options")
    own.add_argument("-h", "--help", action="store_true", help="show the options")
    own.add_argument("--list", action="store_true", help="list the shipped plans")
    own.add_argument("--out", metavar="DIR", help="folder of the results, made if missing")
    own.add_argument("--workers", type=int, metavar="INT", help="processes on this machine (default: one a core)")
    own.add_argument("--cluster", metavar="tcp://HOST:PORT", help="run on the Dask cluster of this scheduler")
    own.add_argument("--restart", action="store_true", help="begin anew; keep what is there in a backup folder")
    own.add_argument("--quiet", action="store_true", help="show no progress")
    return parser


def _print_list() -> None:
    from sim.trials.plan import load_plan, shipped_names

    for name in shipped_names():
        print(f"{name:<16}{load_plan(name).description}")


def _run(found: Namespace) -> int:
    from sim.interrupt import stop_on_signal
    from sim.trials.campaign import run_plan
    from sim.trials.plan import load_plan
    from sim.trials.progress import show_progress

    if found.workers is not None and found.cluster is not None:
        raise UserError("--workers and --cluster: must be one of them; a cluster brings its own workers")
    plan, out = load_plan(found.plan), Path(found.out)
    client = None
    if found.cluster is not None:
        from sim.trials.workers import connect

        client = connect(found.cluster)
    try:
        with stop_on_signal() as stop, show_progress(plan.name, quiet=found.quiet) as report:
            results = run_plan(
                plan,
                out,
                workers=found.workers,
                client=client,
                restart=found.restart,
                report=report,
                stop=stop,
            )
    finally:
        if client is not None:
            client.close()
    if results.interrupted:
        print(f"{results.interrupted}; the same command goes on from here", file=sys.stderr)
        results.store.close()
        return 128 + stop.signum if stop.signum else 1
    _finish(results, out)
    results.store.close()
    return 0


def _finish(results: "Results", out: Path) -> None:
    from sim.trials.report import write_report
    from sim.trials.summary import summarise

    page = write_report(results, out)
    print(summarise(results))
    print(f"page: {page}")


def _open(folder: str) -> "Results":
    from sim.trials.campaign import Results
    from sim.trials.recall import open_results

    plan, store = open_results(folder)
    return Results(plan=plan, store=store)


def _report(argv: Sequence[str]) -> int:
    parser = flags.Parser(prog="cmpc trials report", usage="cmpc trials report DIR")
    parser.add_argument("folder", metavar="DIR")
    folder = parser.parse(argv).folder
    _finish(_open(folder), Path(folder))
    return 0


def _show(argv: Sequence[str]) -> int:
    parser = flags.Parser(prog="cmpc trials show", usage="cmpc trials show DIR --trial ID")
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument("--trial", metavar="CONTROLLER/NUMBER", required=True)
    found = parser.parse(argv)

    from sim.trials.recall import stored_trial
    from sim.trials.summary import describe

    result = stored_trial(found.folder, found.trial)
    print(describe(result))
    print(f"again: cmpc run --from-trial {found.folder}#{found.trial}")
    return 0
