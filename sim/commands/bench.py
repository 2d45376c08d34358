"""`cmpc bench`: what ticks, solves and runs cost on this machine, against the targets."""

import json
import os
import platform
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sim.commands.options import add_json
from sim.terminal import console

if TYPE_CHECKING:
    from sim.bench.figure import Figure


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc bench`."""
    parser = commands.add_parser("bench", description=__doc__)
    parser.set_defaults(run=_run)
    parser.add_argument("--quick", action="store_true", help="shorter runs, noisier figures, no verdicts")
    parser.add_argument("--controller", metavar="KIND", help="ticks of this controller alone, such as ./mine.py:make")
    add_json(parser, "the figures")


def _run(found: Namespace) -> int:
    from sim.bench.ticks import benchmark, ticks_of

    if found.controller is not None:
        console.note(f"ticks of {found.controller}")
        show(ticks_of(found.controller, quick=found.quick), as_json=found.json)
        return 0
    figures = benchmark(quick=found.quick, say=console.note)
    if found.quick:  # its runs are too short to be held against targets
        figures = [replace(figure, target="") for figure in figures]
    show(figures, as_json=found.json)
    return 0


def show(figures: Sequence["Figure"], *, as_json: bool) -> None:
    """Print figures against their targets, as a table or as one JSON object."""
    if as_json:
        rows = [
            {
                "name": f.name,
                "value": f.value,
                "unit": f.unit,
                "target": f.target,
                "holds": f.holds,
                "over_four_substeps": f.multiple,
            }
            for f in figures
        ]
        print(json.dumps({"machine": _machine(), "figures": rows}))
        return
    columns = ("figure", "measured", "unit", "x 4 substeps", "target", "")
    table = console.table(*columns, title=_machine(), right=("measured", "x 4 substeps"))
    verdicts = {True: "holds", False: "missed", None: ""}
    for figure in figures:
        multiple = "" if figure.multiple is None else f"{figure.multiple:.3g}"
        verdict = verdicts[figure.holds]
        table.add_row(figure.name, f"{figure.value:.4g}", figure.unit, multiple, figure.target, verdict)
    console.show(table, 120)


def _machine() -> str:
    return f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}"
