"""`cmpc video`: a film or a picture of a run, without a display."""

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.errors import UserError

USAGE = "cmpc video RUN.mcap OUT.mp4|.gif|.png [options]"
DESCRIPTION = "Draw a run with the plant's own model; the camera follows the walker."
EPILOG = """\
  cmpc video RUN.mcap walk.mp4
  cmpc video RUN.mcap push.gif --start 0.2 --end 1.2 --speed 0.25 --size 640 360 --fps 25
  cmpc video RUN.mcap moment.png --start 0.35

Green arrows are contact forces (1 m for 1000 N), red ones pushes (1 m for 80 N).
Needs pip install "cmpc-walker[video]" and OpenGL (EGL or OSMesa; MUJOCO_GL chooses).

exit code: 0 done, 2 bad input or something is missing
"""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc video`."""
    parser = commands.add_parser("video", usage=USAGE, description=DESCRIPTION, epilog=EPILOG)
    parser.set_defaults(run=_run)
    parser.add_argument("log", nargs="?", metavar="RUN.mcap", help="the log")
    parser.add_argument("out", nargs="?", metavar="OUT", help="the film (.mp4, .gif) or picture (.png)")
    parser.add_argument("--start", type=float, default=0.0, metavar="s", help="first moment (default: 0)")
    parser.add_argument("--end", type=float, metavar="s", help="last moment (default: the end of the run)")
    parser.add_argument("--speed", type=float, default=1.0, metavar="ratio", help="speed of the film (default: 1)")
    parser.add_argument("--fps", type=float, default=30.0, metavar="1/s", help="pictures a second (default: 30)")
    parser.add_argument("--size", type=int, nargs=2, default=(1280, 720), metavar="pixel", help="width and height")


def _run(found: Namespace) -> int:
    if found.log is None:
        found.parser.print_help()
        return 0
    if found.out is None:
        raise UserError("cmpc video takes RUN.mcap and the file to write, .mp4, .gif or .png")
    from sim.log.read import read_log
    from sim.review.film import film

    target = Path(found.out)
    width, height = found.size
    count = film(
        read_log(Path(found.log)),
        target,
        fps=found.fps,
        size=(width, height),
        speed=found.speed,
        start=found.start,
        end=found.end,
    )
    print(f"{target} ({count} pictures, {target.stat().st_size / 1e6:.1f} MB)")
    return 0
