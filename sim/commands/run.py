"""`cmpc run`: one scenario, its summary, its log."""

import contextlib
import itertools
import math
import os
import re
import shlex
import sys
import tempfile
from argparse import Namespace
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller.common.outside import file_label
from sim.commands.options import add_json, add_quiet, add_scenario, show_help
from sim.errors import UserError
from sim.scenario import Scenario, load, shipped
from sim.scenario.files import DEFAULT
from sim.settings import flags
from sim.terminal import console

if TYPE_CHECKING:
    from sim.loop import RunSummary

LOGS = Path("logs")  # under the current directory
WIDTH = 200  # columns of a table that goes to a file, so that paths stay whole

DESCRIPTION = "Run one scenario: a walker, a controller, a plant and what disturbs it."
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


def add_parser(commands: Any, argv: Sequence[str], scenario: Scenario | None = None) -> None:
    """Add the parser of `cmpc run`, whose help shows a scenario's values."""
    parser, own = add_scenario(
        commands,
        "run",
        argv,
        scenario,
        description=DESCRIPTION,
        epilog=EPILOG,
        default=DEFAULT,
        text="a shipped scenario (see --list) or a scenario file",
    )
    parser.set_defaults(run=_run)
    own.add_argument("--list", action="store_true", help="list the shipped scenarios")
    where = own.add_mutually_exclusive_group()
    where.add_argument(
        "--log", metavar="PATH", help="log file (default: logs/<name>-<controller>-<UTC>-<process>.mcap)"
    )
    where.add_argument("--no-log", action="store_true", help="write no log")
    own.add_argument(
        "--audit", action="store_true", help="audit energy, contact and impacts instead of writing a log; slower"
    )
    own.add_argument("--from-trial", metavar="DIR#ID", help="run a trial of cmpc trials again, to the same end")
    own.add_argument("--viewer", action="store_true", help="show the run in MuJoCo's window, no faster than real time")
    own.add_argument(
        "--live",
        nargs="?",
        const="foxglove",
        choices=("foxglove", "rerun"),
        help='serve the run to a viewer, Foxglove\'s protocol unless rerun is named; extra "live"',
    )
    own.add_argument("--live-port", type=int, metavar="PORT", help="of that server (default: 8765; rerun: 9876)")
    add_json(own, "the summary")
    add_quiet(own)


def _run(found: Namespace) -> int:
    if found.list:
        _print_list()
        return 0
    scenario = _scenario(found)
    if found.help or found.help_all:
        show_help(add_parser, found, scenario)
        return 0
    scenario = flags.apply(scenario, found)
    if found.audit:
        besides = {"--viewer": found.viewer, "--log": found.log is not None, "--live": found.live is not None}
        if more := [option for option, given in besides.items() if given]:
            raise UserError(f"--audit and {more[0]}: must be one of them")
        return _audit(scenario, json=found.json)
    if found.live_port is not None and found.live is None:
        raise UserError(f"--live-port {found.live_port}: is of the server of --live; give that, too")
    if found.no_log:
        log = None
    else:
        log = Path(found.log) if found.log is not None else default_log(scenario)
        check_new_log(log)
    if found.live is None:
        return _walk(scenario, log, json=found.json, quiet=found.quiet, view=found.viewer)
    if log is None:
        raise UserError("--live and --no-log: must be one of them; what is shown is the growing log")
    from sim.review.live import live

    with live(found.live, log, found.live_port) as where:
        console.note(where)
        code = _walk(scenario, log, json=found.json, quiet=found.quiet, view=found.viewer)
        console.note("the run is over; its stream goes on to the end, Ctrl-C ends it")
    return code


def _audit(scenario: Scenario, *, json: bool) -> int:
    import dataclasses
    import json as text

    from sim.bridge.audit import audited, rows
    from sim.loop import Outcome

    summary, audit = audited(scenario)
    if json:
        e = audit.energy
        figures = dataclasses.asdict(e) | {"residual": e.residual, "slip": summary.slip_m}
        steadiness = dataclasses.asdict(audit.steadiness)
        figures |= {name: value if math.isfinite(value) else None for name, value in steadiness.items()}
        figures |= {"mpc_torque_share": summary.mpc_torque_share}
        names = ("penetration", "penetration_impact", "flight_share", "impulse_error")
        figures |= {name: getattr(audit, name) for name in names}
        print(text.dumps({"outcome": summary.outcome, "steps": summary.steps, "audit": figures}), flush=True)
    else:
        print_summary(summary, scenario, json=False)
        table = console.table("audit", "")
        for row in rows(audit, summary.slip_m):
            table.add_row(*row)
        console.show(table, WIDTH)
    return 1 if summary.outcome == Outcome.ERROR.value else 0


def _scenario(found: Namespace) -> Scenario:
    """The scenario by name, by file, or of a trial of a campaign."""
    if found.from_trial is None:
        return load(DEFAULT if found.scenario is None else found.scenario)
    if found.scenario is not None:
        raise UserError(f"{found.scenario} and --from-trial: must be one of them; a trial brings its scenario")
    from sim.trials.run.recall import stored_scenario

    return stored_scenario(found.from_trial)


def _print_list() -> None:
    for name, description in shipped().items():
        print(f"{name:<16}{description}{' (default)' if name == DEFAULT else ''}")


def default_log(scenario: Scenario) -> Path:
    """A new name in logs/, which is made when missing: the start in UTC and the process tell two runs apart."""
    try:
        LOGS.mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(f"{LOGS.absolute()}: cannot make the folder for logs: {error.strerror}") from error
    name = re.sub(r"[^\w.-]+", "-", scenario.name).strip(".-") or "run"
    stem = f"{name}-{file_label(scenario.controller.kind)}-{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{os.getpid()}"
    names = (LOGS / f"{stem}{'-' * (n > 1)}{n if n > 1 else ''}.mcap" for n in itertools.count(1))
    return next(path for path in names if not path.exists())


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


def _walk(scenario: Scenario, log: Path | None, *, json: bool, quiet: bool, view: bool) -> int:
    from sim.bridge.run import run_scenario
    from sim.loop import Outcome, Patient
    from sim.terminal.interrupt import stop_on_signal
    from sim.terminal.progress import walking
    from sim.trials.falls.witness import Witness
    from sim.trials.run.trial import fading

    witness = Witness(scenario.controller.period)
    prints = (
        contextlib.redirect_stdout(sys.stderr) if json else contextlib.nullcontext()
    )  # of a controller from outside
    with stop_on_signal() as stop:
        _prepare(scenario, stop, quiet=quiet or json)
        if stop.signum:
            console.note(f"cmpc: {stop()} while kernels were compiled, before the run began")
            return 128 + stop.signum
    with stop_on_signal() as stop, walking(scenario.steps, quiet=quiet or json) as show, prints:
        summary = run_scenario(
            scenario, log=log, progress=show, stop=Patient(stop), announce=console.note, view=view, tape=witness
        )
    why = witness.story(summary.torque_limit_Nm) if summary.outcome == Outcome.FELL.value else ""
    if summary.outcome == Outcome.COMPLETED.value and fading(witness, scenario):
        why = "it loses energy step by step, and would stop if it went on"
    print_summary(summary, scenario, json=json, why=why)
    if log is not None and not json:
        _say_next(summary.outcome == Outcome.FELL.value, scenario, log)
    if summary.outcome == Outcome.INTERRUPTED.value:
        return 128 + stop.signum if stop.signum else 1
    return 1 if summary.outcome == Outcome.ERROR.value else 0


def _say_next(fell: bool, scenario: Scenario, log: Path) -> None:
    """What to do with a log: look at it; and where another controller may do better or worse, try that."""
    path = shlex.quote(str(log))
    console.next_step(f"cmpc review {path}", "its page: why, animation, plots")
    other = "c-mpc" if fell and scenario.controller.kind != "c-mpc" else "zd-pd" if not fell else "c-mpc-ltv"
    if other != scenario.controller.kind:
        console.next_step(f"cmpc replay {path} --controller {other}", "the same situation under another controller")


def _prepare(scenario: Scenario, stop: Callable[[], str | None], *, quiet: bool) -> None:
    """Compile the kernels that the run needs and that are not on disk."""
    from sim.bridge import kernels
    from sim.terminal.progress import progress_bar

    kind, plant = scenario.controller.kind, scenario.plant.kind
    if kernels.ready(kind, plant):
        return
    if not sys.stderr.isatty():
        console.note(kernels.ONCE)
    with progress_bar("compiling kernels, once", quiet=quiet) as update:
        kernels.prepare(kind, plant, stop=stop, show=update or kernels.unseen)


def print_summary(summary: "RunSummary", scenario: Scenario, *, json: bool, why: str = "") -> None:
    """Print a summary as a table, or as one JSON object; `why`: what broke, or is about to."""
    from sim.terminal.summary import as_json, as_table

    if json:
        print(as_json(summary), flush=True)
        return
    console.show(as_table(summary, scenario, why), WIDTH)
