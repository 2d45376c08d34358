"""The page of a campaign: one self-contained HTML file, a table as CSV, the plots as SVG files."""

import csv
import dataclasses
import html
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from sim.errors import UserError
from sim.judge import FallCriteria
from sim.trials import plots
from sim.trials.axis import Value, label, spec_of
from sim.trials.campaign import Results
from sim.trials.findings import RandomFindings, Side, grid_rows, random_findings, sides, weakest
from sim.trials.grid import GridStudy, boundary, lines
from sim.trials.margin import MarginStudy
from sim.trials.montecarlo import MonteCarloStudy
from sim.trials.plan import to_toml
from sim.trials.result import TrialResult
from sim.trials.summary import side_words
from sim.trials.svg import COLOURS

MOST_FALLS = 100  # rows of the list of falls
MOST_CURVES = 9  # survival curves of a Monte-Carlo study

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #22272d;
  max-width: 1080px; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: 0; } h2 { margin-top: 2.5rem; border-bottom: 1px solid #dde1e5; }
table { border-collapse: collapse; width: 100%; font-size: 13px; margin: 1rem 0; }
th { text-align: left; border-bottom: 1px solid #9aa1a9; padding: 4px 8px; vertical-align: bottom; }
td { border-bottom: 1px solid #eef0f2; padding: 3px 8px; vertical-align: middle; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
svg { vertical-align: middle; max-width: 100%; height: auto; margin: 2px 6px 2px 0; }
.muted { color: #6b737c; } .fell { color: #c8442f; } code { font-size: 12px; }
.key { display: inline-block; width: 12px; height: 12px; margin: 0 4px 0 14px; border-radius: 2px; }
.lead { font-size: 16px; } details { margin: 1rem 0; }
pre { font-size: 12px; overflow: auto; background: #f6f7f8; padding: 1rem; }
"""


def write_report(results: Results, folder: Path) -> Path:
    """Write report.html, results.csv and plots/ into a folder.

    Args:
        results: What the campaign found.
        folder: Where they go.

    Returns:
        Path of the page.

    Raises:
        UserError: the folder cannot be written.
    """
    try:
        _write_csv(results, folder / "results.csv")
        body = "\n".join(_page(results))
        page = folder / "report.html"
        page.write_text(_document(results.plan.name, body), encoding="utf-8")
        _write_plots(body, folder / "plots")
    except OSError as error:
        raise UserError(f"{folder}: the page cannot be written: {error.strerror}") from error
    return page


def _write_csv(results: Results, path: Path) -> None:
    names = [field.name for field in dataclasses.fields(TrialResult)]
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(names)
        for row in results:
            table.writerow([getattr(row, name) for name in names])


def _write_plots(body: str, folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for old in folder.glob("*.svg"):
        old.unlink()
    for number, found in enumerate(re.finditer(r"<svg.*?</svg>", body, flags=re.DOTALL)):
        title = re.search(r"<title>(.*?)</title>", found[0])
        name = re.sub(r"\W+", "-", html.unescape(title[1]) if title else "plot").strip("-").lower()[:60]
        (folder / f"{number:03}-{name}.svg").write_text(found[0], encoding="utf-8")


def _document(title: str, body: str) -> str:
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head>\n'
        f"<body>\n{body}\n</body></html>\n"
    )


def _page(results: Results) -> Iterator[str]:
    plan = results.plan
    counts = results.store.counts()
    done = sum(number for _, number in counts.values())
    yield f"<h1>{html.escape(plan.name)}</h1><p class=lead>{html.escape(plan.description)}</p>"
    yield "<p>" + "".join(
        f'<span class=key style="background:{COLOURS[i % len(COLOURS)]}"></span>{html.escape(name)}: '
        f"{counts.get(name, (0, 0))[0]} of {counts.get(name, (0, 0))[1]} trials survived"
        for i, name in enumerate(plan.controllers)
    )
    yield f"</p><p class=muted>{done} trials, seed {plan.seed}. {_criteria(results)}</p>"
    for study in plan.studies:
        yield f"<h2>{html.escape(study.name)}</h2>"
        if isinstance(study, MarginStudy):
            yield from _margin_section(results, study)
        elif isinstance(study, GridStudy):
            yield from _grid_section(results, study)
        else:
            yield from _random_section(results, study)
    yield from _falls(results)
    yield f"<details><summary>The plan</summary><pre>{html.escape(to_toml(plan))}</pre></details>"


def _criteria(results: Results) -> str:
    c, steps, limit = FallCriteria(), results.plan.scenario.steps, results.plan.scenario.end_time
    return (
        f"A trial survives when {steps} steps of at least {c.step_length:g} m are completed. It falls when the hip "
        f"is less than {c.hip_height:g} m above the lower foot, the torso tilts beyond {c.torso_tilt:g} rad, a link "
        f"other than a foot touches the ground, no step comes for {c.stall_time:g} s, the state is not finite, or "
        f"{limit:g} s of simulated time are over. The controller knows nothing of what is varied."
    )


def _margin_section(results: Results, study: MarginStudy) -> Iterator[str]:
    found = list(sides(results, study))
    for controller in results.plan.controllers:
        order = weakest(found, controller)
        total = sum(side.controller == controller for side in found)
        first = "; then ".join(html.escape(side_words(side)) for side in order[:3])
        yield (
            f"<p><b>{html.escape(controller)}</b> holds {total - len(order)} of {total} sides as far as was tried. "
            + (f"Breaks first on <b>{first}</b>." if order else "Nothing breaks it.")
            + "</p>"
        )
    yield (
        "<p class=muted>Bars run from the nominal value to the largest one survived, as a share of the range "
        "tried; a red line marks the first fall, a ring a value survived beyond it: survival is then not monotone. "
        '"Typical" is the deviation to expect of a machine, by which axes are compared.</p>'
    )
    head = "".join(f"<th class=number>{html.escape(c)}</th>" for c in results.plan.controllers)
    yield (
        "<table><tr><th>axis<th class=number>typical<th class=number>tried<th>down and up"
        f"{head}<th>what breaks first</tr>"
    )
    for axis in study.axes:
        here = [side for side in found if side.axis is axis]
        if not here:
            continue
        unit = here[0].unit
        cells = "".join(f"<td class=number>{_held(here, c)}</td>" for c in results.plan.controllers)
        typical = f"{axis.typical:g}" if axis.typical else "-"
        yield (
            f"<tr><td>{html.escape(label(axis))}<br><span class=muted>{html.escape(unit)}</span></td>"
            f"<td class=number>{typical}</td><td class=number>{axis.low:g} to {axis.high:g}</td>"
            f"<td>{plots.margin_bars(here, results.plan.controllers)}</td>{cells}<td>{_first_break(here)}</td></tr>"
        )
    yield "</table>"


def _held(here: Sequence[Side], controller: str) -> str:
    """Both ends of what a controller holds, an end that was never reached in brackets."""
    ends = []
    for side in here:
        if side.controller == controller:
            value = "falls" if side.margin.value is None else f"{side.margin.value:.4g}"
            note = " *" if side.margin.again else ""
            ends.append(
                f"&ge;&nbsp;{value}"
                if side.whole and side.sign > 0
                else f"&le;&nbsp;{value}"
                if side.whole
                else f"{value}{note}"
            )
    return " to ".join(ends) if len(ends) > 1 else "".join(ends)


def _first_break(here: Sequence[Side]) -> str:
    """The side that gives way first in the share of the range, and why."""
    broken = sorted((side for side in here if not side.whole), key=lambda side: side.share)
    if not broken:
        return "<span class=muted>nothing</span>"
    side = broken[0]
    reason = side.margin.reason.split(" (")[0]
    return f"{html.escape(side.controller)}, {'down' if side.sign < 0 else 'up'}: {html.escape(reason)}"


def _grid_section(results: Results, study: GridStudy) -> Iterator[str]:
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
        where = ", ".join(f"{label(axis)} = {_number(value)}" for axis, value in fixed)
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
        where = ", ".join(f"{label(axis)} = {_number(v)}" for axis, v in zip(study.axes, fixed, strict=False))
        cells = ""
        for found in rows.values():
            alive = [index in found and found[index].survived for index in indices]
            cells += f"<td class=number>{_stretch(numbers, alive, start)}</td>"
        table.append(f"<tr><td>{html.escape(where or 'all')}</td>{cells}</tr>")
    head = "".join(f"<th class=number>{html.escape(controller)} survives [{html.escape(unit)}]" for controller in rows)
    along = f"along {html.escape(label(last))}, from {numbers[start]:g} outwards"
    return f"<table><tr><th>{along}{head}</tr>{''.join(table)}</table>"


def _stretch(numbers: Sequence[float], alive: list[bool], start: int) -> str:
    ends = boundary(tuple(numbers), alive, start)
    if ends is None:
        return "falls"
    beyond = " and beyond a gap" if sum(alive) > ends[1] - ends[0] + 1 else ""
    return f"{numbers[ends[0]]:g} to {numbers[ends[1]]:g}{beyond}"


def _random_section(results: Results, study: MonteCarloStudy) -> Iterator[str]:
    found = random_findings(results, study)
    if not found.rates:
        return
    yield plots.rate_bars(found)
    yield "<p>" + " ".join(_rate_words(found)) + "</p>"
    for a, b, pair in found.pairs:
        yield (
            f"<table style='width:auto'><tr><th><th class=number>{b} survives<th class=number>{b} falls</tr>"
            f"<tr><td>{a} survives<td class=number>{pair.both}<td class=number>{pair.first}</tr>"
            f"<tr><td>{a} falls<td class=number>{pair.second}<td class=number>{pair.neither}</tr></table>"
            f"<p>The same draws for both. McNemar's exact test: p = {pair.p:.2g}.</p>"
        )
    yield (
        "<h3>Which axes explain the falls</h3><p class=muted>Spearman's rank correlation with survival: solid of "
        "the value, pale of its distance from the median.</p>"
    )
    for i, (controller, axes) in enumerate(found.attributions.items()):
        if axes:
            yield f"<h4>{html.escape(controller)}</h4>" + plots.attribution_bars(axes, COLOURS[i % len(COLOURS)])
    yield "<h3>Survival along the strongest axes</h3>"
    strongest: dict[str, float] = {}
    for axes in found.attributions.values():
        for one in axes:
            strongest[one.axis] = max(strongest.get(one.axis, 0.0), one.strength)
    units = {label(axis): spec_of(axis, results.plan.scenario).unit for axis in study.axes}
    for axis in sorted(strongest, key=lambda name: -strongest[name])[:MOST_CURVES]:
        yield plots.survival_curve(axis, units[axis], found.results)


def _rate_words(found: RandomFindings) -> Iterator[str]:
    for rate in found.rates:
        low, high = rate.interval
        yield (
            f"{html.escape(rate.controller)} survives {rate.survived} of {rate.trials}: "
            f"{100 * rate.survived / rate.trials:.1f} % (95 %: {100 * low:.1f} to {100 * high:.1f} %)."
        )


def _falls(results: Results) -> Iterator[str]:
    """The first falls and errors, each with the id that runs it again."""
    rows = [row for row in results if not row.survived]
    if not rows:
        return
    shown = sorted(rows, key=lambda row: (row.outcome != "error", row.trial, row.controller))[:MOST_FALLS]
    yield f"<details><summary>Falls and errors ({len(shown)} of {len(rows)}; all are in results.csv)</summary>"
    yield "<table><tr><th>trial<th>study<th>values<th class=number>steps<th class=number>time [s]<th>why</tr>"
    for row in shown:
        values = ", ".join(f"{name} = {_number(value)}" for name, value in row.axis_values.items())
        yield (
            f"<tr><td><code>{html.escape(row.controller)}/{row.trial}</code><td>{html.escape(row.study)}"
            f"<td>{html.escape(values)}<td class=number>{row.steps}<td class=number>{row.time_s:.2f}"
            f"<td>{html.escape(row.why)}</tr>"
        )
    yield "</table></details>"


def _number(value: Value) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
