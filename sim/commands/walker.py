"""`cmpc walker`: a folder for a walker of one's own, and its check from the files to the walk."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.errors import UserError
from sim.settings import flags

HELP = """\
usage: cmpc walker new   FOLDER --urdf FILE.urdf    make the folder: the URDF, an MJCF that agrees with it, gaits/
       cmpc walker check NAME|FOLDER [options]      topology, inertias, agreement of the models, gaits, walks

cmpc walker SUBCOMMAND --help shows the options. Exit code: 0, 1 for a walker that fails its check, 2 for bad input.
"""


def main(argv: Sequence[str]) -> int:
    """Run `cmpc walker`; returns the exit code."""
    commands = {"new": _new, "check": _check}
    if not argv or argv[0] in ("-h", "--help"):
        print(HELP, end="")
        return 0
    if argv[0] not in commands:
        raise UserError(f"cmpc walker {argv[0]}: unknown; legal: {', '.join(commands)}")
    return commands[argv[0]](argv[1:])


def _new(argv: Sequence[str]) -> int:
    parser = flags.Parser(prog="cmpc walker new", description="Make a walker's folder from its URDF.")
    parser.add_argument("-h", "--help", action="help", help="show this")
    parser.add_argument("folder", metavar="FOLDER", help="to be made; its name is the walker's")
    parser.add_argument("--urdf", required=True, metavar="FILE.urdf", help="five links, conventions of models/rabbit")
    found = parser.parse(argv)

    from sim.bridge.walker import new_walker

    folder = Path(found.folder)
    model = new_walker(folder, Path(found.urdf))
    where = found.folder if "/" in found.folder else f"./{found.folder}"
    print(
        f"{folder}: {folder.name}.urdf, {folder.name}.xml, README.md, gaits/; {model.lumped.mass:g} kg, "
        f"legs of {model.leg_length:g} m\nnext: cmpc gait design --walker {where} --step-length "
        f"{0.5 * model.leg_length:.2g} --speed {model.leg_length:.2g}\nthen: cmpc walker check {where}"
    )
    return 0


def _check(argv: Sequence[str]) -> int:
    parser = flags.Parser(prog="cmpc walker check", description="Check a walker from its files to its walk.")
    parser.add_argument("-h", "--help", action="help", help="show this")
    parser.add_argument("walker", metavar="NAME|FOLDER")
    parser.add_argument("--steps", type=int, default=30, metavar="INT", help="each gait must walk (default: 30)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    found = parser.parse(argv)
    if found.steps < 1:
        raise UserError(f"--steps {found.steps}; legal: 1 or above")

    from sim.bridge.walker import check_walker

    lines: list[dict[str, Any]] = []

    def say(stage: Any) -> None:
        lines.append({"name": stage.name, "found": stage.found, "holds": stage.holds})
        if not found.json:
            print(f"{'ok  ' if stage.holds else 'FAIL'}  {stage.name}: {stage.found}", flush=True)

    passed = check_walker(found.walker, steps=found.steps, say=say)
    if found.json:
        print(json.dumps({"passed": passed, "stages": lines}))
    elif not passed:
        print("the walker fails its check", file=sys.stderr)
    return 0 if passed else 1
