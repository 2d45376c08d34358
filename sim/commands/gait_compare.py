"""`cmpc gait compare`: two gaits of one walker, coefficient by coefficient and cost by cost."""

import json
from argparse import Namespace
from pathlib import Path
from typing import Any

from sim.commands.options import add_json
from sim.terminal import console

HELP = "Two gaits of one walker: coefficients, step, forces and every cost side by side."


def add_parser(actions: Any) -> None:
    """Add the parser of `cmpc gait compare`."""
    text = "two gaits, coefficient by coefficient, cost by cost"
    parser = actions.add_parser("compare", help=text, description=HELP)
    parser.set_defaults(run=_compare)
    parser.add_argument("first", metavar="NAME|FILE.toml")
    parser.add_argument("second", metavar="NAME|FILE.toml")
    parser.add_argument("--walker", metavar="NAME|FOLDER", help="default: the folder the first lies in, or rabbit")
    parser.add_argument("--plot", metavar="FILE.png", help="draw both")
    add_json(parser)


def _compare(found: Namespace) -> int:
    from sim.bridge import gaits

    first, second = gaits.beliefs((found.first, found.second), found.walker)
    comparison = gaits.compare_gaits(first, second)
    if found.plot:
        gaits.plot_gaits(Path(found.plot), first.model, comparison)
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
    from sim.bridge.gaits import ROLES

    names = found.first.name, found.second.name
    columns = [f"alpha_{k}" for k in range(found.alpha.shape[2])]
    table = console.table("", " ", *columns, title="Bezier coefficients [rad]", right=tuple(columns))
    for i, role in enumerate(ROLES):
        for first_column, name, rows in ((role, names[0], found.alpha[0]), ("", names[1], found.alpha[1])):
            table.add_row(first_column, name, *(f"{x:.4f}" for x in rows[i]))
        table.add_row("", "difference", *(f"{x:+.4f}" for x in found.apart[i]), end_section=True)
    console.show(table)
    console.show(f"apart by {found.rms_apart:.4f} rad (RMS), at most {abs(found.apart).max():.4f} rad")
    title = "measures of the periodic orbits"
    table = console.table("", *names, "ratio", "unit", title=title, right=(*names, "ratio"))
    for m in found.measures:
        ratio = f"{m.second / m.first:.3f}" if m.name != "off_orbit_rad_s" else ""
        table.add_row(m.words, f"{m.first:.4g}", f"{m.second:.4g}", ratio, m.unit)
    console.show(table)
