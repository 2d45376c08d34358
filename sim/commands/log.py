"""`cmpc log`: look into logs, check them, save what is left of them, export and compare them."""

import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sim.commands.options import add_json
from sim.terminal import console

if TYPE_CHECKING:
    from sim.log.read import Log
    from sim.log.tools.compare import ChannelComparison

EPILOG = """\
  cmpc log info RUN.mcap                     cmpc log export RUN.mcap FOLDER --format parquet
  cmpc log check RUN.mcap                    cmpc log export RUN.mcap FOLDER --channel /control
  cmpc log recover KILLED.mcap SAVED.mcap    cmpc log compare A.mcap B.mcap

exit code: 0 sound, nothing lost, identical or the same ticks in another container; 1 problems found, something lost,
           different, or no verdict; 2 bad input
"""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc log`."""
    parser = commands.add_parser("log", description="Look at logs.", epilog=EPILOG)
    actions = parser.add_subparsers(metavar="ACTION")

    def action(name: str, run: Any, help: str, *paths: str) -> Any:
        sub = actions.add_parser(name, help=help, description=help[:1].upper() + help[1:] + ".")
        sub.set_defaults(run=run)
        for path in paths:
            sub.add_argument(path.lower(), type=Path, metavar=path)
        return sub

    add_json(action("info", _info, "what ran, how it ended, and the channels", "LOG"))
    text = "CRCs, gaps in the ticks, messages against schemas, statistics against data, attachments"
    add_json(action("check", _check, text, "LOG"))
    action("recover", _recover, "save what is sound in a log of a killed run, or a damaged one", "LOG", "NEW")
    export = action(
        "export", _export, "one CSV or Parquet file a channel, the events, the attachments", "LOG", "FOLDER"
    )
    export.add_argument("--format", choices=("csv", "parquet"), default="csv", help="of the tables (default: csv)")
    export.add_argument("--channel", action="append", metavar="TOPIC", help="this channel alone; may be repeated")
    text = "the first tick and channel in which two logs differ, and the largest differences"
    add_json(action("compare", _compare, text, "A", "B"))


def _warn(log: "Log") -> None:
    """Say on stderr what is wrong with a log that is read all the same."""
    from sim.log.tools.text import printable

    for at, text in log.problems[:5]:
        print(f"cmpc: warning: {log.path} is damaged at byte {at}: {printable(text)}", file=sys.stderr)
    if len(log.problems) > 5:
        print(f"cmpc: warning: and at {len(log.problems) - 5} other places", file=sys.stderr)
    if log.unknown_format:
        print(f"cmpc: warning: {log.path} {printable(log.unknown_format)}", file=sys.stderr)
    if not log.complete and not log.problems:
        how = "its closing bytes are missing, its data are there" if log.ended else "what is there is shown"
        print(f"cmpc: warning: {log.path} was not finished; {how}", file=sys.stderr)


def _info(found: Namespace) -> int:
    from sim.log.read import salvage
    from sim.log.read.frames import run_of
    from sim.log.tools.info import as_table, facts
    from sim.review.answer import answer

    log = salvage(found.log)
    _warn(log)
    words, moment = answer(run_of(log))
    if found.json:
        print(json.dumps(facts(log) | {"answer": words, "fall_began_s": moment}))
    else:
        print(words)
        for table in as_table(log):
            console.show(table, 140)
    return 0


def _check(found: Namespace) -> int:
    from sim.log.tools.check import check
    from sim.log.tools.signed import is_signed
    from sim.log.tools.text import printable

    log, problems = check(found.log)
    if found.json:
        out = {"log": str(found.log), "sound": not problems, "signed": is_signed(log), "problems": problems}
        print(json.dumps(out))
    else:
        for problem in problems:
            print(printable(problem))
        messages = sum(len(log.records(topic)) for topic in log.channels)
        signed = "" if is_signed(log) or "result" not in log.metadata else ", unsigned"
        verdict = (f"{len(problems)} problems" if problems else "sound") + signed
        parts = f"{len(log.channels)} channels, {messages} messages, {len(log.attachments)} attachments"
        print(f"{found.log}: {verdict}; {parts}")
    return 1 if problems else 0


def _recover(found: Namespace) -> int:
    from sim.log.tools.recover import recover
    from sim.log.tools.text import printable

    saved = recover(found.log, found.new)
    for loss in saved.lost:
        print(f"lost: {printable(loss)}")
    print(
        f"{found.new}: {saved.messages} messages up to t = {saved.last_s:.3f} s"
        + ("" if saved.lost else ", all there was")
    )
    return 1 if saved.lost else 0


def _export(found: Namespace) -> int:
    from sim.log.read import salvage
    from sim.log.read.frames import run_of
    from sim.log.tools.export import export

    log = salvage(found.log)
    _warn(log)
    for file in export(run_of(log), found.folder, found.format, found.channel):
        print(file)
    for topic, count in log.malformed.items():
        if count:
            print(f"cmpc: warning: {count} messages of {topic} do not match the schema: left out", file=sys.stderr)
    return 0 if log.complete and not log.problems and not any(log.malformed.values()) else 1


def _compare(found: Namespace) -> int:
    from sim.log.read import salvage
    from sim.log.tools.compare import compare
    from sim.log.tools.text import printable

    logs = salvage(found.a), salvage(found.b)
    for log in logs:
        _warn(log)
    result = compare(*logs)
    if found.json:
        first = result.first._asdict() if result.first else None
        channels = {c.topic: {"equal": c.equal, "counts": c.counts, "largest": c.largest} for c in result.channels}
        out = {"identical": result.identical, "same_ticks": result.same_ticks, "sound": result.sound, "first": first}
        more = {
            name: getattr(result, name) for name in ("attachments", "metadata", "provenance", "container", "unsound")
        }
        print(json.dumps({**out, **more, "channels": channels}))
        return 0 if result.same_run else 1
    for channel in result.channels:
        print(_line(channel))
    for name in result.attachments:
        print(f"attachment {name} differs")
    for words in result.unsound:
        print(printable(words))
    if result.provenance:
        print(f"recorded apart: {', '.join(result.provenance)} differ")
    print(printable(result.verdict))
    return 0 if result.same_run else 1


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
