"""`cmpc walker`: a folder for a walker of one's own, and its check from the files to the walk."""

import json
import os
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from rich.markup import escape

from sim.commands.options import add_json
from sim.errors import UserError
from sim.settings import flags
from sim.terminal.console import next_step

EPILOG = "exit code: 0, 1 for a walker that fails its check, 2 for bad input"


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc walker`."""
    parser = commands.add_parser("walker", description="A walker of one's own.", epilog=EPILOG)
    actions = parser.add_subparsers(metavar="COMMAND")

    text = "make a folder of a robot's file as published: URDF, MJCF, gaits/"
    new = actions.add_parser("new", help=text, description="Make a walker's folder from a robot's file as published.")
    new.set_defaults(run=_new)
    new.add_argument("folder", metavar="FOLDER", help="to be made; its name is the walker's")
    files = new.add_mutually_exclusive_group(required=True)
    for kind, ending in (("urdf", "urdf"), ("mjcf", "xml"), ("xacro", "xacro")):
        files.add_argument(f"--{kind}", metavar=f"FILE.{ending}", help="a torso and two legs of a hip and a knee")
    text = "which link is the torso, which joints left_hip, left_knee, right_hip, right_knee; where names do not tell"
    new.add_argument("--map", action="append", default=[], metavar="PART=NAME", help=text)
    text = "torque limits in N.m, where the file has none or others"
    new.add_argument("--torque", nargs=2, type=flags.real(above=0.0), metavar=("HIP", "KNEE"), help=text)
    text = "from knee to foot, where the file does not tell or tells another"
    new.add_argument("--tibia-length", type=flags.real(above=0.0), metavar="m", help=text)
    new.add_argument("--even-legs", action="store_true", help="make legs that differ by up to 5 %% equal")

    text = "topology, inertias, agreement of the models, gaits, walks"
    check = actions.add_parser("check", help=text, description="Check a walker from its files to its walk.")
    check.set_defaults(run=_check)
    check.add_argument("walker", metavar="NAME|FOLDER")
    text = "each gait must walk (default: 30)"
    check.add_argument("--steps", type=flags.whole(1), default=30, metavar="INT", help=text)
    add_json(check)


def _new(found: Namespace) -> int:
    from sim.bridge.convert import Given, new_walker

    names = {}
    for item in found.map:
        part, equals, name = item.partition("=")
        if not (equals and part and name):
            raise UserError(f"--map {item}: must be PART=NAME, such as torso=base_link")
        names[part] = name
    given = Given(
        torque=tuple(found.torque) if found.torque else None,
        even_legs=found.even_legs,
        tibia_length=found.tibia_length,
        names=names,
    )
    kinds: tuple[Literal["urdf", "mjcf", "xacro"], ...] = ("urdf", "mjcf", "xacro")
    kind, file = next((kind, getattr(found, kind)) for kind in kinds if getattr(found, kind))
    folder = Path(found.folder)
    model, apart = new_walker(folder, Path(file), kind, given, show=_show)
    where = found.folder if "/" in found.folder or os.sep in found.folder else f"./{found.folder}"
    print(
        f"{folder}: {folder.name}.urdf, {folder.name}.xml, README.md, gaits/; {model.lumped.mass:g} kg, "
        f"legs of {model.leg_length:g} m; within {max(apart.values()):.1e} of the file\n"
        f"next: cmpc gait design --walker {where} --step-length "
        f"{0.5 * model.leg_length:.2g} --speed {model.leg_length:.2g}\nthen: cmpc walker check {where}"
    )
    return 0


def _show(rows: Sequence[Any]) -> None:
    """Print the table of a conversion."""
    if not rows:
        return
    from rich.console import Console
    from rich.table import Table

    table = Table()
    for column in ("part", "found", "made of it", ""):
        table.add_column(column, overflow="fold")
    for row in sorted(rows, key=lambda row: row.stops):
        table.add_row(
            *(escape(cell) for cell in (row.part, row.found, row.made)),
            row.verdict.upper() if row.stops else row.verdict,
        )
    Console(highlight=False, width=None if sys.stdout.isatty() else 170).print(table)


def _check(found: Namespace) -> int:
    from sim.bridge.walker import FIRST_CAUSE, check_walker

    lines: list[dict[str, Any]] = []

    def show(stage: Any) -> None:
        lines.append({"name": stage.name, "found": stage.found, "holds": stage.holds})
        if not found.json:
            print(f"{'ok  ' if stage.holds else 'FAIL'}  {stage.name}: {stage.found}", flush=True)

    passed = check_walker(found.walker, steps=found.steps, say=show)
    failed = [line for line in lines if not line["holds"]]
    first = next((line for line in failed if line["name"] == FIRST_CAUSE), failed[0] if failed else None)
    if found.json:
        print(json.dumps({"passed": passed, "stages": lines, "first_cause": first}))
    elif first:
        print(f"the walker fails its check; {first['name']}: {first['found']}", file=sys.stderr)
    else:
        next_step(f"cmpc run undisturbed --walker {found.walker}")
    return 0 if passed else 1
