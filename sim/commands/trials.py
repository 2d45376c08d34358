"""`cmpc trials`: run a plan of many trials, look at one of them, rebuild the pages, measure."""

import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sim.commands import nearest
from sim.commands.campaign import add_running, kinds_of, run_campaign, write_pages
from sim.commands.options import add_json
from sim.errors import UserError
from sim.scenario import names_a_path
from sim.settings import flags
from sim.terminal.console import note

if TYPE_CHECKING:
    from sim.trials.plan import Plan
    from sim.trials.run import Results

LEAST_TRIALS = 4  # of a benchmark
OTHERS = ("numerics", "show", "report", "retry", "certify", "bench")
"""Words that are no plan but something to do."""
USAGE = "cmpc trials PLAN|FILE.toml --out DIR [options]"
DESCRIPTION = "Run the trials of a plan and leave a database, a table, plots and a page in DIR."
EPILOG = """\
also:
  cmpc trials --list                    the plans that come with the program
  cmpc trials show DIR --trial ID       one trial and its figures; ID is CONTROLLER/NUMBER
  cmpc trials report DIR                write the pages, the table and the plots again
  cmpc trials retry DIR [--errors]      try again what was given up, and what ended in an error
  cmpc trials numerics PLAN --out DIR   the same under other numerics: what depends on the simulator
  cmpc trials certify PLAN --out DIR    walk until it can be said, or refused, that falls are rarer than asked
  cmpc trials bench                     trials a second on this machine, against the targets
  cmpc run --from-trial DIR#ID          run one trial again, with its full log

A campaign that was stopped or killed goes on when the same command is given again. A trial that hangs is killed after
the plan's wall_limit, one that ends its process is tried again alone (retries); neither counts as a fall.

exit code: 0 complete, whatever the trials found; 2 bad input, a full disk, a lost cluster; 129, 130 and 143 stopped by
a lost connection, Ctrl-C and SIGTERM
"""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc trials`: of a plan, or of one of the words that are no plan."""
    others = {
        "numerics": _add_numerics,
        "show": _add_show,
        "report": _add_report,
        "bench": _add_bench,
        "certify": _add_certify,
        "retry": _add_retry,
    }
    if argv and argv[0] in others:
        actions = commands.add_parser("trials").add_subparsers()
        others[argv[0]](actions.add_parser(argv[0]))
        return
    _check_word(argv[0] if argv else "")
    parser = commands.add_parser("trials", usage=USAGE, description=DESCRIPTION, epilog=EPILOG)
    parser.set_defaults(run=_run)
    parser.add_argument("plan", nargs="?", metavar="PLAN|FILE.toml", help="a shipped plan or a plan file")
    parser.add_argument("--list", action="store_true", help="list the shipped plans")
    parser.add_argument("--controllers", metavar="LIST", help="not the plan's: kinds with commas between, or all")
    parser.add_argument("--out", metavar="DIR", help="folder of the results, made if missing")
    parser.add_argument("--restart", action="store_true", help="begin anew; keep what is there in a backup folder")
    nearest.add_checks(parser)
    add_running(parser)


def _check_word(word: str) -> None:
    """Tell a word that is nearer to something to do than to a plan before the words behind it are judged.

    Raises:
        UserError: it is.
    """
    from sim.trials.plan.plan import shipped_names

    plans = shipped_names()
    if names_a_path(word) or word in plans:
        return
    guess = flags.nearest(word, (*OTHERS, *plans))
    if any(f" {other}?" in guess for other in OTHERS):
        raise UserError(f"cmpc trials {word}: unknown; {guess}must be a plan, or {', '.join(OTHERS)}")


def _print_list() -> None:
    from sim.trials.plan import load_plan
    from sim.trials.plan.plan import shipped_names

    for name in shipped_names():
        print(f"{name:<16}{load_plan(name).description}")


def _run(found: Namespace) -> int:
    if found.list:
        _print_list()
        return 0
    if found.plan is None:
        raise UserError("cmpc trials needs a plan and --out DIR; see cmpc trials --help, or --list for plans")
    from sim.trials.plan import load_plan

    plan = load_plan(found.plan)
    if not found.out:
        raise UserError(f"cmpc trials {found.plan} needs --out DIR, a folder for its results; it is made if missing")
    if found.controllers is not None:
        plan = replace(plan, controllers=kinds_of(found.controllers))
    if found.pairs is not None:
        plan = nearest.with_pairs(plan, found.pairs, Path(found.out))
    if (found.repeat or found.check_crude) and (found.restart or (found.repeat and found.check_crude)):
        raise UserError("--repeat, --check-crude and --restart: must be one of them at a time")
    if found.repeat:
        return nearest.repeat(plan, Path(found.out), found)
    if found.check_crude:
        return nearest.check_crude(plan, Path(found.out), found)
    return run_campaign(plan, Path(found.out), found, restart=found.restart)


def _add_certify(parser: flags.Parser) -> None:
    parser.set_defaults(run=_certify)
    parser.add_argument("plan", metavar="PLAN|FILE.toml", help="a plan with a study over random axes")
    parser.add_argument("--out", metavar="DIR", required=True, help="folder of the results, made if missing")
    text = "of a fall, asked about (default: 0.001)"
    parser.add_argument("--probability", type=flags.real(), metavar="P", default=1e-3, help=text)
    text = "at which either answer is given (default: 0.95)"
    parser.add_argument("--confidence", type=flags.real(), metavar="C", default=0.95, help=text)
    text = "walks of each controller after which nothing is said (default: 20000)"
    parser.add_argument("--most", type=flags.whole(1), metavar="INT", default=20_000, help=text)
    parser.add_argument("--controllers", metavar="LIST", help="not the plan's: kinds with commas between, or all")
    parser.add_argument("--restart", action="store_true", help="begin anew; keep what is there in a backup folder")
    add_running(parser)


def _certify(found: Namespace) -> int:
    from sim.trials.plan import CertificateStudy, MonteCarloStudy, ReliabilityStudy, load_plan

    plan = load_plan(found.plan)
    if found.controllers is not None:
        plan = replace(plan, controllers=kinds_of(found.controllers))
    random: list[ReliabilityStudy | MonteCarloStudy | CertificateStudy]
    random = [*plan.reliability, *plan.montecarlo, *plan.certificate]
    if not random:
        raise UserError(
            f"{found.plan}: has no [[reliability]] or [[montecarlo]] study; must have random axes to certify"
        )
    study = CertificateStudy(
        name=f"{random[0].name} certificate",
        probability=found.probability,
        confidence=found.confidence,
        most=found.most,
        axes=random[0].axes,
        correlations=getattr(random[0], "correlations", ()),
    )
    plan = replace(plan, grid=(), margin=(), montecarlo=(), reliability=(), certificate=(study,))
    return run_campaign(plan, Path(found.out), found, restart=found.restart)


def _add_numerics(parser: flags.Parser) -> None:
    parser.set_defaults(run=_numerics)
    parser.add_argument("plan", metavar="PLAN|FILE.toml", help="a shipped plan (such as headlines) or a plan file")
    parser.add_argument("--out", metavar="DIR", required=True, help="folder of the results, made if missing")
    parser.add_argument("--variants", metavar="LIST", help="some of the variants, with semicolons between")
    parser.add_argument("--workers", type=flags.whole(1), metavar="INT", help="processes (default: one a core)")


def _numerics(found: Namespace) -> int:
    from sim.trials import numerics
    from sim.trials.plan import load_plan

    names = [name.strip() for name in found.variants.split(";")] if found.variants else list(numerics.VARIANTS)
    for name in names:
        if name not in numerics.VARIANTS:
            guess = flags.nearest(name, numerics.VARIANTS)
            raise UserError(f"--variants: no variant {name!r}; {guess}There are: {'; '.join(numerics.VARIANTS)}")
    from sim.terminal.interrupt import stop_on_signal
    from sim.trials.run import run_plan

    out = Path(found.out)
    with stop_on_signal() as stop:

        def run(plan: "Plan", folder: Path) -> "Results":
            note(plan.name)
            return run_plan(plan, folder, workers=found.workers, stop=stop)

        page = numerics.run(load_plan(found.plan), out, names, run)
    if page is None:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return 128 + stop.signum
    for claim in json.loads((out / numerics.DATA).read_text(encoding="utf-8"))["claims"]:
        print(f"{claim['name']}: {claim['said'][numerics.AS_IT_IS]}; {claim['verdict']}")
    print(f"page: {page}")
    return 0


def _add_bench(parser: flags.Parser) -> None:
    parser.set_defaults(run=_bench)
    parser.add_argument("--controllers", metavar="LIST", default="c-mpc,zd-pd", help="kinds with commas, or all")
    text = "trials for each figure (default: 120)"
    parser.add_argument("--trials", type=flags.whole(LEAST_TRIALS), metavar="INT", default=120, help=text)
    add_json(parser, "the figures")


def _bench(found: Namespace) -> int:
    from sim.bench.trials import benchmark
    from sim.commands.bench import show

    kinds = kinds_of(found.controllers)
    show(benchmark(kinds, found.trials, note), as_json=found.json)
    return 0


def _add_report(parser: flags.Parser) -> None:
    parser.set_defaults(run=_report)
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument("--out", metavar="DIR", help="where the pages go (default: beside the results)")


def _report(found: Namespace) -> int:
    from sim.trials.run.recall import open_results

    with open_results(found.folder) as results:
        write_pages(results, Path(found.out or found.folder))
    return 0


def _add_retry(parser: flags.Parser) -> None:
    parser.set_defaults(run=_retry)
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument("--errors", action="store_true", help="try errors again too, not only what was given up")
    text = "not the plan's: wall time in [s] after which a trial is given up"
    parser.add_argument("--wall-limit", type=flags.real(above=0.0), metavar="s", help=text)
    add_running(parser)


def _retry(found: Namespace) -> int:
    from sim.trials.run.recall import stored_plan
    from sim.trials.run.result import ERROR, GAVE_UP

    plan = stored_plan(found.folder)
    if found.wall_limit is not None:
        plan = replace(plan, wall_limit=found.wall_limit)
    outcomes = (GAVE_UP, ERROR) if found.errors else (GAVE_UP,)
    return run_campaign(plan, Path(found.folder), found, retry=outcomes)


def _add_show(parser: flags.Parser) -> None:
    parser.set_defaults(run=_show)
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument("--trial", metavar="CONTROLLER/NUMBER", required=True)


def _show(found: Namespace) -> int:
    from sim.trials.report.summary import describe
    from sim.trials.run.recall import stored_trial

    result = stored_trial(found.folder, found.trial)
    print(describe(result))
    print(f"again: cmpc run --from-trial {found.folder}#{found.trial}")
    return 0
