"""What a page says of a margin study: every axis, every controller, both signs, at a glance."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from sim.errors import UserError
from sim.trials.plan import MarginStudy, Plan
from sim.trials.plan.axis import changes, label, scenario_at
from sim.trials.plan.limits import Limits, limits_of
from sim.trials.plan.margin import MarginAxis
from sim.trials.report import plots
from sim.trials.report.findings import Side, sides, weakest
from sim.trials.report.summary import DIRECTIONS, side_words
from sim.trials.run import Results

FIRST = 3  # sides named that break first


def margin_section(results: Results, study: MarginStudy) -> dict[str, Any]:
    """What each controller holds, and what breaks it first."""
    controllers, found = results.plan.controllers, list(sides(results, study))
    limits, without = _limits(results.plan)
    return {
        "kind": "margin",
        "unknown": sum(len(controllers) * sum(end != 0 for end in axis.ends) for axis in study.axes) - len(found),
        "how_finely": _how_finely(study),
        "leads": [_lead(found, controller) for controller in controllers],
        "rows": list(_rows(found, study, controllers, results.plan, limits)),
        "limits": limits is not None,
        "limits_gait": limits.gait if limits else "",
        "without": without,
    }


def _limits(plan: Plan) -> tuple[Limits | None, str]:
    """The plan's limits, or why they cannot be drawn; results are shown without them then."""
    try:
        return (limits_of(plan.limits, plan.scenario) if plan.limits else None), ""
    except UserError as error:
        return None, str(error)


def _lead(found: Sequence[Side], controller: str) -> dict[str, Any]:
    """How much of everything a controller holds, and the sides that break first."""
    order = weakest(found, controller)
    own = [side for side in found if side.controller == controller]
    if not own:
        return {"name": controller, "words": "has no results yet.", "breaks": []}
    rated = [side.typical_errors for side in own if side.typical_errors is not None]
    words = f"holds {len(own) - len(order)} of {len(own)} sides as far as was tried"
    words += f", and {sum(e > 1.0 for e in rated)} of {len(rated)} beyond what is typical of a machine" if rated else ""
    return {"name": controller, "words": words + ".", "breaks": [side_words(side) for side in order[:FIRST]]}


def _how_finely(study: MarginStudy) -> str:
    """How closely the search looked at the edges."""
    looks = sorted({axis.look for axis in study.axes})
    values = str(looks[0]) if len(looks) == 1 else f"{looks[0]} to {looks[-1]}"
    words = (
        f"An edge is found by bisection to the accuracy of its axis, and looked at value by value until {values} in a "
        "row walk below the lowest fall and as many fall beyond the largest survivor."
    )
    if study.draws > 1:
        words += (
            f" Every value is tried {study.draws} times, with starts {study.blur:g} rad apart; it holds if all walk."
        )
    return words


def _rows(
    found: Sequence[Side], study: MarginStudy, controllers: Sequence[str], plan: Plan, limits: Limits | None
) -> Iterator[dict[str, Any]]:
    for axis in study.axes:
        here = [side for side in found if side.axis is axis]
        if here:
            most = _most(axis, plan, limits) if limits else {}
            yield {
                "axis": label(axis),
                "unit": here[0].unit,
                "typical": f"{axis.typical:g}" if axis.typical else "-",
                "tried": f"{axis.low:g} to {axis.high:g}",
                "bars": plots.margin_bars(here, controllers, {sign: row["value"] for sign, row in most.items()}),
                "held": [_held(here, controller, most) for controller in controllers],
                "limit": " to ".join(f"{most[sign]['value']:.4g}" for sign in sorted(most)),
                "sure": "; ".join(
                    f"{row['words']}: {row['sure']}, friction {row['friction']:g}" for row in most.values()
                ),
                "first": _first_break(here),
            }


def _most(axis: MarginAxis, plan: Plan, limits: Limits) -> dict[int, Mapping[str, Any]]:
    """What any controller could hold, as far as was found, by sign."""
    found = {}
    for sign, end in zip((-1, 1), axis.ends, strict=True):
        scenario = scenario_at(plan.scenario, changes(axis, axis.value(end), plan.scenario))
        row = limits.beside(scenario, axis.paths[0], sign) if end and len(axis.paths) == 1 else None
        if row:
            found[sign] = row
    return found


def _held(here: Sequence[Side], controller: str, most: Mapping[int, Mapping[str, Any]]) -> str:
    """Both ends of what a controller holds; an end of what was tried that is still held has a sign before it.

    Where the most that any controller could hold is known, the share of it stands behind.
    """
    ends = []
    for side in here:
        if side.controller == controller:
            value = "falls" if side.margin.value is None else f"{side.margin.value:.4g}"
            beyond = ("\u2264\u00a0" if side.sign < 0 else "\u2265\u00a0") if side.whole else ""
            again = side.margin.again
            text = beyond + value + (f" (mixed to {again[-1]:.4g})" if again else "")
            if side.sign in most and side.margin.value is not None:
                nominal = side.axis.nominal
                room = most[side.sign]["value"] - nominal
                text += f" ({100.0 * (side.margin.value - nominal) / room:.0f} % of the limit)" if room else ""
            ends.append(text)
    return " to ".join(ends) or "-"


def _first_break(here: Sequence[Side]) -> str:
    """The side that gives way first in the share of the range, and what breaks; empty if nothing does."""
    broken = [side for side in here if not side.whole]
    if not broken:
        return ""
    side = min(broken, key=lambda side: side.share)
    cause = side.fall.cause if side.fall else ""
    why = cause.partition(":")[0] or side.margin.reason.split(" (")[0]
    return f"{side.controller}, {DIRECTIONS[side.sign]}: {why}"
