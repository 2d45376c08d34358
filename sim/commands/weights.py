"""`cmpc weights`: search for the weights and the horizon of C-MPC."""

import json
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.commands.options import add_out
from sim.settings import flags
from sim.terminal.console import next_step, note

SEARCH = """\
Weights and horizon of C-MPC that survive most: the score is the mean share of steps completed over random trials in
MuJoCo, the same for every candidate. The result is a scenario (cmpc run FILE.toml) with the evidence in its comments,
on the draws of the search and on others held out; FILE.jsonl beside it holds every evaluation, and the same command
goes on from there. For the gains of ZD+PD: cmpc gains search.
"""

EVALUATIONS, HELD_OUT = 46, 5


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc weights`."""
    parser = commands.add_parser("weights", description="Weights and horizon of C-MPC.")
    search = parser.add_subparsers(metavar="COMMAND").add_parser("search", help="search them", description=SEARCH)
    search.set_defaults(run=_search)
    text = "its Monte-Carlo studies are the trials (default: weights)"
    search.add_argument("--plan", default="weights", metavar="NAME|FILE.toml", help=text)
    text = "walker, gait and controller to start from, not the plan's"
    search.add_argument("--scenario", metavar="NAME|FILE.toml", help=text)
    text = f"in all (default: {EVALUATIONS})"
    search.add_argument("--evaluations", type=flags.whole(1), default=EVALUATIONS, metavar="INT", help=text)
    text = f"times the draws to judge by (default: {HELD_OUT})"
    search.add_argument("--held-out", type=flags.whole(1), default=HELD_OUT, metavar="INT", help=text)
    search.add_argument("--workers", type=flags.whole(1), metavar="INT", help="processes (default: one a core)")
    add_out(search)


def _search(found: Namespace) -> int:
    from sim.runner import cores
    from sim.trials.plan import load_plan
    from sim.trials.weights import search_weights, start_from

    plan = load_plan(found.plan)
    result = search_weights(
        start_from(plan, found.scenario) if found.scenario else plan,
        evaluations=found.evaluations,
        seed=found.seed,
        held_out=found.held_out,
        workers=found.workers or cores(),
        out=Path(found.out),
        say=note,
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
    next_step(f"cmpc run {found.out}")
    return 0
