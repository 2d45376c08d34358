"""`cmpc trials`: run a plan of many trials, look at one of them, rebuild the pages, measure."""

import difflib
import sys
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sim.errors import UserError
from sim.settings import flags

if TYPE_CHECKING:
    from sim.trials.run import Results

LEAST_TRIALS = 4  # of a benchmark
EPILOG = """\
also:
  cmpc trials --list                    the plans that come with the program
  cmpc trials show DIR --trial ID       one trial and its figures; ID is CONTROLLER/NUMBER
  cmpc trials report DIR                write the pages, the table and the plots again
  cmpc trials bench                     trials a second on this machine, against the targets
  cmpc run --from-trial DIR#ID          run one trial again, with its full log

A campaign that was stopped or killed goes on when the same command is given again.

exit code: 0 complete, 2 bad input, 130 and 143 interrupted by Ctrl-C and SIGTERM
"""


def main(argv: Sequence[str]) -> int:
    """Run `cmpc trials`; returns the exit code."""
    others = {"show": _show, "report": _report, "bench": _bench}
    if argv and argv[0] in others:
        return others[argv[0]](argv[1:])
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
    own.add_argument("--controllers", metavar="LIST", help="instead of the plan's: kinds with commas between, or all")
    own.add_argument("--out", metavar="DIR", help="folder of the results, made if missing")
    own.add_argument("--workers", type=int, metavar="INT", help="processes on this machine (default: one a core)")
    own.add_argument("--cluster", metavar="tcp://HOST:PORT", help="run on the Dask cluster of this scheduler")
    own.add_argument("--restart", action="store_true", help="begin anew; keep what is there in a backup folder")
    own.add_argument("--quiet", action="store_true", help="show no progress")
    return parser


def _print_list() -> None:
    from sim.trials.plan import load_plan
    from sim.trials.plan.plan import shipped_names

    for name in shipped_names():
        print(f"{name:<16}{load_plan(name).description}")


def _run(found: Namespace) -> int:
    from sim.terminal.interrupt import stop_on_signal
    from sim.trials.plan import load_plan
    from sim.trials.run import run_plan
    from sim.trials.run.progress import show_progress

    if found.workers is not None and found.cluster is not None:
        raise UserError("--workers and --cluster: must be one of them; a cluster brings its own workers")
    plan, out = load_plan(found.plan), Path(found.out)
    if found.controllers is not None:
        plan = replace(plan, controllers=_kinds(found.controllers))
    client = None
    if found.cluster is not None:
        from sim.trials.run.workers import connect

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


def _kinds(text: str) -> tuple[str, ...]:
    """Kinds of controller from text with commas between them, or "all".

    Raises:
        UserError: one is not known, given twice, or there is none.
    """
    from sim.scenario import Scenario
    from sim.settings.tree import spec_at

    legal = spec_at(Scenario(), "controller.kind").choices
    kinds = legal if text == "all" else tuple(word.strip() for word in text.split(","))
    for kind in kinds:
        if kind not in legal:
            near = difflib.get_close_matches(kind, legal, n=1)
            guess = f"did you mean {near[0]}? Legal" if near else "legal"
            raise UserError(f"--controllers {text}: no controller {kind!r}; {guess}: all, or of {', '.join(legal)}")
        if kinds.count(kind) > 1:
            raise UserError(f"--controllers {text}: {kind} is given twice; must be once each")
    return tuple(kinds)


def _finish(results: "Results", out: Path) -> None:
    from sim.trials.report.report import write_report
    from sim.trials.report.summary import summarise

    page = write_report(results, out)
    print(summarise(results))
    print(f"page: {page}")


def _sub_parser(name: str, usage: str) -> flags.Parser:
    parser = flags.Parser(prog=f"cmpc trials {name}", usage=f"cmpc trials {name} {usage}")
    # argparse's own action, which prints and leaves before it asks for what is missing
    parser.add_argument("-h", "--help", action="help", help="show this")
    return parser


def _bench(argv: Sequence[str]) -> int:
    parser = _sub_parser("bench", "[options]")
    parser.add_argument("--controllers", metavar="LIST", default="c-mpc,zd-pd", help="kinds with commas, or all")
    parser.add_argument("--trials", type=int, metavar="INT", default=40, help="trials for each figure")
    parser.add_argument("--json", action="store_true", help="print the figures as one JSON object")
    found = parser.parse(argv)
    if found.trials < LEAST_TRIALS:
        raise UserError(f"--trials = {found.trials}: must be {LEAST_TRIALS} or above")

    from sim.bench.trials import benchmark
    from sim.commands.bench import show

    kinds = _kinds(found.controllers)
    show(benchmark(kinds, found.trials, lambda line: print(line, file=sys.stderr, flush=True)), as_json=found.json)
    return 0


def _open(folder: str) -> "Results":
    from sim.trials.run import Results
    from sim.trials.run.recall import open_results

    plan, store = open_results(folder)
    return Results(plan=plan, store=store)


def _report(argv: Sequence[str]) -> int:
    parser = _sub_parser("report", "DIR")
    parser.add_argument("folder", metavar="DIR")
    folder = parser.parse(argv).folder
    _finish(_open(folder), Path(folder))
    return 0


def _show(argv: Sequence[str]) -> int:
    parser = _sub_parser("show", "DIR --trial ID")
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument("--trial", metavar="CONTROLLER/NUMBER", required=True)
    found = parser.parse(argv)

    from sim.trials.report.summary import describe
    from sim.trials.run.recall import stored_trial

    result = stored_trial(found.folder, found.trial)
    print(describe(result))
    print(f"again: cmpc run --from-trial {found.folder}#{found.trial}")
    return 0
