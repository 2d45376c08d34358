"""Options for a plan's study of the nearest fall: other seeds (--repeat), plain draws (--check-crude), more --pairs."""

import re
from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sim.commands.campaign import run_campaign
from sim.errors import UserError
from sim.settings import flags
from sim.terminal.console import note

if TYPE_CHECKING:
    from sim.trials.plan import Plan
    from sim.trials.report.reliability_findings import ReliabilityFindings


def add_checks(parser: flags.Parser) -> None:
    """Add the options of both checks, and of more pairs of axes."""
    text = "the plan's [[reliability]] study under INT seeds, each in DIR/seed-K, and the spread of its distance"
    parser.add_argument("--repeat", type=flags.whole(2), metavar="INT", help=text)
    text = "the [[reliability]] study against INT plain draws, in DIR/crude-INT: nearest fall and share of falls"
    parser.add_argument("--check-crude", type=flags.whole(10), metavar="INT", help=text)
    text = '"axis, axis; axis, axis": planes to search all around too, also of a study that is over'
    parser.add_argument("--pairs", metavar="LIST", help=text)


def with_pairs(plan: "Plan", text: str, out: Path) -> "Plan":
    """A plan whose study goes on to the planes of more pairs of axes.

    Args:
        plan: The plan.
        text: "axis, axis" for each, with semicolons between.
        out: Folder of its results; pairs that its study has there stay.

    Raises:
        UserError: the plan has no study of the nearest fall, or no such axes; the text names none.
    """
    from sim.trials.run.folder import FILE
    from sim.trials.run.recall import stored_plan

    study = _only(plan).reliability[0]
    pairs = list(study.pairs)
    if (out / FILE).is_file():
        there = stored_plan(out).reliability
        pairs = [pair for other in there if other.name == study.name for pair in other.pairs] or pairs
    asked = [pair.strip() for pair in text.split(";") if pair.strip()]
    if not asked:
        raise UserError(f'--pairs {text!r}: names no pair; must be "axis, axis", with semicolons between several')
    every = tuple(dict.fromkeys([*pairs, *asked]))
    return replace(plan, reliability=(replace(study, pairs=every), *plan.reliability[1:]))


def repeat(plan: "Plan", out: Path, found: Namespace) -> int:
    """Run a plan's study under several seeds, from the plan's own on, and print how far they differ; the exit code.

    Raises:
        UserError: the plan has no such study; as `run_campaign`.
    """
    from sim.trials.report.reliability_checks import repeats

    plan = _only(plan)
    seeds = range(plan.seed, plan.seed + found.repeat)
    each = []
    for seed in seeds:
        folder = out / f"seed-{seed}"
        note(f"seed {seed}")
        code = run_campaign(replace(plan, seed=seed), folder, found)
        if code:
            return code
        each.append(_findings(folder))
    for one in repeats(seeds, each):
        print("\n".join(one.lines))
    return 0


def check_crude(plan: "Plan", out: Path, found: Namespace) -> int:
    """Compare a plan's study with plain draws and print both; the exit code.

    A study whose results are in the folder is not run again, whatever else its plan holds.

    Args:
        plan: The plan.
        out: Folder of its results.
        found: Options; `controllers` says which to compare.

    Raises:
        UserError: the plan has no such study; as `run_campaign`.
    """
    from sim.trials.report.reliability_checks import crude_checks
    from sim.trials.run.recall import open_results

    plan = _only(plan)
    plain = _plain(plan, found.check_crude)
    theirs = _known(plan, out)
    if theirs is None:
        code = run_campaign(plan, out, found)
        if code:
            return code
        theirs = _findings(out)
    which = "-" + "-".join(plan.controllers) if found.controllers is not None else ""
    folder = out / re.sub(r"[^\w.-]", "_", f"crude-{found.check_crude}{which}")
    code = run_campaign(plain, folder, found)
    if code:
        return code
    with open_results(folder) as results:
        checks = crude_checks(theirs, results, results.plan.reliability[0])
    for one in checks:
        print("\n".join(one.lines))
    return 0


def _plain(plan: "Plan", draws: int) -> "Plan":
    """A plan's study as plain draws alone.

    Raises:
        UserError: so many draws are not legal.
    """
    study = plan.reliability[0]
    crude = replace(
        study, name=f"{study.name} crude", draws=draws, rays=0, scales=(), modes=0, pairs=(), probability="importance"
    )
    try:
        return replace(plan, name=f"{plan.name}, plain draws", reliability=(crude,))
    except UserError as error:
        raise UserError(f"--check-crude {draws}: {error}") from None


def _only(plan: "Plan") -> "Plan":
    if not plan.reliability:
        raise UserError(
            f"plan {plan.name!r}: has no [[reliability]] study; --repeat, --check-crude and --pairs need one"
        )
    return replace(plan, grid=(), margin=(), montecarlo=(), certificate=(), reliability=plan.reliability[:1])


def _known(plan: "Plan", out: Path) -> "ReliabilityFindings | None":
    """What the whole study found for all controllers of a plan, if a folder holds that."""
    from sim.trials.plan.plan import differences
    from sim.trials.run.folder import FILE
    from sim.trials.run.recall import stored_plan

    if not (out / FILE).is_file():
        return None
    there = stored_plan(out)
    if not there.reliability:
        return None
    theirs = _only(there)
    mine = replace(plan.reliability[0], pairs=theirs.reliability[0].pairs)
    if differences(theirs, replace(plan, controllers=there.controllers, reliability=(mine,))):
        return None
    found = _findings(out)
    return found if {one.controller for one in found.each} >= {*plan.controllers} else None


def _findings(folder: Path) -> "ReliabilityFindings":
    """What the first study of the nearest fall of the results in a folder found."""
    from sim.trials.report.reliability_findings import reliability_findings
    from sim.trials.run.recall import open_results

    with open_results(folder) as results:
        return reliability_findings(results, results.plan.reliability[0])
