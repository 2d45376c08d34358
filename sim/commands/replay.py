"""`cmpc replay`: run a log again from itself, as it was or with a change."""

import shlex
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sim.commands.options import add_json, add_quiet, with_controller
from sim.commands.run import check_new_log, default_log, print_summary
from sim.scenario import Scenario
from sim.settings import flags
from sim.terminal.console import next_step, note

if TYPE_CHECKING:
    from sim.log.read import Log
    from sim.review.replay import Verdict

EXIT_DIFFERENT = 1
EXIT_PARTIAL = 3

USAGE = "cmpc replay RUN.mcap [options]"
DESCRIPTION = "Run a log again from its own scenario, models and gait."
EPILOG = """\
As it was: every tick, event and figure is compared with the log, to the last bit.
With a change, the same situation is run into a new log; every flag of cmpc run will do, and so will
--set PATH VALUE:

  cmpc replay RUN.mcap --controller zd-pd
  cmpc replay RUN.mcap --set plant.ground.friction 0.4 --log logs/what-if.mcap

exit code: 0 identical (or the changed run is done); 1 different; 2 bad input or a damaged log;
           3 agrees, but the log lacks the end of its run; 130 and 143 interrupted
"""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc replay`."""
    parser = commands.add_parser("replay", usage=USAGE, description=DESCRIPTION, epilog=EPILOG)
    parser.set_defaults(run=_run)
    parser.add_argument("log_path", nargs="?", metavar="RUN.mcap", help="the log")
    own = parser.add_argument_group("options")
    own.add_argument("--log", metavar="PATH", help="where the changed run is logged (default: a new name in logs/)")
    own.add_argument("--set", nargs=2, action="append", default=[], metavar=("PATH", "VALUE"), help="as --PATH VALUE")
    add_json(own, "the summary of a changed run")
    add_quiet(own)
    sets = [(argv[i + 1], argv[i + 2]) for i, word in enumerate(argv[:-2]) if word == "--set"]
    words = [*argv, *(word for path, value in sets for word in (f"--{path.removeprefix('--')}", value))]
    flags.add_settings(parser, with_controller(_logged(argv), words), words)


def _logged(argv: Sequence[str]) -> Scenario:
    """The scenario of a log whose controller's own settings are to be changed, the defaults otherwise."""
    if not any("controller.settings" in word for word in argv):
        return Scenario()
    from sim.log.read import read_log
    from sim.log.read.attachments import scenario_of

    path = next((Path(word) for word in argv if word.endswith(".mcap") and Path(word).is_file()), None)
    return scenario_of(read_log(path)) if path else Scenario()


def _run(found: Namespace) -> int:
    if found.log_path is None:
        found.parser.print_help()
        return 0
    from sim.log.read import read_log
    from sim.log.read.attachments import scenario_of
    from sim.review.replay import version_changes

    vars(found).update({flags.PREFIX + _path(word): [value] for word, value in found.set})
    log = read_log(Path(found.log_path))
    before = scenario_of(log)
    changed = flags.apply(before, found)
    for line in version_changes(log):
        print(f"cmpc: warning: {line}", file=sys.stderr)
    if changed == before and found.log is None:
        return _replay(log, before, quiet=found.quiet)
    return _rerun(log, changed, Path(found.log) if found.log else None, quiet=found.quiet, json=found.json)


def _path(word: str) -> str:
    """The setting that a word stands for as an option does."""
    path = word.removeprefix("--").replace("-", "_")
    return "controller.kind" if path == "controller" else path


def _replay(log: "Log", scenario: Scenario, *, quiet: bool) -> int:
    from sim.review.replay import replay
    from sim.terminal.progress import walking

    with walking(scenario.steps, quiet=quiet) as show:
        verdict = replay(log, progress=show, announce=note)
    for line in _differences(verdict):
        print(line)
    if verdict.identical:
        print(f"identical: {verdict.ticks} ticks")
        return 0
    if verdict.agrees:
        print(f"agrees in all of its {verdict.ticks} ticks, but the log lacks the end of its run")
        return EXIT_PARTIAL
    print("different" if verdict.ticks else "different: the log has no ticks")
    return EXIT_DIFFERENT


def _differences(verdict: "Verdict") -> list[str]:
    from sim.log.tools.text import printable

    lines = list(verdict.changed)
    first = verdict.comparison.first
    if first:
        where = f"tick {first.tick}, {first.topic} {first.field}".rstrip()
        lines.append(f"first difference: {where}: {first.a} in the log, {first.b} now")
    lines += [f"attachment {name} differs" for name in verdict.attachments]
    for channel in verdict.comparison.channels:
        for name, gap in sorted(channel.largest.items(), key=lambda item: -item[1])[:1]:
            lines.append(f"{channel.topic}: up to {gap:.3g} {channel.units.get(name, '')} in {name}")
    if verdict.figures:
        lines.append(f"figures of the summary that differ: {', '.join(verdict.figures)}")
    return [printable(line) for line in lines]


def _rerun(log: "Log", changed: Scenario, target: Path | None, *, quiet: bool, json: bool) -> int:
    from sim.review.replay import rerun
    from sim.terminal.interrupt import stop_on_signal
    from sim.terminal.progress import walking

    path = target or default_log(changed)
    check_new_log(path)
    with stop_on_signal() as stop, walking(changed.steps, quiet=quiet or json) as show:
        summary = rerun(log, changed, path, progress=show, stop=stop, announce=note)
    print_summary(summary, changed, json=json)
    if not json:
        next_step(f"cmpc review {shlex.quote(str(log.path))} {shlex.quote(str(path))}", "both runs on one page")
    return 128 + stop.signum if stop.signum else 0
