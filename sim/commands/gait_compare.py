"""`cmpc gait compare`: two gaits of one walker, coefficient by coefficient and cost by cost."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.settings import flags

HELP = "Two gaits of one walker: coefficients, step, forces and every cost side by side."


def main(argv: Sequence[str]) -> int:
    """Run `cmpc gait compare`; returns the exit code."""
    parser = flags.Parser(prog="cmpc gait compare", description=HELP)
    parser.add_argument("-h", "--help", action="help", help="show this")
    parser.add_argument("first", metavar="NAME|FILE.toml")
    parser.add_argument("second", metavar="NAME|FILE.toml")
    parser.add_argument("--walker", metavar="NAME|FOLDER", help="default: the folder the first lies in, or rabbit")
    parser.add_argument("--plot", metavar="FILE.png", help="draw both")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    found = parser.parse(argv)

    from sim.bridge import gaits as compose_design

    first, second = compose_design.beliefs((found.first, found.second), found.walker)
    comparison = compose_design.compare_gaits(first, second)
    if found.plot:
        compose_design.plot_gaits(Path(found.plot), first.model, comparison)
    if found.json:
        print(json.dumps(_as_dict(first, second, comparison)))
    else:
        _print(comparison)
    return 0


def _as_dict(first: Any, second: Any, found: Any) -> dict[str, Any]:
    return {
        "first": str(first.path),
        "second": str(second.path),
        "alpha_rad": {"first": found.alpha[0].tolist(), "second": found.alpha[1].tolist()},
        "apart_rad": found.apart.tolist(),
        "largest_apart_rad": float(abs(found.apart).max()),
        "rms_apart_rad": found.rms_apart,
        "measures": {m.name: {"first": m.first, "second": m.second} for m in found.measures},
    }


def _print(found: Any) -> None:
    from rich.console import Console
    from rich.table import Table

    from sim.bridge.gaits import ROLES

    console = Console(highlight=False, width=None if sys.stdout.isatty() else 140)
    names = found.first.name, found.second.name
    table = Table(title="Bezier coefficients [rad]", title_justify="left")
    for column in ("", "", *(f"alpha_{k}" for k in range(found.alpha.shape[2]))):
        table.add_column(column, justify="right" if column else "left")
    for i, role in enumerate(ROLES):
        for first_column, name, rows in ((role, names[0], found.alpha[0]), ("", names[1], found.alpha[1])):
            table.add_row(first_column, name, *(f"{x:.4f}" for x in rows[i]))
        table.add_row("", "difference", *(f"{x:+.4f}" for x in found.apart[i]), end_section=True)
    console.print(table)
    console.print(f"apart by {found.rms_apart:.4f} rad (RMS), at most {abs(found.apart).max():.4f} rad")
    table = Table(title="measures of the periodic orbits", title_justify="left")
    for column in ("", *names, "ratio", "unit"):
        table.add_column(column, justify="right" if column in (*names, "ratio") else "left")
    for m in found.measures:
        table.add_row(
            m.words,
            f"{m.first:.4g}",
            f"{m.second:.4g}",
            f"{m.second / m.first:.3f}" if m.name != "off_orbit_rad_s" else "",
            m.unit,
        )
    console.print(table)
