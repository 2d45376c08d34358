"""`cmpc gains`: search for the gains of ZD+PD."""

import json
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.commands.options import add_out
from sim.settings import flags
from sim.terminal.console import next_step, note

SEARCH = """\
K_P and K_D that minimise the largest eigenvalue of the sampled closed loop's Poincare map; seeded and resumable. The
result is a scenario (cmpc run FILE.toml) with the evidence in its comments; FILE.jsonl beside it holds every
evaluation, and the same command goes on from there.
"""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc gains`."""
    parser = commands.add_parser("gains", description="Gains of ZD+PD.")
    search = parser.add_subparsers(metavar="COMMAND").add_parser("search", help="search them", description=SEARCH)
    search.set_defaults(run=_search)
    search.add_argument("--walker", default="rabbit", metavar="NAME|FOLDER", help="default: rabbit")
    search.add_argument("--gait", default="paper-polished", metavar="NAME|FILE.toml", help="default: paper-polished")
    for flag, unit in (("--kp", "1/s^2"), ("--kd", "1/s")):
        search.add_argument(
            flag, type=flags.real(above=0.0), nargs=4, default=[20.0] * 4, metavar=unit, help="start (default: 20)"
        )
    text = "sampling period (default: 0.001)"
    search.add_argument("--period", type=flags.real(above=0.0, most=0.02), default=1e-3, metavar="s", help=text)
    search.add_argument("--evaluations", type=flags.whole(1), default=300, metavar="INT", help="in all (default: 300)")
    add_out(search)


def _search(found: Namespace) -> int:
    from sim.bridge.gains import search_gains

    result = search_gains(
        found.walker,
        found.gait,
        kp=found.kp,
        kd=found.kd,
        period=found.period,
        evaluations=found.evaluations,
        seed=found.seed,
        out=Path(found.out),
        say=note,
    )
    if found.json:
        print(json.dumps(result))
        return 0
    for name in ("start", "paper", "found"):
        row = result[name]
        print(f"{name:<6} K_P = {_row(row['kp'])}  K_D = {_row(row['kd'])}")
        sizes = ", ".join(f"{x:.4f}" for x in row["eigenvalues"][:4]) or "does not walk"
        print(f"       eigenvalues {sizes}, ...; torque beyond limits when disturbed: {row['torque_excess']:.1%}")
    print(found.out)
    next_step(f"cmpc run {found.out}")
    return 0


def _row(values: Sequence[float]) -> str:
    return " ".join(f"{x:7.2f}" for x in values)
