"""`cmpc bench`: what ticks, solves and runs cost on this machine, against the targets."""

import argparse
import json
import os
import platform
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim.bench.ticks import Figure


def main(argv: Sequence[str]) -> int:
    """Run `cmpc bench`; returns the exit code."""
    parser = argparse.ArgumentParser(prog="cmpc bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="shorter runs, noisier figures, about a minute")
    parser.add_argument("--json", action="store_true", help="print the figures as one JSON object")
    found = parser.parse_args(argv)

    from sim.bench.ticks import benchmark

    def say(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    figures = benchmark(quick=found.quick, say=say)
    show(figures, as_json=found.json)
    return 0


def show(figures: Sequence["Figure"], *, as_json: bool) -> None:
    """Print figures against their targets, as a table or as one JSON object."""
    if as_json:
        rows = [
            {"name": f.name, "value": f.value, "unit": f.unit, "target": f.target, "holds": f.holds} for f in figures
        ]
        print(json.dumps({"machine": _machine(), "figures": rows}))
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(title=_machine(), title_justify="left")
    for column in ("figure", "measured", "unit", "target", ""):
        table.add_column(column, justify="right" if column == "measured" else "left")
    verdicts = {True: "holds", False: "missed", None: ""}
    for figure in figures:
        table.add_row(figure.name, f"{figure.value:.4g}", figure.unit, figure.target, verdicts[figure.holds])
    Console(highlight=False, width=None if sys.stdout.isatty() else 120).print(table)


def _machine() -> str:
    return f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}"
