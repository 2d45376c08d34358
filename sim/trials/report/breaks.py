"""The page "what breaks": for each axis and controller, what gave way in the first trial that fell."""

import html
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from sim.trials.falls import witness as w
from sim.trials.plan import MarginStudy
from sim.trials.plan.axis import label
from sim.trials.report import plots
from sim.trials.report.findings import Side, sides
from sim.trials.report.page import key
from sim.trials.report.summary import DIRECTIONS
from sim.trials.run import Results, TrialResult

SYMPTOMS = {
    "start": f"a foot begins deeper than {1e3 * w.SUNK:g} mm in the ground, and the fall within {w.AT_ONCE:g} s",
    "clearance": "the swing foot touches the ground where no step is",
    "friction": f"the stance foot slides faster than {w.SLIDING:g} m/s",
    "contact": "both feet are in the air",
    "energy": f"the clock is slower than {w.STANDING:g} rad/s, where the gait's is 0.9 and above",
    "prediction": f"a landing is {1e3 * w.OVERDUE:g} ms later than foreseen {1e3 * w.FORESEEN:g} ms before it, or the "
    f"clock beyond {w.OVERRUN:g} of its range; the controller falls back; or an output is beyond "
    f"{w.OFF_TRACK:g} rad with torque to spare",
    "torque": f"a joint applies {w.AT_LIMIT:.1%} of its limit or more",
    "unclear": "none of these lasts until the fall",
}


def breaks_page(results: Results, back: str) -> Iterator[str]:
    """The body of the page.

    Args:
        results: What the campaign found.
        back: The page to link back to.
    """
    plan = results.plan
    yield f"<h1>{html.escape(plan.name)}: what breaks</h1><p><a href={back}>What each controller holds</a></p>"
    yield from _criteria()
    for start, study in plan.offsets():
        yield f"<h2>{html.escape(study.name)}</h2>"
        if isinstance(study, MarginStudy):
            yield from _margins(list(sides(results, study)), study, plan.controllers)
        else:
            rows = {name: results.store.results(name, start, start + study.size) for name in plan.controllers}
            falls = {name: _count(found) for name, found in rows.items()}
            yield "<p>All falls:</p>" + plots.cause_bars(falls, study.name)


def _criteria() -> Iterator[str]:
    yield (
        "<p>Once a walker falls, everything goes wrong at once. So the ticks that show a symptom are followed back "
        f"from the fall to the last {w.GAP:g} s without any: there the fall began, and the first symptom is named.</p>"
        "<details open><summary>The symptoms</summary><table>"
    )
    for word, sentence in SYMPTOMS.items():
        yield f"<tr><td>{key(plots.CAUSE_COLOURS[word], word)}<td>{html.escape(sentence)}</tr>"
    yield (
        f"</table><p class=muted>Each must hold for its share of the {w.WINDOW:g} s before. Those that begin within "
        f"{w.TOGETHER:g} s of the first are one event, named in this order; falling back and lost outputs come after "
        "torque. The figures are those around the beginning of the fall. Undisturbed walks show none.</p></details>"
    )


def _count(falls: Iterable[TrialResult | None]) -> Counter[str]:
    return Counter(fall.cause for fall in falls if fall and fall.cause)


def _margins(found: Sequence[Side], study: MarginStudy, controllers: Sequence[str]) -> Iterator[str]:
    falls = {name: _count(side.fall for side in found if side.controller == name) for name in controllers}
    yield "<p>The first fall on every side that breaks:</p>" + plots.cause_bars(falls, study.name)
    head = "".join(f"<th>{html.escape(name)}" for name in controllers)
    yield f"<div class=wide><table><tr><th>axis<th>{head}</tr>"
    for axis in study.axes:
        for sign in (-1, 1):
            here = {side.controller: side for side in found if side.axis is axis and side.sign == sign}
            if not here:
                continue
            cells = "".join(f"<td>{_cell(here[name]) if name in here else '-'}" for name in controllers)
            unit = next(iter(here.values())).unit
            yield (
                f"<tr><td>{html.escape(label(axis))} <span class=muted>[{html.escape(unit)}]</span>"
                f"<td>{DIRECTIONS[sign]}{cells}</tr>"
            )
    yield "</table></div>"


def _cell(side: Side) -> str:
    """Where it falls first, what broke, the figures that say so, and on hovering the trial with all of them."""
    fall = side.fall
    if fall is None:
        return f"<span class=muted>holds {side.limit:.4g}</span>"
    if not fall.cause:
        return html.escape(f"{side.margin.fell_at:.4g}: {fall.why}")
    word, _, what = fall.cause.partition(": ")
    return (
        f"{side.margin.fell_at:.4g} {key(plots.CAUSE_COLOURS[word], word)}<br><span class=muted "
        f'title="{html.escape(f"{fall.controller}/{fall.trial} {fall.evidence}")}">'
        f"{html.escape(f'{what}, {fall.proof}'.rstrip(', '))}</span>"
    )
