"""`cmpc replay`: run a log again from itself, as it was or with a change."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sim.commands.run import announce, check_new_log, default_log, print_summary
from sim.errors import UserError
from sim.scenario import Scenario
from sim.settings import flags

if TYPE_CHECKING:
    from sim.log.read import Log
    from sim.review.replay import Verdict

EXIT_DIFFERENT = 1
EXIT_PARTIAL = 3

EPILOG = """\
As it was: every tick, event and figure is compared with the log, to the last bit.
With a change, the same situation is run into a new log; every flag of cmpc run will do, and so will
--set PATH VALUE:

  cmpc replay RUN.mcap --controller zd-pd
  cmpc replay RUN.mcap --set plant.ground.friction 0.4 --log logs/what-if.mcap

exit code: 0 identical (or the changed run is done); 1 different; 2 bad input or a damaged log;
           3 agrees, but the log lacks the end of its run; 130 and 143 interrupted
"""


def main(argv: Sequence[str]) -> int:
    """Run `cmpc replay`; returns the exit code."""
    argv = _plain_flags(argv)
    found = _parser(Scenario(), argv).parse(argv)
    if found.help or found.run is None:
        _parser(Scenario(), argv).print_help()
        return 0
    from sim.log.read import read_log
    from sim.log.read.attachments import scenario_of
    from sim.review.replay import version_changes

    log = read_log(Path(found.run))
    before = scenario_of(log)
    changed = flags.apply(before, _parser(before, argv).parse(argv))
    for line in version_changes(log):
        print(f"cmpc: warning: {line}", file=sys.stderr)
    if changed == before and found.log is None:
        return _replay(log, before, quiet=found.quiet)
    return _rerun(log, changed, Path(found.log) if found.log else None, quiet=found.quiet, json=found.json)


def _plain_flags(argv: Sequence[str]) -> list[str]:
    """`--set PATH VALUE` as `--PATH VALUE`."""
    words, out = list(argv), []
    while words:
        word = words.pop(0)
        if word != "--set":
            out.append(word)
            continue
        if len(words) < 2:
            raise UserError("--set takes PATH VALUE, such as --set plant.ground.friction 0.4")
        out += [f"--{words.pop(0).removeprefix('--')}", *words.pop(0).replace(",", " ").split()]
    return out


def _parser(scenario: Scenario, argv: Sequence[str]) -> flags.Parser:
    parser = flags.Parser(
        prog="cmpc replay",
        usage="cmpc replay RUN.mcap [options]",
        description="Run a log again from its own scenario, models and gait.",
        epilog=EPILOG,
    )
    parser.add_argument("run", nargs="?", metavar="RUN.mcap", help="the log")
    own = parser.add_argument_group("options")
    own.add_argument("-h", "--help", action="store_true", help="show the options")
    own.add_argument("--log", metavar="PATH", help="where the changed run is logged (default: a new name in logs/)")
    own.add_argument("--json", action="store_true", help="print the summary of a changed run as one JSON object")
    own.add_argument("--quiet", action="store_true", help="show no progress bar")
    flags.add_settings(parser, scenario, argv)
    return parser


def _replay(log: "Log", scenario: Scenario, *, quiet: bool) -> int:
    from sim.review.replay import replay
    from sim.terminal.progress import progress_bar

    with progress_bar(scenario.steps, quiet=quiet) as show:
        verdict = replay(log, progress=show, announce=announce)
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
    for channel in verdict.comparison.channels:
        for name, gap in sorted(channel.largest.items(), key=lambda item: -item[1])[:1]:
            lines.append(f"{channel.topic}: up to {gap:.3g} {channel.units.get(name, '')} in {name}")
    if verdict.figures:
        lines.append(f"figures of the summary that differ: {', '.join(verdict.figures)}")
    return [printable(line) for line in lines]


def _rerun(log: "Log", changed: Scenario, target: Path | None, *, quiet: bool, json: bool) -> int:
    from sim.review.replay import rerun
    from sim.terminal.interrupt import stop_on_signal
    from sim.terminal.progress import progress_bar

    path = target or default_log(changed)
    check_new_log(path)
    with stop_on_signal() as stop, progress_bar(changed.steps, quiet=quiet or json) as show:
        summary = rerun(log, changed, path, progress=show, stop=stop, announce=announce)
    print_summary(summary, changed, json=json)
    return 128 + stop.signum if stop.signum else 0
