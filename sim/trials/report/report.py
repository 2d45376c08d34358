"""What a campaign leaves beside its database: two HTML pages, a table as CSV, the plots as SVG files."""

import csv
import dataclasses
import heapq
import html
import io
import json
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from sim import pages
from sim.errors import UserError
from sim.pages.palette import CAUSES, colour
from sim.trials.plan import CertificateStudy, GridStudy, MarginStudy, ReliabilityStudy
from sim.trials.plan.plan import Study, to_toml
from sim.trials.report.breaks import RULE, SHARE, SYMPTOMS, breaks
from sim.trials.report.findings import side_figures, sides
from sim.trials.report.grid_section import grid_section
from sim.trials.report.margin_section import margin_section
from sim.trials.report.random_section import random_section
from sim.trials.report.reliability_section import certificate_section, reliability_section
from sim.trials.report.reviews import review_of
from sim.trials.report.summary import counted
from sim.trials.run import Results, TrialResult
from sim.trials.run.campaign import pending
from sim.trials.run.store import Counts

REPORT, BREAKS = "report.html", "breaks.html"
FALLS = "falls.html"
"""Page of the falls that were run again, where they have been."""
MOST_FALLS = 100  # rows of the list of falls
SOUGHT = "Most were sent to the edge of falling on purpose: their share of falls is no probability."
"""Of trials that a search for the nearest fall asked for."""


def write_report(results: Results, folder: Path) -> Path:
    """Write report.html, breaks.html, results.csv, margins.json and plots/ into a folder.

    Args:
        results: What the campaign found.
        folder: Where they go.

    Returns:
        Path of the first page.

    Raises:
        UserError: the folder cannot be written.
    """
    report, what_breaks = _report(results, folder), _breaks(results)
    try:
        _write_csv(results, folder / "results.csv")
        _write_margins(results, folder / "margins.json")
        pages.write(folder / REPORT, report)
        pages.write(folder / BREAKS, what_breaks)
        _write_plots(report + what_breaks, folder / "plots")
    except OSError as error:
        raise UserError(f"{folder}: the page cannot be written: {error.strerror}") from error
    return folder / REPORT


def _write_csv(results: Results, path: Path) -> None:
    names = [field.name for field in dataclasses.fields(TrialResult)]
    text = io.StringIO(newline="")
    table = csv.writer(text)
    table.writerow(names)
    for row in results:
        table.writerow([getattr(row, name) for name in names])
    pages.write(path, text.getvalue())


def _write_margins(results: Results, path: Path) -> None:
    """Every side of every margin study whose search is finished, as a list of objects."""
    found = [
        {"study": study.name, "draws": study.draws} | side_figures(side)
        for study in results.plan.studies
        if isinstance(study, MarginStudy)
        for side in sides(results, study)
    ]
    pages.write(path, json.dumps(found, indent=1, allow_nan=False) + "\n")


def _write_plots(body: str, folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    old = set(folder.glob("*.svg"))
    for place, found in enumerate(re.finditer(r"<svg.*?</svg>", body, flags=re.DOTALL)):
        title = re.search(r"<title>(.*?)</title>", found[0])
        name = re.sub(r"\W+", "-", html.unescape(title[1]) if title else "plot").strip("-").lower()[:60]
        path = folder / f"{place:03}-{name}.svg"
        pages.write(path, found[0].replace("currentColor", "#000"))
        old.discard(path)
    for path in old:
        path.unlink()


def _report(results: Results, folder: Path) -> str:
    plan = results.plan
    counts = results.store.counts()
    done = sum(one.done for one in counts.values())
    keys = [
        (colour(place), f"{name}: {counted(counts.get(name, Counts()))}") for place, name in enumerate(plan.controllers)
    ]
    return pages.render(
        "report.html",
        title=plan.name,
        description=plan.description,
        keys=keys,
        about=f"{done} trials, seed {plan.seed}. {_criteria(results)}",
        sought=_sought(results),
        sided=any(isinstance(study, MarginStudy) for study in plan.studies),
        unfinished=bool(pending(plan, results.store)),
        breaks=BREAKS,
        controllers=plan.controllers,
        studies=[(study.name, _section(results, study, folder)) for study in plan.studies],
        falls=list(_falls(results, folder)),
        looked_at=FALLS if (folder / FALLS).exists() else "",
        falls_in_all=sum(one.done - one.survived for one in counts.values()),
        plan=to_toml(plan),
    )


def _section(results: Results, study: Study, folder: Path) -> dict[str, Any]:
    if isinstance(study, MarginStudy):
        return margin_section(results, study)
    if isinstance(study, ReliabilityStudy):
        return reliability_section(results, study, folder)
    if isinstance(study, CertificateStudy):
        return certificate_section(results, study)
    return grid_section(results, study) if isinstance(study, GridStudy) else random_section(results, study)


def _breaks(results: Results) -> str:
    return pages.render(
        "breaks.html",
        title=f"{results.plan.name}: what breaks",
        back=REPORT,
        sought=_sought(results),
        rule=RULE,
        share=SHARE,
        symptoms=SYMPTOMS,
        colours=CAUSES,
        controllers=results.plan.controllers,
        studies=list(breaks(results)),
    )


def _sought(results: Results) -> str:
    """What the share of falls among all trials does not say, where a search chose them."""
    return SOUGHT if any(isinstance(study, ReliabilityStudy) and study.modes for study in results.plan.studies) else ""


def _criteria(results: Results) -> str:
    """What the trials were judged by, as their runs recorded it."""
    steps, limit, found = results.plan.scenario.steps, results.plan.scenario.end_time, results.store.criteria()
    if not found:
        return ""
    names = ("step_length", "hip_height", "torso_tilt", "stall_time")
    length, height, tilt, time = (_range([one.get(name, math.nan) for one in found]) for name in names)
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


def _falls(results: Results, folder: Path) -> Iterator[Sequence[str]]:
    """The first falls and errors, each with the id that runs it again, a link where it has been."""
    rows = (row for row in results if not row.survived)
    first = heapq.nsmallest(MOST_FALLS, rows, key=lambda row: (row.known, row.trial, row.controller))
    for row in first:
        values = ", ".join(f"{name} = {pages.number(value)}" for name, value in row.axis_values.items())
        cause = f"{row.cause}, {row.proof}" if row.cause else ""
        name, page = f"{row.controller}/{row.trial}", review_of(row)
        shown = pages.link(page, name) if (folder / page).exists() else name
        yield shown, row.study, values, str(row.steps), f"{row.time_s:.2f}", row.why, cause
