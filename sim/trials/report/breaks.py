"""The page "what breaks": for each axis and controller, what gave way in the first trial that fell."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from sim.pages.palette import CAUSES
from sim.trials.falls import verdict as v
from sim.trials.falls.witness import FORESEEN, KEPT
from sim.trials.plan import MarginStudy
from sim.trials.plan.axis import label
from sim.trials.report import plots
from sim.trials.report.findings import Side, sides
from sim.trials.report.summary import DIRECTIONS
from sim.trials.run import Results, TrialResult

SYMPTOMS = {
    "start": f"a foot begins deeper than {1e3 * v.SUNK:g} mm in the ground, and the fall begins within {v.AT_ONCE:g} s "
    f"and is over within {v.SOON:g} s",
    "actuator": f"a joint gets less than {v.WEAK:.0%} of the torque asked of it that the plant would let through",
    "delay": f"what is measured and what is applied lag by more than {1e3 * v.BEHIND:g} ms together",
    "sensor": f"a measured angle is off by more than {v.OFF:g} rad on the mean",
    "clearance": "the swing foot touches the ground where no step is",
    "friction": f"the stance foot slides faster than {v.SLIDING:g} m/s",
    "contact": "both feet are in the air",
    "energy": f"the clock is slower than {v.STANDING:g} rad/s, where the gait's is 0.9 and above",
    "prediction": f"a landing is {1e3 * v.OVERDUE:g} ms later than the controller foresaw "
    f"{1e3 * FORESEEN:g} ms before it",
    "landing": f"the clock is beyond {v.OVERRUN:g} of its range and no foot has landed, or a foot lands "
    f"below {v.EARLY:g}",
    "torque": f"a joint applies {v.AT_LIMIT:.1%} of its limit or more",
    "solver": "the controller falls back",
    "tracking": f"an output is beyond {v.OFF_TRACK:g} rad with torque to spare",
    "unclear": "none of these lasts until the fall",
}


RULE = (
    "Once a walker falls, everything goes wrong at once. So the ticks that show a symptom are followed back from the "
    f"fall to the last {v.GAP:g} s without any: there the fall began, and the first symptom is named."
)
SHARE = (
    f"Each must hold for its share of the {v.WINDOW:g} s before. Those that begin within {v.TOGETHER:g} s of the first "
    "are one event, named in this order. Actuators, delays and sensors are judged before all symptoms, over the last "
    f"{KEPT:g} s: what was applied against what was asked, what was seen against what was. The figures are those "
    "around the beginning of the fall. Undisturbed walks show none."
)


def breaks(results: Results) -> Iterator[dict[str, Any]]:
    """What the page shows of each study: its name, bars of causes, and of a margin study a row for each side."""
    plan = results.plan
    for start, study in plan.offsets():
        if isinstance(study, MarginStudy):
            found = list(sides(results, study))
            falls = {name: _count(side.fall for side in found if side.controller == name) for name in plan.controllers}
            rows = list(_rows(found, study, plan.controllers))
            lead = "The first fall on every side that breaks:"
        else:
            trials = {name: results.store.results(name, start, start + study.size) for name in plan.controllers}
            falls, rows, lead = {name: _count(one) for name, one in trials.items()}, [], "All falls:"
        yield {"name": study.name, "lead": lead, "bars": plots.cause_bars(falls, study.name), "rows": rows}


def _count(falls: Iterable[TrialResult | None]) -> Counter[str]:
    return Counter(fall.cause for fall in falls if fall and fall.cause)


def _rows(found: Sequence[Side], study: MarginStudy, controllers: Sequence[str]) -> Iterator[dict[str, Any]]:
    for axis in study.axes:
        for sign in (-1, 1):
            here = {side.controller: side for side in found if side.axis is axis and side.sign == sign}
            if here:
                cells = [_cell(here.get(name)) for name in controllers]
                unit = next(iter(here.values())).unit
                yield {"axis": label(axis), "unit": unit, "direction": DIRECTIONS[sign], "cells": cells}


def _cell(side: Side | None) -> Mapping[str, Any]:
    """Where it falls first, what broke, the figures that say so, and on hovering the trial with all of them."""
    fall = side.fall if side else None
    if side is None or fall is None:
        return {"text": f"holds {side.limit:.4g}" if side else "-", "cause": ""}
    if not fall.cause:
        return {"text": f"{side.margin.fell_at:.4g}: {fall.why}", "cause": ""}
    word, _, what = fall.cause.partition(": ")
    return {
        "text": f"{side.margin.fell_at:.4g}",
        "cause": word,
        "colour": CAUSES[word],
        "proof": f"{what}, {fall.proof}".rstrip(", "),
        "title": f"{fall.controller}/{fall.trial} {fall.evidence}",
    }
