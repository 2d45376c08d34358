"""`cmpc review`: one self-contained page from a log or two, or a layout for another viewer."""

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.errors import UserError
from sim.settings import flags

VIEWERS = ("foxglove", "lichtblick", "plotjuggler", "rerun")
USAGE = "cmpc review RUN.mcap [B.mcap] [options], or cmpc review DIR"
DESCRIPTION = "Make one HTML page that shows a run, or two: it needs no network and can be sent by mail."
EPILOG = """\
  cmpc review RUN.mcap                       one run
  cmpc review A.mcap B.mcap --out ab.html    two runs, overlaid and their difference
  cmpc review --follow RUN.mcap              a run that goes on, renewed as its log grows
  cmpc review results/                       a campaign's falls: small pictures, each with its review
  cmpc review --layout foxglove walk.json    a layout for Foxglove or Lichtblick
  cmpc review --layout plotjuggler walk.xml  then: plotjuggler -d RUN.mcap -l walk.xml
  cmpc review --layout rerun RUN.mcap a.rrd  the log as Rerun draws it, with its layout: rerun a.rrd; extra "live"

exit code: 0 done, 2 bad input
"""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc review`."""
    parser = commands.add_parser("review", usage=USAGE, description=DESCRIPTION, epilog=EPILOG)
    parser.set_defaults(run=_run)
    parser.add_argument("paths", nargs="*", metavar="RUN.mcap", help="a log, or two; with --layout the file to write")
    parser.add_argument("--out", metavar="PATH", help="the page (default: beside the log, .html)")
    parser.add_argument("--layout", choices=VIEWERS, help="write this viewer's layout instead of a page")
    parser.add_argument("--open", action="store_const", const=True, default=None, help="open it in the browser")
    text = "falls of a campaign that are run again with their logs (default: 12)"
    parser.add_argument("--most", type=flags.whole(1), default=12, metavar="INT", help=text)
    text = "make the page of one log anew while it is written, until its end; the browser renews it by itself"
    parser.add_argument("--follow", action="store_true", help=text)
    text = "do not (default: if on a terminal)"
    parser.add_argument("--no-open", dest="open", action="store_const", const=False, help=text)


def _run(found: Namespace) -> int:
    if not found.paths and not found.layout and not found.follow:
        found.parser.print_help()
        return 0
    if found.layout:
        if found.follow or found.out is not None:
            raise UserError("--layout: writes the file that is named last; must be without --follow and --out")
        return _layout(found.layout, found.paths)
    if found.follow:
        return _follow(found.paths, found.out, found.open)
    if len(found.paths) > 2:
        raise UserError(f"cmpc review takes one log or two; {len(found.paths)} were given")
    if Path(found.paths[0]).is_dir():
        if found.out is not None:
            raise UserError(
                "--out: names the page of a log; must be left out for a folder of results, which keeps its own"
            )
        return _campaign(found.paths, found.most, found.open)
    return _page([Path(path) for path in found.paths], found.out, found.open)


def _campaign(paths: list[str], most: int, wanted: bool | None) -> int:
    if len(paths) != 1:
        raise UserError(f"cmpc review DIR takes one folder of results; {len(paths)} paths were given")
    from sim.review.campaign import review_campaign
    from sim.terminal.console import note
    from sim.terminal.interrupt import stop_on_signal
    from sim.trials.run.recall import open_results

    with open_results(paths[0]) as results, stop_on_signal() as stop:
        page = review_campaign(results, Path(paths[0]), most, note, stop)
    print(page)
    _open(page, wanted)
    return 128 + stop.signum if stop.signum else 0


def _follow(paths: list[str], out: str | None, wanted: bool | None) -> int:
    if len(paths) != 1:
        raise UserError(f"cmpc review --follow takes one log; {len(paths)} were given")
    from sim.review.follow import follow_page

    log = Path(paths[0])
    if log.is_dir():
        raise UserError(f"cmpc review --follow {log}: is no log: it is a folder; must be RUN.mcap")
    target = Path(out) if out is not None else log.with_suffix(".html")
    if target.is_dir() or target.suffix == ".mcap":
        raise UserError(f"--out {target}: must be the name of an .html file")
    opened = False

    def tell(line: str) -> None:
        nonlocal opened
        print(line, flush=True)
        if not opened:
            _open(target, wanted)
            opened = True

    if not follow_page(log, target, tell):
        print(f"cmpc: warning: {log} has not grown for a while and has no end", file=sys.stderr)
    return 0


def _layout(viewer: str, paths: list[str]) -> int:
    if viewer == "rerun":
        return _recording(paths)
    if len(paths) != 1:
        raise UserError(f"cmpc review --layout {viewer} takes the one file to write; {len(paths)} were given")
    from sim.review.layouts import LAYOUTS

    target = Path(paths[0])
    try:
        with open(target, "x", encoding="utf-8") as file:
            file.write(LAYOUTS[viewer]())
    except FileExistsError:
        raise UserError(f"{target}: already exists and is never overwritten; choose another name") from None
    except OSError as error:
        raise UserError(f"{target}: cannot be written: {error.strerror}") from error
    print(target)
    return 0


def _recording(paths: list[str]) -> int:
    import importlib.util

    if len(paths) != 2 or not paths[1].endswith(".rrd"):
        raise UserError("cmpc review --layout rerun takes RUN.mcap and the .rrd file to write")
    if importlib.util.find_spec("rerun") is None:
        raise UserError('--layout rerun needs the packages of the extra "live": pip install "cmpc-walker[live]"')
    from sim.log.read import read_log
    from sim.review.rerun import write_recording

    write_recording(read_log(Path(paths[0])), Path(paths[1]))
    print(paths[1])
    return 0


def _page(paths: list[Path], out: str | None, wanted: bool | None) -> int:
    from sim.log.read import salvage
    from sim.log.tools.text import printable
    from sim.review.page import write_page

    logs = [salvage(path) for path in paths]
    for log in logs:
        for at, text in log.problems[:3]:
            print(f"cmpc: warning: {log.path} is damaged at byte {at}: {printable(text)}", file=sys.stderr)
    stem = paths[0].with_suffix("") if len(paths) == 1 else paths[0].with_name(f"{paths[0].stem}-{paths[1].stem}")
    target = Path(out) if out is not None else stem.with_name(stem.name + ".html")
    write_page(logs, target)
    print(f"{target} ({target.stat().st_size / 1e6:.1f} MB)")
    _open(target, wanted)
    return 0


def _open(page: Path, wanted: bool | None) -> None:
    """Open a page in the browser, if that is wanted, or on a terminal."""
    if wanted or (wanted is None and sys.stdout.isatty()):
        import webbrowser

        webbrowser.open(page.resolve().as_uri())
