"""The falls of a campaign to look at: run again with their logs, drawn small beside each other, each with its page."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim import pages
from sim.bridge.run import run_scenario
from sim.errors import UserError
from sim.interface import LEGS
from sim.log.read import salvage
from sim.log.read.frames import Run, run_of
from sim.pages.palette import CAUSES
from sim.review.facts import geometry
from sim.review.page import write_page
from sim.review.signals import Signals, signals_of
from sim.trials.falls.recorded import recorded_verdict
from sim.trials.plan import CertificateStudy, ReliabilityStudy
from sim.trials.report.reliability_findings import reliability_findings
from sim.trials.report.report import FALLS, REPORT, write_report
from sim.trials.report.reviews import REVIEWS, beside_of, log_of, review_of
from sim.trials.run import Results, TrialResult
from sim.trials.run.recall import scenario_of

MOMENTS = 6  # of a small picture
BEFORE = 0.25  # [s] before the fall begins that it shows
_SPACING, _SCALE, _GROUND = 0.75, 60.0, 100.0  # [m] between its walkers, [pixel/m], [pixel] of the foot's level


@dataclass(frozen=True, slots=True, kw_only=True)
class Looked:
    """A trial that has its log and its page.

    Attributes:
        row: What the campaign says of it.
        page: Its page in the campaign's folder.
        log: Its log there.
    """

    row: TrialResult
    page: str
    log: str


def review_campaign(
    results: Results, folder: Path, most: int, tell: Callable[[str], None], stop: Callable[[], str | None]
) -> Path:
    """Run some of a campaign's falls again, with logs, and write their pages and one with all of them.

    Of a study of the nearest fall every reported one is among them, and the walk just inside beside it; whether these
    walk and fall as they did is told.

    Args:
        results: Of the campaign.
        folder: Where they are; what is there already is not run again.
        most: Falls to look at, as many causes as there are.
        tell: Told a line for the user before each run.
        stop: Asked now and then; a reason ends it, and the same command goes on from there.

    Returns:
        The page with all of them.

    Raises:
        UserError: nothing fell, or the folder cannot be written.
    """
    edges = list(_edges(results))
    found = {(row.controller, row.trial): row for row in [*(fall for fall, _ in edges), *_chosen(results, most)]}
    falls = list(found.values())[: max(most, len(edges))]
    if not falls:
        raise UserError(f"{folder}: no trial of this campaign fell; there is nothing to review")
    try:
        (folder / REVIEWS).mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder / REVIEWS}: cannot be made: {error.strerror}") from error
    shown = []
    for row in falls:
        if stop():
            break
        shown.append(_small(_look(results, folder, row, tell), folder))
    pairs = list(_beside(results, folder, [*edges, *_pairs(results, falls)], tell, stop))
    if edges and len(pairs) >= len(edges):
        again = sum(all(_ended(folder / log_of(row)) == row.outcome for row in edge) for edge in edges)
        tell(f"{again} of {len(edges)} nearest falls fall again, and the walk just inside each walks")
    title = f"{results.plan.name}: falls"
    body = pages.render("falls.html", title=title, shown=shown, pairs=pairs, back=REPORT)
    pages.write(folder / FALLS, body)
    write_report(results, folder)  # its rows lead to the reviews
    return folder / FALLS


def _edges(results: Results) -> Iterator[tuple[TrialResult, TrialResult]]:
    """Every reported nearest fall of the studies that search for them, and the walk just inside."""
    for study in results.plan.studies:
        if isinstance(study, ReliabilityStudy):
            for one in reliability_findings(results, study).each:
                yield from ((side.outside, side.inside) for side in one.sides if side.inside is not None)


def _beside(
    results: Results,
    folder: Path,
    pairs: Sequence[tuple[TrialResult, TrialResult]],
    tell: Callable[[str], None],
    stop: Callable[[], str | None],
) -> Iterator[dict[str, Any]]:
    """The page of each fall and its survivor, one beside the other, as the page of all falls shows it."""
    for fall, survivor in pairs:
        if stop():
            return
        one, other = _look(results, folder, fall, tell), _look(results, folder, survivor, tell)
        page = beside_of(survivor, fall)
        if not (folder / page).exists():
            write_page([salvage(folder / other.log), salvage(folder / one.log)], folder / page)
        yield {
            "page": page,
            "fall": _words(fall),
            "survivor": _words(survivor),
            "logs": (other.log, one.log),
            "film": beside_of(survivor, fall, ".gif"),
        }


def _ended(log: Path) -> str:
    """How the run of a log ended."""
    return str(run_of(salvage(log)).result.get("outcome", ""))


def _chosen(results: Results, most: int) -> list[TrialResult]:
    """Falls, taken in turn from each cause of each controller, in the order of the trials."""
    queues: dict[tuple[str, str], list[TrialResult]] = {}
    for row in results:
        if row.known and not row.survived:
            queue = queues.setdefault((row.controller, row.cause), [])
            if len(queue) < most:
                queue.append(row)
    found: list[TrialResult] = []
    while len(found) < most and any(queues.values()):
        found += [queue.pop(0) for queue in queues.values() if queue]
    return found[:most]


def _look(results: Results, folder: Path, row: TrialResult, tell: Callable[[str], None]) -> Looked:
    """A trial's log and page, made where they are missing."""
    page, log = review_of(row), log_of(row)
    if not (folder / log).exists():
        tell(f"{row.controller}/{row.trial}")
        growing = folder / f"{log}.partial"  # a killed run leaves no half log under a name that counts
        growing.unlink(missing_ok=True)
        run_scenario(scenario_of(results.plan, row), log=growing)
        growing.replace(folder / log)
    if not (folder / page).exists():
        write_page([salvage(folder / log)], folder / page)
    return Looked(row=row, page=page, log=log)


def _pairs(results: Results, falls: Sequence[TrialResult]) -> Iterator[tuple[TrialResult, TrialResult]]:
    """Of each controller in each study the fall that has a survivor nearest to it, and that survivor.

    Studies that search for them have said so already.
    """
    searched = {s.name for s in results.plan.studies if isinstance(s, ReliabilityStudy | CertificateStudy)}
    for study, controller in dict.fromkeys((row.study, row.controller) for row in falls if row.study not in searched):
        rows = [row for row in results if row.study == study and row.controller == controller and row.known]
        width = _widths(rows)
        best: tuple[float, TrialResult, TrialResult] | None = None
        for fall in (row for row in falls if row.study == study and row.controller == controller):
            for row in rows:
                gap = _gap(fall, row, width) if row.survived else math.inf
                if gap < (best[0] if best else math.inf):
                    best = gap, fall, row
        if best:
            yield best[1], best[2]


def _widths(rows: Sequence[TrialResult]) -> dict[str, float]:
    """Range of every axis with numbers."""
    found: dict[str, list[float]] = {}
    for row in rows:
        for name, value in row.axis_values.items():
            if isinstance(value, int | float):
                found.setdefault(name, []).append(float(value))
    return {name: (max(values) - min(values)) or 1.0 for name, values in found.items()}


def _gap(a: TrialResult, b: TrialResult, width: dict[str, float]) -> float:
    """Distance of two trials in shares of each axis' range; without end where they do not move the same axes."""
    here, there = a.axis_values, b.axis_values
    if here.keys() != there.keys():
        return math.inf
    parts = []
    for name in here:
        one, other = here[name], there[name]
        if isinstance(one, int | float) and isinstance(other, int | float):
            parts.append((one - other) / width[name])
        elif one != other:
            return math.inf
    return math.hypot(*parts)


def _words(row: TrialResult) -> str:
    values = ", ".join(f"{name} = {pages.number(value)}" for name, value in row.axis_values.items())
    return f"{row.controller}/{row.trial}: {values}"


def _small(looked: Looked, folder: Path) -> dict[str, Any]:
    """The small picture of a fall, and what stands under it."""
    row, run = looked.row, run_of(salvage(folder / looked.log))
    word = row.cause.partition(":")[0]
    return {
        "page": looked.page,
        "id": f"{row.controller}/{row.trial}",
        "words": _words(row),
        "cause": row.cause or row.why,
        "proof": row.proof if row.cause else "",
        "colour": CAUSES.get(word, CAUSES["unclear"]),
        "figures": _figures(run),
        "width": round(_SCALE * _SPACING * MOMENTS + 40),
    }


def _figures(run: Run) -> list[dict[str, Any]]:
    """Stick figures side by side, from before the fall begins to its end: points of each limb in [pixel]."""
    signals, verdict = signals_of(run), recorded_verdict(run)
    last = float(signals.t[-1])
    began = verdict[1].began_s if verdict else last
    lengths = geometry(run)
    return [
        _figure(signals, lengths, float(t), 30.0 + _SCALE * _SPACING * at)
        for at, t in enumerate(np.linspace(max(0.0, min(began - BEFORE, last)), last, MOMENTS))
    ]


def _figure(signals: Signals, lengths: dict[str, Any], t: float, x0: float) -> dict[str, Any]:
    row = min(int(np.searchsorted(signals.t, t)), len(signals.t) - 1)
    q = {key: float(np.nan_to_num(values[row])) for key, values in signals.columns.items() if key.startswith("q.")}

    def on(at: tuple[float, float], length: float, phi: float) -> tuple[float, float]:
        return at[0] - length * math.sin(phi), at[1] + length * math.cos(phi)

    hip = (0.0, 0.0)
    limbs = {"torso": [hip, on(hip, lengths["torso"], q["q.torso"])]}
    for leg in ("right", "left"):
        upper = q["q.torso"] + q[f"q.{leg}_hip"]
        knee = on(hip, lengths[f"{leg}_femur"], upper)
        limbs[leg] = [hip, knee, on(knee, lengths[f"{leg}_tibia"], upper + q[f"q.{leg}_knee"])]
    clear = {leg: 1e-3 * float(np.nan_to_num(signals.columns[f"clearance.{leg}"][row])) for leg in LEGS}
    ground = min(limbs[leg][2][1] - clear[leg] for leg in LEGS)  # under the lower foot, whatever the slope
    points = {
        name: " ".join(f"{x0 + _SCALE * x:.1f},{_GROUND - _SCALE * min(z - ground, 3.0):.1f}" for x, z in line)
        for name, line in limbs.items()
    }
    return {"t": f"{t:.2f} s", "x": x0, "limbs": points}
