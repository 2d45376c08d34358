"""Tables of a page of a study of the nearest fall."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim.pages import link, number
from sim.trials.plan.axis import Value
from sim.trials.reliability.space import Space
from sim.trials.report.reliability_findings import LEAST, Reliability, ReliabilityFindings, Side
from sim.trials.report.reviews import beside_of, log_of, review_of

MOST_ROWS = 8  # axes of a table
MOST_MADE = 3  # errors that a nearest fall is said to be made of
NO_UNIT = ("1", "ratio")
SINGULAR = {"ticks": "tick", "steps": "step"}


def probable(p: float) -> str:
    """A probability in two digits."""
    return f"{p:#.2g}" if 0.0 < p < 1.0 else f"{p:g}"


def signed(difference: float) -> str:
    """A difference of distances or probabilities: three decimals, or two digits where it is small."""
    if difference == 0.0:
        return "0"
    return f"{difference:+.3f}" if abs(difference) >= 0.001 else f"{difference:+.2g}"


def percent(part: float) -> str:
    """A part of a whole."""
    return f"{100.0 * part:.0f} %"


def quantity(value: Value, unit: str) -> str:
    """A value of an axis with its unit, which a ratio and a word have not."""
    if isinstance(value, str):
        return value
    unit = "" if unit in NO_UNIT else SINGULAR.get(unit, unit) if value == 1.0 else unit
    return f"{number(value)} {unit}".strip()


def errors(space: Space) -> list[tuple[str, ...]]:
    """Each error in the middle of its distribution and one deviation above, with its unit."""
    n = len(space.names)
    middle, above = space.values(np.zeros(n)), space.values(np.linalg.solve(space.factor, np.ones(n)))
    return [
        (name, quantity(low, "1"), quantity(high, "1"), "" if unit in NO_UNIT else unit)
        for name, low, high, unit in zip(space.names, middle, above, space.units, strict=True)
    ]


def nearest(one: Reliability, space: Space) -> tuple[str, str]:
    """What the nearest fall is made of, and how many directions just inside fell."""
    near, made = one.found.nearest, "-"
    if one.sides and one.found.beta > 0.0:
        side = one.sides[0]
        made = ", ".join(
            f"{space.names[k]} {quantity(side.values[k], space.units[k])} ({side.mode.outside[k]:+.2f})"
            for k in _largest(side, MOST_MADE)
        )
    return made, f"{near.fell} of {near.looked}" if near.looked else "-"


def _largest(side: Side, most: int) -> list[int]:
    """The axes with the largest shares in a nearest fall; all that are equal where it is at the middle of all."""
    order = [int(k) for k in np.argsort(-side.importance, kind="stable")[:most]]
    return [k for k in order if side.importance[k] >= LEAST or side.mode.beta == 0.0]


def reduce_first(one: Reliability, names: Sequence[str]) -> str:
    """Which errors to reduce for fewer falls: those of which these walks tell that half the spread helps."""
    p = one.found.probability.value
    told = [k for k in _by_change(one) if one.changes[k][2] < 0.0][:2]
    if not told:
        return "of no error do these walks tell that half its spread would mean fewer falls."
    words = [f"{names[k]} ({probable(p)} to {probable(_then(one, k))})" for k in told]
    return f"reduce first: {words[0]}" + (
        f", then {words[1]}." if words[1:] else "; of no second error do these walks tell."
    )


def _then(one: Reliability, axis: int) -> float:
    """The probability of a fall with half the spread of an axis."""
    return min(max(one.found.probability.value + one.changes[axis][0], 0.0), 1.0)


def _by_change(one: Reliability) -> list[int]:
    """Axes, the one whose half spread lowers the probability most first."""
    return sorted(range(len(one.changes)), key=lambda k: one.changes[k][0])


def against(found: ReliabilityFindings) -> Iterator[tuple[str, ...]]:
    """Each other controller against the first."""
    for one in found.against:
        low, high = one.beta_interval
        p_low, p_high = one.probability_interval
        beta = (
            f"{signed(one.beta)} ({signed(low)} to {signed(high)})"
            if math.isfinite(high - low)
            else "no nearest fall found of one of them"
        )
        yield one.controller, beta, f"{signed(one.probability)} ({signed(p_low)} to {signed(p_high)})"


def modes(one: Reliability, space: Space, folder: Path) -> list[dict[str, Any]]:
    """The nearest falls of a controller, each with its trials, what has been made of them, and its point."""
    return [
        {
            "beta": f"{side.mode.beta:.2f}",
            "cause": side.outside.cause or side.outside.why,
            "inside": f"{one.controller}/{side.inside.trial}" if side.inside else "",
            "outside": f"{one.controller}/{side.outside.trial}",
            "links": list(_links(side, folder)),
            "film": _film(side, folder),
            "rows": list(_point(side, space)),
        }
        for side in one.sides
    ]


def _links(side: Side, folder: Path) -> Iterator[Any]:
    """Reviews and the film of the walk just inside and of the fall, those that have been made."""
    made = [("the fall", review_of(side.outside))]
    if side.inside:
        made = [
            ("the walk just inside", review_of(side.inside)),
            *made,
            ("both, one beside the other", beside_of(side.inside, side.outside)),
            ("film of both", beside_of(side.inside, side.outside, ".gif")),
        ]
    return (link(path, words) for words, path in made if (folder / path).exists())


def _film(side: Side, folder: Path) -> str:
    """The command that makes the film of the walk just inside and of the fall, once they have their logs."""
    if side.inside is None:
        return ""
    paths = (log_of(side.inside), log_of(side.outside), beside_of(side.inside, side.outside, ".gif"))
    return "cmpc video " + " ".join(str(folder / path) for path in paths) + " --slow 0.25"


def _point(side: Side, space: Space) -> Iterator[tuple[str, ...]]:
    for k in _largest(side, MOST_ROWS):
        share = percent(side.importance[k]) if side.mode.beta > 0.0 else "-"
        yield space.names[k], quantity(side.values[k], space.units[k]), f"{side.mode.outside[k]:+.2f}", share


def halves(one: Reliability, names: Sequence[str]) -> list[tuple[str, ...]]:
    """What half the spread of each error would change, the one that lowers the probability most first."""
    rows: list[tuple[str, ...]] = []
    for k in _by_change(one)[:MOST_ROWS]:
        change, low, high = one.changes[k]
        told = "yes" if high < 0.0 else "no, more fall" if low > 0.0 else "cannot be told"
        rows.append((names[k], probable(_then(one, k)), signed(change), f"{signed(low)} to {signed(high)}", told))
    return rows


def sobol(one: Reliability, names: Sequence[str], *, margins: bool) -> Iterator[tuple[str, ...]]:
    """Rows of both indices of the fall and, if any has margins, of the least margin, the largest total first."""
    both = (one.sobol, one.margin)
    largest = np.max([found.total for found in both if found], axis=0)
    for k in np.argsort(-largest, kind="stable")[:MOST_ROWS]:
        figures = [(found.first[k], found.total[k]) if found else None for found in both[: 1 + margins]]
        yield names[k], *(f"{part:.2f}" if pair else "-" for pair in figures for part in pair or (0.0, 0.0))
