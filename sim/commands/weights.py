"""`cmpc weights`: search for the weights and the horizon of C-MPC."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from sim.errors import UserError
from sim.settings import flags

HELP = """\
usage: cmpc weights search --out FILE.toml [options]

Weights and horizon of C-MPC that survive most: the score is the mean share of steps completed over random trials in
MuJoCo, the same for every candidate. The result is a scenario (cmpc run FILE.toml) with the evidence in its comments,
on the draws of the search and on others held out; FILE.jsonl beside it holds every evaluation, and the same command
goes on from there. For the gains of ZD+PD: cmpc gains search.
"""

EVALUATIONS, HELD_OUT = 46, 5


def main(argv: Sequence[str]) -> int:
    """Run `cmpc weights`; returns the exit code."""
    if not argv or argv[0] in ("-h", "--help"):
        print(HELP, end="")
        return 0
    if argv[0] != "search":
        raise UserError(f"cmpc weights {argv[0]}: unknown; legal: search")
    parser = flags.Parser(prog="cmpc weights search", description="Search weights and horizon; seeded and resumable.")
    parser.add_argument("-h", "--help", action="help", help="show this")
    parser.add_argument(
        "--plan", default="weights", metavar="NAME|FILE.toml", help="its Monte-Carlo studies are the trials"
    )
    parser.add_argument(
        "--scenario", metavar="NAME|FILE.toml", help="walker, gait and controller to start from, not the plan's"
    )
    parser.add_argument("--evaluations", type=int, default=EVALUATIONS, metavar="INT", help=f"(default: {EVALUATIONS})")
    parser.add_argument("--seed", type=int, default=0, metavar="INT", help="of the optimiser (default: 0)")
    parser.add_argument(
        "--held-out", type=int, default=HELD_OUT, metavar="INT", help=f"times the draws to judge by ({HELD_OUT})"
    )
    parser.add_argument("--workers", type=int, metavar="INT", help="processes (default: one a core)")
    parser.add_argument("--out", required=True, metavar="FILE.toml", help="the result")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    found = parser.parse(argv[1:])
    for flag, value, least in (
        ("--evaluations", found.evaluations, 1),
        ("--held-out", found.held_out, 1),
        ("--workers", found.workers, 1),
        ("--seed", found.seed, 0),
    ):
        if value is not None and value < least:
            raise UserError(f"{flag} {value}; legal: {least} or above")

    from sim.trials.plan import load_plan
    from sim.trials.run.campaign import cores
    from sim.trials.weights import search_weights, start_from

    plan = load_plan(found.plan)
    result = search_weights(
        start_from(plan, found.scenario) if found.scenario else plan,
        evaluations=found.evaluations,
        seed=found.seed,
        held_out=found.held_out,
        workers=found.workers or cores(),
        out=Path(found.out),
        say=lambda line: print(line, file=sys.stderr, flush=True),
    )
    if found.json:
        print(json.dumps(result))
        return 0
    for name in ("start", "found"):
        row = result[name]
        print(name, *(f"  {path} = {value}" for path, value in row["settings"].items()), sep="\n")
        for draws, words in (("search", "draws of the search"), ("held_out", "draws held out")):
            score = row[draws]
            print(f"  {words}: score {score['value']:.3f}, {score['survived']} of {score['trials']} survive")
    pairs = result["paired"]
    print(
        f"on the draws held out a gain of {pairs['mean']:+.3f}, standard error {pairs['standard_error']:.3f}, "
        "trial by trial\n"
        f"of them, the start alone survives {pairs['start_alone']}, the found alone "
        f"{pairs['found_alone']} (McNemar's p = {pairs['p']:.2g})"
    )
    print(found.out)
    return 0
