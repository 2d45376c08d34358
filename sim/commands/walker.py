"""`cmpc walker`: a folder for a walker of one's own, and its check from the files to the walk."""

import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.commands.options import add_json
from sim.settings import flags

EPILOG = "exit code: 0, 1 for a walker that fails its check, 2 for bad input"


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc walker`."""
    parser = commands.add_parser("walker", description="A walker of one's own.", epilog=EPILOG)
    actions = parser.add_subparsers(metavar="COMMAND")

    text = "make a folder: the URDF, an MJCF that agrees with it, gaits/"
    new = actions.add_parser("new", help=text, description="Make a walker's folder from its URDF.")
    new.set_defaults(run=_new)
    new.add_argument("folder", metavar="FOLDER", help="to be made; its name is the walker's")
    new.add_argument("--urdf", required=True, metavar="FILE.urdf", help="five links, conventions of models/rabbit")

    text = "topology, inertias, agreement of the models, gaits, walks"
    check = actions.add_parser("check", help=text, description="Check a walker from its files to its walk.")
    check.set_defaults(run=_check)
    check.add_argument("walker", metavar="NAME|FOLDER")
    text = "each gait must walk (default: 30)"
    check.add_argument("--steps", type=flags.whole(1), default=30, metavar="INT", help=text)
    add_json(check)


def _new(found: Namespace) -> int:
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


def _check(found: Namespace) -> int:
    from sim.bridge.walker import check_walker

    lines: list[dict[str, Any]] = []

    def show(stage: Any) -> None:
        lines.append({"name": stage.name, "found": stage.found, "holds": stage.holds})
        if not found.json:
            print(f"{'ok  ' if stage.holds else 'FAIL'}  {stage.name}: {stage.found}", flush=True)

    passed = check_walker(found.walker, steps=found.steps, say=show)
    if found.json:
        print(json.dumps({"passed": passed, "stages": lines}))
    elif not passed:
        print("the walker fails its check", file=sys.stderr)
    return 0 if passed else 1
