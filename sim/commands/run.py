"""`cmpc run`: one scenario, its summary, its log."""

import re
import sys
import tempfile
from argparse import Namespace
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from sim.errors import UserError
from sim.scenario import Scenario, load, shipped
from sim.scenario.files import DEFAULT
from sim.settings import flags

if TYPE_CHECKING:
    from sim.loop import RunSummary

LOGS = Path("logs")  # under the current directory
WIDTH = 200  # columns of a table that goes to a file, so that paths stay whole

EPILOG = """\
Flags override the scenario. Every setting is a flag by its dotted path, and a key of a scenario file by
the same path. none unsets a value that may be missing. Pushes are numbered from 0; one past the last
adds a push:

  cmpc run push-25N --pushes.0.force 30
  cmpc run push-25N --pushes.1.force -20 --pushes.1.step 5
  cmpc run undisturbed --pushes.0.force 40 --pushes.0.start 1.0 --pushes.0.end 1.2 --pushes.0.body left_femur
  cmpc run push-25N --pushes.0.step none --pushes.0.start 0.6 --pushes.0.end 0.9

exit code: 0 completed or fell, 1 error, 2 bad input, 130 and 143 interrupted by Ctrl-C and SIGTERM
"""


def main(argv: Sequence[str]) -> int:
    """Run `cmpc run`; returns the exit code."""
    found = _parser(Scenario(), argv).parse(argv)
    if found.list:
        _print_list()
        return 0
    scenario = _scenario(found)
    if found.help:
        _parser(scenario, argv).print_help()
        return 0
    scenario = flags.apply(scenario, found)
    if found.no_log:
        log = None
    else:
        log = Path(found.log) if found.log is not None else default_log(scenario)
        check_new_log(log)
    return _run(scenario, log, json=found.json, quiet=found.quiet, view=found.viewer)


def _scenario(found: Namespace) -> Scenario:
    """The scenario by name, by file, or of a trial of a campaign."""
    if found.from_trial is None:
        return load(found.scenario or DEFAULT)
    if found.scenario is not None:
        raise UserError(f"{found.scenario} and --from-trial: must be one of them; a trial brings its scenario")
    from sim.trials.run.recall import stored_scenario

    return stored_scenario(found.from_trial)


def _parser(scenario: Scenario, argv: Sequence[str]) -> flags.Parser:
    parser = flags.Parser(
        prog="cmpc run",
        usage="cmpc run [NAME|FILE.toml] [options]",
        description="Run one scenario: a walker, a controller, a plant and what disturbs it.",
        epilog=EPILOG,
    )
    text = f"a shipped scenario (see --list) or a scenario file (default: {DEFAULT})"
    parser.add_argument("scenario", nargs="?", metavar="NAME|FILE.toml", help=text)
    own = parser.add_argument_group("options")
    own.add_argument("-h", "--help", action="store_true", help="show the options, with the scenario's values")
    own.add_argument("--list", action="store_true", help="list the shipped scenarios")
    where = own.add_mutually_exclusive_group()
    where.add_argument("--log", metavar="PATH", help="log file (default: logs/<name>-<controller>-<UTC>.mcap)")
    where.add_argument("--no-log", action="store_true", help="write no log")
    own.add_argument("--from-trial", metavar="DIR#ID", help="run a trial of cmpc trials again, to the same end")
    own.add_argument("--viewer", action="store_true", help="show the run in MuJoCo's window, no faster than real time")
    own.add_argument("--json", action="store_true", help="print the summary as one JSON object, and no bar")
    own.add_argument("--quiet", action="store_true", help="show no progress bar")
    flags.add_settings(parser, scenario, argv)
    return parser


def _print_list() -> None:
    for name, description in shipped().items():
        print(f"{name:<16}{description}{' (default)' if name == DEFAULT else ''}")


def default_log(scenario: Scenario) -> Path:
    """A new name in logs/, which is made when missing."""
    try:
        LOGS.mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(f"{LOGS.absolute()}: cannot make the folder for logs: {error.strerror}") from error
    name = re.sub(r"[^\w.-]+", "-", scenario.name).strip(".-") or "run"
    stem = f"{name}-{scenario.controller.kind}-{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
    path, number = LOGS / f"{stem}.mcap", 1
    while path.exists():
        number += 1
        path = LOGS / f"{stem}-{number}.mcap"
    return path


def check_new_log(path: Path) -> None:
    """See before the run that its log can be written and overwrites nothing."""
    try:
        if path.exists():
            raise UserError(f"--log {path}: already exists and is never overwritten; choose another name")
        if not path.parent.is_dir():
            raise UserError(f"--log {path}: {path.parent} is no folder; make it first or choose another path")
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise UserError(f"--log {path}: cannot be written: {error.strerror}") from error


def _run(scenario: Scenario, log: Path | None, *, json: bool, quiet: bool, view: bool) -> int:
    from sim.bridge.run import run_scenario
    from sim.loop import Outcome
    from sim.terminal.interrupt import stop_on_signal
    from sim.terminal.progress import progress_bar

    with stop_on_signal() as stop, progress_bar(scenario.steps, quiet=quiet or json) as show:
        summary = run_scenario(scenario, log=log, progress=show, stop=stop, announce=announce, view=view)
    print_summary(summary, scenario, json=json)
    if summary.outcome == Outcome.INTERRUPTED.value:
        return 128 + stop.signum if stop.signum else 1
    return 1 if summary.outcome == Outcome.ERROR.value else 0


def announce(line: str) -> None:
    """Print a line for the user before something long."""
    print(line, file=sys.stderr, flush=True)


def print_summary(summary: "RunSummary", scenario: Scenario, *, json: bool) -> None:
    """Print a summary as a table, or as one JSON object."""
    from sim.terminal.summary import as_json, as_table

    if json:
        print(as_json(summary), flush=True)
        return
    from rich.console import Console

    width = None if sys.stdout.isatty() else WIDTH
    Console(file=sys.stdout, highlight=False, width=width).print(as_table(summary, scenario))
