"""What a campaign leaves beside its database: two HTML pages, a table as CSV, the plots as SVG files."""

import csv
import dataclasses
import heapq
import html
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from sim.errors import UserError
from sim.trials.plan import GridStudy, MarginStudy
from sim.trials.plan.plan import to_toml
from sim.trials.report.breaks import breaks_page
from sim.trials.report.grid_section import grid_section
from sim.trials.report.margin_section import margin_section
from sim.trials.report.page import controller_colour, document, key, number
from sim.trials.report.random_section import random_section
from sim.trials.report.summary import counted
from sim.trials.run import Results, TrialResult
from sim.trials.run.campaign import pending
from sim.trials.run.store import Counts

REPORT, BREAKS = "report.html", "breaks.html"
MOST_FALLS = 100  # rows of the list of falls


def write_report(results: Results, folder: Path) -> Path:
    """Write report.html, breaks.html, results.csv and plots/ into a folder.

    Args:
        results: What the campaign found.
        folder: Where they go.

    Returns:
        Path of the first page.

    Raises:
        UserError: the folder cannot be written.
    """
    try:
        _write_csv(results, folder / "results.csv")
        body, breaks = "\n".join(_page(results)), "\n".join(breaks_page(results, REPORT))
        name = results.plan.name
        (folder / REPORT).write_text(document(name, body), encoding="utf-8")
        (folder / BREAKS).write_text(document(f"{name}: what breaks", breaks), encoding="utf-8")
        _write_plots(body + breaks, folder / "plots")
    except OSError as error:
        raise UserError(f"{folder}: the page cannot be written: {error.strerror}") from error
    return folder / REPORT


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
    for place, found in enumerate(re.finditer(r"<svg.*?</svg>", body, flags=re.DOTALL)):
        title = re.search(r"<title>(.*?)</title>", found[0])
        name = re.sub(r"\W+", "-", html.unescape(title[1]) if title else "plot").strip("-").lower()[:60]
        (folder / f"{place:03}-{name}.svg").write_text(found[0], encoding="utf-8")


def _page(results: Results) -> Iterator[str]:
    plan = results.plan
    counts = results.store.counts()
    done = sum(one.done for one in counts.values())
    yield f"<h1>{html.escape(plan.name)}</h1><p class=lead>{html.escape(plan.description)}</p><p class=keys>"
    for place, name in enumerate(plan.controllers):
        yield key(controller_colour(place), f"{name}: {counted(counts.get(name, Counts()))}")
    yield f"</p><p class=muted>{done} trials, seed {plan.seed}. {_criteria(results)}</p>"
    if pending(plan, results.store):
        yield "<p><b>Not all trials have been run yet.</b> Margins whose search is not finished are left out.</p>"
    yield f'<p><a href="{BREAKS}">What breaks</a>, axis by axis.</p>'
    for study in plan.studies:
        yield f"<h2>{html.escape(study.name)}</h2>"
        if isinstance(study, MarginStudy):
            yield from margin_section(results, study)
        elif isinstance(study, GridStudy):
            yield from grid_section(results, study)
        else:
            yield from random_section(results, study)
    yield from _falls(results)
    yield f"<details><summary>The plan</summary><pre>{html.escape(to_toml(plan))}</pre></details>"


def _criteria(results: Results) -> str:
    """What the trials were judged by, as their runs recorded it."""
    steps, limit, found = results.plan.scenario.steps, results.plan.scenario.end_time, results.store.criteria()
    if not found:
        return ""
    names = ("step_length", "hip_height", "torso_tilt", "stall_time")
    length, height, tilt, time = (_range([one[name] for one in found]) for name in names)
    depths = [one["scuff_depth"] for one in found if "scuff_depth" in one]
    scuff = f"the swing foot passes {_range(depths)} m below the ground, " if depths else ""
    return (
        f"A trial survives when {steps} steps of at least {length} m are completed. It falls when the hip is less than "
        f"{height} m above the lower foot, the torso tilts beyond {tilt} rad, a link other than a foot touches the "
        f"ground, {scuff}no step comes for {time} s, the state is not finite, or {limit:g} s of simulated time are "
        "over. The controller knows nothing of what is varied."
    )


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"


def _falls(results: Results) -> Iterator[str]:
    """The first falls and errors, each with the id that runs it again."""
    falls = sum(one.done - one.survived for one in results.store.counts().values())
    if not falls:
        return
    rows = (row for row in results if not row.survived)
    shown = heapq.nsmallest(MOST_FALLS, rows, key=lambda row: (row.known, row.trial, row.controller))
    which = f"{len(shown)} of {falls}; all are in results.csv"
    yield f"<details><summary>Falls, errors and trials given up ({which})</summary>"
    yield "<div class=wide><table><tr><th>trial<th>study<th>values<th class=number>steps<th class=number>time [s]"
    yield "<th>how it ended<th>what broke</tr>"
    for row in shown:
        values = ", ".join(f"{name} = {number(value)}" for name, value in row.axis_values.items())
        yield (
            f"<tr><td><code>{html.escape(row.controller)}/{row.trial}</code><td>{html.escape(row.study)}"
            f"<td>{html.escape(values)}<td class=number>{row.steps}<td class=number>{row.time_s:.2f}"
            f"<td>{html.escape(row.why)}<td>{html.escape(f'{row.cause}, {row.proof}' if row.cause else '')}</tr>"
        )
    yield "</table></div></details>"
