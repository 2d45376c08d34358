"""The part of a page about a margin study: every axis, every controller, both signs, at a glance."""

import html
from collections.abc import Iterator, Sequence

from sim.trials.plan import MarginStudy
from sim.trials.plan.axis import label
from sim.trials.report import plots
from sim.trials.report.findings import Side, sides, weakest
from sim.trials.report.summary import DIRECTIONS, side_words
from sim.trials.run import Results

FIRST = 3  # sides named that break first


def margin_section(results: Results, study: MarginStudy) -> Iterator[str]:
    """What each controller holds, and what breaks it first."""
    controllers = results.plan.controllers
    found = list(sides(results, study))
    for controller in controllers:
        yield f"<p>{_lead(found, controller)}</p>"
    yield (
        "<p class=muted>Bars run from the nominal value to the largest one survived, as a share of the range "
        "tried; a red line marks the first fall, a ring a value survived beyond it: survival is then not monotone. "
        '"Typical" is the deviation to expect of a machine, by which axes are compared.</p>'
    )
    head = "".join(f"<th class=number>{html.escape(c)}" for c in controllers)
    yield "<div class=wide><table><tr><th>axis<th class=number>typical<th class=number>tried<th>down and up"
    yield f"{head}<th>gives way first</tr>"
    for axis in study.axes:
        here = [side for side in found if side.axis is axis]
        if here:
            yield _row(here, controllers)
    yield "</table></div>"


def _lead(found: Sequence[Side], controller: str) -> str:
    """How much of everything a controller holds, and the sides that break first."""
    order = weakest(found, controller)
    own = [side for side in found if side.controller == controller]
    name = html.escape(controller)
    if not own:
        return f"<b>{name}</b> has no results yet."
    rated = [side.typical_errors for side in own if side.typical_errors is not None]
    kept = sum(errors > 1.0 for errors in rated)
    words = f"<b>{name}</b> holds {len(own) - len(order)} of {len(own)} sides as far as was tried"
    words += f", and {kept} of {len(rated)} beyond what is typical of a machine. " if rated else ". "
    if not order:
        return words + "Nothing breaks it."
    first, *others = (html.escape(side_words(side)) for side in order[:FIRST])
    return words + f"Breaks first: <b>{first}</b>." + (f" Then: {'; '.join(others)}." if others else "")


def _row(here: Sequence[Side], controllers: Sequence[str]) -> str:
    axis, unit = here[0].axis, here[0].unit
    cells = "".join(f"<td class=number>{_held(here, controller)}" for controller in controllers)
    typical = f"{axis.typical:g}" if axis.typical else "-"
    return (
        f"<tr><td>{html.escape(label(axis))}<br><span class=muted>{html.escape(unit)}</span>"
        f"<td class=number>{typical}<td class=number>{axis.low:g} to {axis.high:g}"
        f"<td class=picture>{plots.margin_bars(here, controllers)}{cells}<td>{_first_break(here)}</tr>"
    )


def _held(here: Sequence[Side], controller: str) -> str:
    """Both ends of what a controller holds; an end of what was tried that is still held has a sign before it."""
    ends = []
    for side in here:
        if side.controller == controller:
            value = "falls" if side.margin.value is None else f"{side.margin.value:.4g}"
            beyond = ("&le;&nbsp;" if side.sign < 0 else "&ge;&nbsp;") if side.whole else ""
            ends.append(beyond + value + (" *" if side.margin.again else ""))
    return " to ".join(ends) or "-"


def _first_break(here: Sequence[Side]) -> str:
    """The side that gives way first in the share of the range, and what breaks."""
    broken = [side for side in here if not side.whole]
    if not broken:
        return "<span class=muted>nothing</span>"
    side = min(broken, key=lambda side: side.share)
    cause = side.fall.cause if side.fall else ""
    why = cause.partition(":")[0] or side.margin.reason.split(" (")[0]
    return f"{html.escape(side.controller)}, {DIRECTIONS[side.sign]}: {html.escape(why)}"
