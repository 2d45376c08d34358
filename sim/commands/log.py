"""`cmpc log`: look into logs, check them, save what is left of them, export and compare them."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sim.errors import UserError
from sim.settings import flags

if TYPE_CHECKING:
    from sim.log.read import Log
    from sim.log.tools.compare import ChannelComparison

ACTIONS = {
    "info": "what ran, how it ended, and the channels",
    "check": "CRCs, gaps in the ticks, messages against schemas, statistics against data, attachments",
    "recover": "save what is sound in a log of a killed run, or a damaged one, as a new log",
    "export": "one CSV or Parquet file a channel, the events and the attachments",
    "compare": "the first tick and channel in which two logs differ, and the largest differences",
}
EPILOG = """\
  cmpc log info RUN.mcap                     cmpc log export RUN.mcap FOLDER --format parquet
  cmpc log check RUN.mcap                    cmpc log export RUN.mcap FOLDER --channel /control
  cmpc log recover KILLED.mcap SAVED.mcap    cmpc log compare A.mcap B.mcap

exit code: 0 sound, nothing lost, identical; 1 problems found, something lost, different; 2 bad input
"""


def main(argv: Sequence[str]) -> int:
    """Run `cmpc log`; returns the exit code."""
    parser = flags.Parser(
        prog="cmpc log",
        usage="cmpc log ACTION LOG [...]",
        description="Look at logs.\n\nactions:\n" + "\n".join(f"  {k:<9}{v}" for k, v in ACTIONS.items()),
        epilog=EPILOG,
    )
    parser.add_argument("-h", "--help", action="store_true", help="show this")
    parser.add_argument("action", nargs="?", metavar="ACTION", help=", ".join(ACTIONS))
    parser.add_argument("paths", nargs="*", metavar="PATH", help="the log; then what the action takes")
    parser.add_argument("--format", choices=("csv", "parquet"), default="csv", help="of exported tables")
    parser.add_argument(
        "--channel", action="append", metavar="TOPIC", help="export this channel alone; may be repeated"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object (info, check, compare)")
    found = parser.parse(argv)
    if found.help or found.action is None:
        parser.print_help()
        return 0
    if found.action not in ACTIONS:
        raise UserError(f"cmpc log {found.action}: no such action; legal: {', '.join(ACTIONS)}")
    wanted = {"info": ("LOG",), "check": ("LOG",), "recover": ("LOG", "NEW"), "export": ("LOG", "FOLDER")}
    names = wanted.get(found.action, ("A", "B"))
    if len(found.paths) != len(names):
        raise UserError(f"cmpc log {found.action} takes {' '.join(names)}; {len(found.paths)} paths were given")
    return int(globals()[f"_{found.action}"](found, *map(Path, found.paths)))


def _show(table: Any) -> None:
    from rich.console import Console

    Console(highlight=False, width=None if sys.stdout.isatty() else 140).print(table)


def _warn(log: "Log") -> None:
    """Say on stderr what is wrong with a log that is read all the same."""
    from sim.log.tools.text import printable

    for at, text in log.problems[:5]:
        print(f"cmpc: warning: {log.path} is damaged at byte {at}: {printable(text)}", file=sys.stderr)
    if len(log.problems) > 5:
        print(f"cmpc: warning: and at {len(log.problems) - 5} other places", file=sys.stderr)
    if not log.complete and not log.problems:
        print(f"cmpc: warning: {log.path} was not finished; what is there is shown", file=sys.stderr)


def _info(found: Any, path: Path) -> int:
    from sim.log.read import salvage
    from sim.log.tools.info import as_table, facts

    log = salvage(path)
    _warn(log)
    if found.json:
        print(json.dumps(facts(log)))
    else:
        for table in as_table(log):
            _show(table)
    return 0


def _check(found: Any, path: Path) -> int:
    from sim.log.tools.check import check
    from sim.log.tools.text import printable

    log, problems = check(path)
    if found.json:
        print(json.dumps({"log": str(path), "sound": not problems, "problems": problems}))
    else:
        for problem in problems:
            print(printable(problem))
        messages = sum(len(log.records(topic)) for topic in log.channels)
        verdict = f"{len(problems)} problems" if problems else "sound"
        parts = f"{len(log.channels)} channels, {messages} messages, {len(log.attachments)} attachments"
        print(f"{path}: {verdict}; {parts}")
    return 1 if problems else 0


def _recover(found: Any, source: Path, target: Path) -> int:
    from sim.log.tools.recover import recover
    from sim.log.tools.text import printable

    saved = recover(source, target)
    for loss in saved.lost:
        print(f"lost: {printable(loss)}")
    print(
        f"{target}: {saved.messages} messages up to t = {saved.last_s:.3f} s"
        + ("" if saved.lost else ", all there was")
    )
    return 1 if saved.lost else 0


def _export(found: Any, path: Path, folder: Path) -> int:
    from sim.log.read import salvage
    from sim.log.read.frames import run_of
    from sim.log.tools.export import export

    log = salvage(path)
    _warn(log)
    for file in export(run_of(log), folder, found.format, found.channel):
        print(file)
    return 0 if log.complete and not log.problems else 1


def _compare(found: Any, a: Path, b: Path) -> int:
    from sim.log.read import salvage
    from sim.log.tools.compare import compare

    logs = salvage(a), salvage(b)
    for log in logs:
        _warn(log)
    result = compare(*logs)
    if found.json:
        first = result.first._asdict() if result.first else None
        channels = {c.topic: {"equal": c.equal, "counts": c.counts, "largest": c.largest} for c in result.channels}
        out = {"identical": result.identical, "sound": result.sound, "first": first}
        print(json.dumps({**out, "attachments": result.attachments, "channels": channels}))
        return 0 if result.identical else 1
    for channel in result.channels:
        print(_line(channel))
    for name in result.attachments:
        print(f"attachment {name} differs")
    if result.identical:
        print("identical (wall times left out)")
    elif result.first:
        d = result.first
        print(f"different: first at tick {d.tick}, {d.topic} {d.field}".rstrip() + f": {d.a} | {d.b}")
    else:
        print("different" if result.sound else "no verdict: a log is damaged or was not finished")
    return 0 if result.identical else 1


def _line(channel: "ChannelComparison") -> str:
    from sim.log.tools.text import printable

    topic = f"{printable(channel.topic):<20}"
    if channel.equal:
        return f"{topic}equal, {channel.counts[0]} messages"
    words = f"{topic}{channel.counts[0]} and {channel.counts[1]} messages"
    if channel.first:
        words += f"; differs from tick {channel.first.tick}"
    for name, gap in sorted(channel.largest.items(), key=lambda item: -item[1])[:1]:
        words += f"; largest difference {gap:.3g} {channel.units.get(name, '')} in {printable(name)}"
    return words
