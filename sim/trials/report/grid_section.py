"""The part of a page about a grid study: maps of survival, and where it ends on each line."""

import html
import math
from collections.abc import Iterator, Sequence

from sim.trials.plan import GridStudy
from sim.trials.plan.axis import label, spec_of
from sim.trials.plan.grid import boundary, lines
from sim.trials.report import plots
from sim.trials.report.findings import grid_rows
from sim.trials.report.page import number
from sim.trials.run import Results, TrialResult


def grid_section(results: Results, study: GridStudy) -> Iterator[str]:
    """Area survived, a map for each controller and pair of axes, and the boundary along the last axis."""
    rows = {controller: found for controller, found in grid_rows(results, study).items() if found}
    names = html.escape(" x ".join(label(axis) for axis in study.axes))
    yield "<p>" + " ".join(
        f"<b>{html.escape(controller)}</b> survives {survived} of {len(found)} points, "
        f"{100 * survived / len(found):.1f} % of the area of {names}."
        for controller, found in rows.items()
        for survived in [sum(row.survived for row in found.values())]
    )
    yield "</p><p class=muted>Green: survived. The number is that of the steps completed before the fall.</p>"
    per_picture = math.prod(len(axis.points) for axis in study.axes[-2:])
    for first in range(0, study.size, per_picture):
        fixed = zip(study.axes[:-2], study.point(first), strict=False)
        where = ", ".join(f"{label(axis)} = {number(value)}" for axis, value in fixed)
        for controller, found in rows.items():
            shown = {i - first: row for i, row in found.items() if first <= i < first + per_picture}
            yield plots.grid_map(study.axes[-2:], shown, f"{controller} {where}".strip())
    yield _boundary_table(results, study, rows)


def _boundary_table(results: Results, study: GridStudy, rows: dict[str, dict[int, TrialResult]]) -> str:
    """Where survival ends on each line along the last axis, seen from the value nearest to zero."""
    last = study.axes[-1]
    numbers = [value for value in last.points if isinstance(value, int | float)]
    if len(numbers) != len(last.points):
        return ""
    start = min(range(len(numbers)), key=lambda i: abs(numbers[i]))
    unit = spec_of(last, results.plan.scenario).unit
    table = []
    for fixed, indices in lines(study):
        where = ", ".join(f"{label(axis)} = {number(v)}" for axis, v in zip(study.axes, fixed, strict=False))
        cells = ""
        for found in rows.values():
            alive = [index in found and found[index].survived for index in indices]
            cells += f"<td class=number>{_stretch(numbers, alive, start)}"
        table.append(f"<tr><td>{html.escape(where or 'all')}{cells}</tr>")
    head = "".join(f"<th class=number>{html.escape(controller)} survives [{html.escape(unit)}]" for controller in rows)
    along = f"along {html.escape(label(last))}, from {numbers[start]:g} outwards"
    return f"<div class=wide><table><tr><th>{along}{head}</tr>{''.join(table)}</table></div>"


def _stretch(numbers: Sequence[float], alive: list[bool], start: int) -> str:
    ends = boundary(tuple(numbers), alive, start)
    if ends is None:
        return "falls"
    beyond = " and beyond a gap" if sum(alive) > ends[1] - ends[0] + 1 else ""
    return f"{numbers[ends[0]]:g} to {numbers[ends[1]]:g}{beyond}"
