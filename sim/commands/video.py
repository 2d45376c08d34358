"""`cmpc video`: a film or a picture of a run or two, without a display."""

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.errors import UserError

USAGE = "cmpc video RUN.mcap [B.mcap] OUT.mp4|.gif|.png [options]"
DESCRIPTION = "Draw a run with the plant's own model, or two side by side; the camera follows the walker."
EPILOG = """\
  cmpc video RUN.mcap walk.mp4
  cmpc video FALL.mcap fall.mp4 --slow 0.25             slow motion around the moment at which the fall begins
  cmpc video A.mcap B.mcap both.gif --size 800 320 --fps 20
  cmpc video RUN.mcap walk.png --strobe 9 --size 1600 480
  cmpc video RUN.mcap moment.png --start 0.35 --plain

Green arrows are contact forces (1 m for 1000 N), red ones pushes (1 m for 80 N). Bars say how much of a joint's
torque and of the ground's friction is used. Of two runs the one that ends first stays as it ended.
Needs pip install "cmpc-walker[video]" and OpenGL (EGL or OSMesa; MUJOCO_GL chooses).

exit code: 0 done, 2 bad input or something is missing
"""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc video`."""
    parser = commands.add_parser("video", usage=USAGE, description=DESCRIPTION, epilog=EPILOG)
    parser.set_defaults(run=_run)
    text = "a log or two, and the film (.mp4, .gif) or picture (.png)"
    parser.add_argument("paths", nargs="*", metavar="RUN.mcap", help=text)
    parser.add_argument("--start", type=float, default=0.0, metavar="s", help="first moment (default: 0)")
    parser.add_argument("--end", type=float, metavar="s", help="last moment (default: the end of the run)")
    parser.add_argument("--speed", type=float, default=1.0, metavar="ratio", help="speed of the film (default: 1)")
    text = "share of that speed around the onset of a fall (default: 1)"
    parser.add_argument("--slow", type=float, default=1.0, metavar="ratio", help=text)
    parser.add_argument("--fps", type=float, default=30.0, metavar="1/s", help="pictures a second (default: 30)")
    parser.add_argument("--size", type=int, nargs=2, default=(1280, 720), metavar="pixel", help="width and height")
    parser.add_argument("--strobe", type=int, metavar="N", help="N moments in one .png")
    parser.add_argument("--plain", action="store_true", help="without words and bars")


def _run(found: Namespace) -> int:
    if not found.paths:
        found.parser.print_help()
        return 0
    *names, out = found.paths
    if not 1 <= len(names) <= 2 or out.endswith(".mcap"):
        raise UserError("cmpc video takes RUN.mcap, perhaps a second log, and the file to write, .mp4, .gif or .png")
    if found.strobe is not None and len(names) == 2:
        raise UserError("cmpc video --strobe takes one log; 2 were given")
    from sim.log.read import read_log
    from sim.review.film import film, strobe

    target, size = Path(out), (found.size[0], found.size[1])
    logs = [read_log(Path(name)) for name in names]
    when: dict[str, Any] = {"size": size, "start": found.start, "end": found.end, "plain": found.plain}
    if found.strobe is not None:
        count = strobe(logs[0], target, count=found.strobe, **when)
    else:
        count = film(logs, target, fps=found.fps, speed=found.speed, slow=found.slow, **when)
    what = "moments" if found.strobe is not None else "pictures"
    print(f"{target} ({count} {what}, {target.stat().st_size / 1e6:.1f} MB)")
    return 0
