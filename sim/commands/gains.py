"""`cmpc gains`: search for the gains of ZD+PD."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from sim.errors import UserError
from sim.settings import flags

HELP = """\
usage: cmpc gains search --out FILE.toml [options]

K_P and K_D that minimise the largest eigenvalue of the sampled closed loop's Poincare map. The result is a scenario
(cmpc run FILE.toml) with the evidence in its comments; FILE.jsonl beside it holds every evaluation, and the same
command goes on from there.
"""


def main(argv: Sequence[str]) -> int:
    """Run `cmpc gains`; returns the exit code."""
    if not argv or argv[0] in ("-h", "--help"):
        print(HELP, end="")
        return 0
    if argv[0] != "search":
        raise UserError(f"cmpc gains {argv[0]}: unknown; legal: search")
    parser = flags.Parser(prog="cmpc gains search", description="Search K_P and K_D; seeded and resumable.")
    parser.add_argument("-h", "--help", action="help", help="show this")
    parser.add_argument("--walker", default="rabbit", metavar="NAME|FOLDER", help="default: rabbit")
    parser.add_argument("--gait", default="paper-polished", metavar="NAME|FILE.toml", help="default: paper-polished")
    parser.add_argument("--kp", type=float, nargs=4, default=[20.0] * 4, metavar="1/S^2", help="start (default: 20)")
    parser.add_argument("--kd", type=float, nargs=4, default=[20.0] * 4, metavar="1/S", help="start (default: 20)")
    parser.add_argument("--period", type=float, default=1e-3, metavar="S", help="sampling period (default: 0.001)")
    parser.add_argument("--evaluations", type=int, default=300, metavar="INT", help="in all (default: 300)")
    parser.add_argument("--seed", type=int, default=0, metavar="INT", help="default: 0")
    parser.add_argument("--out", required=True, metavar="FILE.toml", help="the result")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    found = parser.parse(argv[1:])
    if min(*found.kp, *found.kd) <= 0.0:
        raise UserError("--kp, --kd: a gain is not above 0; legal: above 0 [1/s^2], [1/s]")
    for flag, value, legal in (
        ("--evaluations", found.evaluations, found.evaluations >= 1),
        ("--period", found.period, 0.0 < found.period <= 0.02),
        ("--seed", found.seed, found.seed >= 0),
    ):
        if not legal:
            raise UserError(f"{flag} {value}; legal: evaluations 1 or above, period 0 to 0.02 s, seed 0 or above")

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
        say=lambda line: print(line, file=sys.stderr, flush=True),
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
    return 0


def _row(values: Sequence[float]) -> str:
    return " ".join(f"{x:7.2f}" for x in values)
