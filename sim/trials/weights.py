"""Search of C-MPC's weights and horizon on a robustness score: the share of steps survived over the draws of a plan.

A candidate's score is the mean of completed by requested steps over all trials of the plan's Monte-Carlo studies, each
candidate on the same draws. The more is survived the later a fall comes, so the score moves where a count of survivors
stands still. The draws a search has seen flatter its result; another, larger set judges start and result again.
"""

import dataclasses
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim import pages, search
from sim.errors import UserError
from sim.scenario import Scenario, load, names_a_path, with_values
from sim.settings import tree as settings
from sim.trials.plan import Plan
from sim.trials.report.stats import mcnemar
from sim.trials.run import TrialResult, run_plan

KIND = "c-mpc"
OUTPUT, OUTPUT_RATE, HORIZON = "controller.weights.output", "controller.weights.output_rate", "controller.horizon"
FACTOR = (0.03, 30.0)  # on the weights of the outputs: one for each output, and one for all rates together
STAGES = (20.0, 150.0)
DIGITS = 3  # of what is tried, so that the file holds exactly that


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """What a controller is worth on a set of draws.

    Attributes:
        value: Mean share of the steps asked for that were completed, 0 to 1.
        survived: Trials that completed all of them.
        trials: Number of trials.
        studies: The mean share by study.
    """

    value: float
    survived: int
    trials: int
    studies: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gain:
    """Two controllers on the same draws.

    Attributes:
        mean: Mean gain in the share of steps.
        standard_error: Of that mean, from the differences trial by trial.
        start_alone: Trials the start alone survives.
        found_alone: Trials the found alone survives.
        p: Two-sided p-value of McNemar's exact test of "they survive alike".
    """

    mean: float
    standard_error: float
    start_alone: int
    found_alone: int
    p: float


def search_weights(
    plan: Plan,
    *,
    evaluations: int,
    seed: int,
    held_out: int,
    workers: int,
    out: Path,
    say: search.Say,
) -> dict[str, Any]:
    """Search, judge start and best on draws held out, write the best as a scenario with its evidence.

    The torque weights stay: of a cost, only the ratios of its weights count.

    Args:
        plan: Monte-Carlo studies of C-MPC; its scenario's weights and horizon are the start.
        evaluations: Candidates in all, those of an interrupted search included.
        seed: Of the optimiser.
        held_out: How many times as many draws judge the result.
        workers: Processes.
        out: Scenario to write; `.jsonl` instead of `.toml` for the evaluations.
        say: Told of every improvement.

    Returns:
        Settings and scores of the start and the best, and their paired comparison on the draws held out.

    Raises:
        UserError: a plan of other studies, a file that is not legal, or the optimiser is not installed.
    """
    record = search.check_out(out)
    if plan.grid or plan.margin:
        raise UserError(
            f"plan {plan.name!r}: has a grid or a margin study; must be Monte-Carlo studies, to hold out draws"
        )
    plan = dataclasses.replace(plan, controllers=(KIND,))
    start = (1.0,) * 5 + (float(plan.scenario.controller.horizon),)

    def results(point: search.Point, draws: Plan) -> list[TrialResult]:
        scenario = with_values(draws.scenario, changes(point, draws.scenario))
        return list(run_plan(dataclasses.replace(draws, scenario=scenario), workers=workers))

    best, count = search.recorded(
        lambda point: 1.0 - score(results(point, plan), plan).value,
        search.Space(start=start, low=(FACTOR[0],) * 5 + STAGES[:1], high=(FACTOR[1],) * 5 + STAGES[1:]),
        record,
        {"plan": plan.hash()},
        seed=seed,
        evaluations=evaluations,
        measure="share of steps lost",
        say=say,
    )
    others = held_out_plan(plan, held_out)
    say(f"judging start and best on {sum(study.size for study in others.studies)} draws held out")
    found: dict[str, Any] = {"plan": plan.name, "steps": plan.scenario.steps, "evaluations": count, "seed": seed}
    judged = []
    for name, point in (("start", start), ("found", best.point)):
        judged.append(results(point, others))
        found[name] = {
            "settings": {
                path: list(v) if isinstance(v, tuple) else v for path, v in changes(point, plan.scenario).items()
            },
            "search": dataclasses.asdict(score(results(point, plan), plan)),
            "held_out": dataclasses.asdict(score(judged[-1], others)),
        }
    found["paired"] = dataclasses.asdict(paired(*judged, steps=plan.scenario.steps))
    pages.write(out, _scenario(plan.scenario, best.point, found))
    return found


def start_from(plan: Plan, name: str) -> Plan:
    """The plan with walker, gait and controller of a scenario, by name or path: such as found by the gain search."""
    other = load(name)
    scenario = dataclasses.replace(plan.scenario, walker=other.walker, gait=other.gait, controller=other.controller)
    return dataclasses.replace(plan, scenario=scenario)


def changes(point: search.Point, base: Scenario) -> dict[str, Any]:
    """Settings of a point: five factors on a scenario's weights, and the horizon."""
    weights, factors = base.controller.weights, [_rounded(factor) for factor in point[:5]]
    return {
        OUTPUT: tuple(_rounded(w * factor) for w, factor in zip(weights.output, factors, strict=False)),
        OUTPUT_RATE: tuple(_rounded(w * factors[4]) for w in weights.output_rate),
        HORIZON: round(point[5]),
    }


def held_out_plan(plan: Plan, times: int) -> Plan:
    """The same studies with other draws, `times` as many."""
    studies = tuple(dataclasses.replace(study, trials=times * study.trials) for study in plan.montecarlo)
    return dataclasses.replace(plan, seed=plan.seed + 1, montecarlo=studies)


def score(results: Sequence[TrialResult], plan: Plan) -> Score:
    """The score of all trials of a plan.

    Raises:
        UserError: a trial came to no end: that is no score.
    """
    shares: dict[str, list[float]] = {}
    for result in results:
        if not result.known:
            raise UserError(f"trial {result.trial} of plan {plan.name!r} has no result: {result.message}")
        shares.setdefault(result.study, []).append(result.steps / plan.scenario.steps)
    every = [share for study in shares.values() for share in study]
    return Score(
        value=sum(every) / len(every),
        survived=sum(result.survived for result in results),
        trials=len(results),
        studies={name: sum(study) / len(study) for name, study in shares.items()},
    )


def paired(start: Sequence[TrialResult], found: Sequence[TrialResult], *, steps: int) -> Gain:
    """What the found controller gains over the start on the same draws, trial by trial."""
    gains = [(b.steps - a.steps) / steps for a, b in zip(start, found, strict=True)]
    mean = sum(gains) / len(gains)
    spread = math.sqrt(sum((gain - mean) ** 2 for gain in gains) / max(len(gains) - 1, 1))
    alike = mcnemar([(a.survived, b.survived) for a, b in zip(start, found, strict=True)])
    return Gain(
        mean=mean,
        standard_error=spread / math.sqrt(len(gains)),
        start_alone=alike.first,
        found_alone=alike.second,
        p=alike.p,
    )


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _scenario(base: Scenario, point: search.Point, found: Mapping[str, Any]) -> str:
    """The best as a scenario, with the evidence as comments."""

    def line(name: str, draws: str) -> str:
        row = found[name][draws]
        studies = ", ".join(f"{study} {share:.2f}" for study, share in row["studies"].items())
        return f"#   {name:<5}  {row['value']:.3f}, {row['survived']} of {row['trials']} survive ({studies})"

    pairs = found["paired"]
    here = dataclasses.replace(
        Scenario(),
        description="Weights and horizon found by cmpc weights search",
        walker=_absolute(base.walker),
        gait=_absolute(base.gait),
        controller=with_values(base, changes(point, base)).controller,
    )
    usual = {row.path: row.value for row in settings.table(Scenario())}
    return "\n".join(
        [
            f"# By cmpc weights search: {found['evaluations']} evaluations of CMA-ES, seed {found['seed']}.",
            f"# Score: mean share of {found['steps']} steps completed over the draws of plan {found['plan']!r}.",
            "# On the draws of the search, which it has seen:",
            *(line(name, "search") for name in ("start", "found")),
            "# On draws held out:",
            *(line(name, "held_out") for name in ("start", "found")),
            f"#   gain {pairs['mean']:+.3f}, standard error {pairs['standard_error']:.3f}, trial by trial",
            f"#   survived by the start alone {pairs['start_alone']}, by the found alone {pairs['found_alone']}; "
            f"McNemar's p = {pairs['p']:.2g}",
            *(settings.toml_line(row) for row in settings.table(here) if row.value != usual[row.path]),
            "",
        ]
    )


def _absolute(name: str) -> str:
    """A path that holds in any folder; a plain name stays."""
    return os.path.abspath(name) if names_a_path(name) else name
