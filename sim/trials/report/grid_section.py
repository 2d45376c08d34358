"""What a page says of a grid study: maps of survival, and where it ends on each line."""

import math
from collections.abc import Collection, Iterator, Sequence
from typing import Any

from sim.pages import number
from sim.trials.plan import GridStudy
from sim.trials.plan.axis import label, spec_of
from sim.trials.plan.grid import boundary, lines
from sim.trials.report import plots
from sim.trials.report.findings import grid_rows
from sim.trials.run import Results, TrialResult

Rows = dict[str, dict[int, TrialResult]]


def grid_section(results: Results, study: GridStudy) -> dict[str, Any]:
    """Area survived, a map for each controller and pair of axes, and the boundary along the last axis."""
    rows = {controller: found for controller, found in grid_rows(results, study).items() if found}
    return {
        "kind": "grid",
        "area": " x ".join(label(axis) for axis in study.axes),
        "leads": [(name, *_counts(found.values())) for name, found in rows.items()],
        "maps": list(_maps(study, rows)),
        "boundary": _boundary(results, study, rows),
    }


def _counts(rows: Collection[TrialResult]) -> tuple[int, int, int]:
    """Trials that survived, that have a result, and that have none."""
    survived, known = sum(row.survived for row in rows), sum(row.known for row in rows)
    return survived, known, len(rows) - known


def _maps(study: GridStudy, rows: Rows) -> Iterator[Any]:
    per_picture = math.prod(len(axis.points) for axis in study.axes[-2:])
    for first in range(0, study.size, per_picture):
        fixed = zip(study.axes[:-2], study.point(first), strict=False)
        where = ", ".join(f"{label(axis)} = {number(value)}" for axis, value in fixed)
        for controller, found in rows.items():
            shown = {i - first: row for i, row in found.items() if first <= i < first + per_picture}
            yield plots.grid_map(study.axes[-2:], shown, f"{controller} {where}".strip())


def _boundary(results: Results, study: GridStudy, rows: Rows) -> dict[str, Any] | None:
    """Where survival ends on each line along the last axis, seen from the value nearest to zero."""
    last = study.axes[-1]
    numbers = [value for value in last.points if isinstance(value, int | float)]
    if len(numbers) != len(last.points):
        return None
    start = min(range(len(numbers)), key=lambda i: abs(numbers[i]))
    unit = spec_of(last, results.plan.scenario).unit
    table = []
    for fixed, indices in lines(study):
        where = ", ".join(f"{label(axis)} = {number(v)}" for axis, v in zip(study.axes, fixed, strict=False))
        alive = [[index in found and found[index].survived for index in indices] for found in rows.values()]
        table.append((where or "all", *(_stretch(numbers, one, start) for one in alive)))
    head = (f"along {label(last)}, from {numbers[start]:g} outwards", *(f"{name} survives [{unit}]" for name in rows))
    return {"head": head, "rows": table}


def _stretch(numbers: Sequence[float], alive: list[bool], start: int) -> str:
    ends = boundary(tuple(numbers), alive, start)
    if ends is None:
        return "falls"
    beyond = " and beyond a gap" if sum(alive) > ends[1] - ends[0] + 1 else ""
    return f"{numbers[ends[0]]:g} to {numbers[ends[1]]:g}{beyond}"
