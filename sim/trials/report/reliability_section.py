"""What a page says of a study of the nearest fall, each figure with a line on what it means."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim.pages import link, number
from sim.pages.palette import colour
from sim.trials.plan import CertificateStudy, ReliabilityStudy
from sim.trials.reliability.certificate import Verdict
from sim.trials.reliability.probability import Probability
from sim.trials.reliability.procedure import Certified
from sim.trials.reliability.space import Space
from sim.trials.report import reliability_plots as plots
from sim.trials.report.reliability_findings import (
    LEAST,
    Reliability,
    ReliabilityFindings,
    Side,
    certificates,
    reliability_findings,
    shares,
)
from sim.trials.report.reviews import beside_of, log_of, review_of
from sim.trials.run import Results

MOST_ROWS = 8  # axes of a table

METHODS = {
    "importance": "importance sampling",
    "subset": "subset simulation",
    "directional": "directional sampling",
}


def reliability_section(results: Results, study: ReliabilityStudy, folder: Path) -> dict[str, Any]:
    """Distance, probability, what both are made of, and each controller against the first.

    Args:
        results: Of the campaign.
        study: The study.
        folder: Where the page goes; reviews and films that are there are linked.
    """
    found = reliability_findings(results, study)
    if not found.each:
        return {"kind": "nothing"}
    names = found.space.names
    return {
        "kind": "reliability",
        "folder": str(folder),
        "steps": results.plan.scenario.steps,
        "colours": [(colour(place), one.controller) for place, one in enumerate(found.each)],
        "open": list(found.open),
        "rows": [_row(one, names) for one in found.each],
        "leads": [lead(one, names) for one in found.each],
        "against": list(_against(found)),
        "reference": found.each[0].controller,
        "points": [(one.controller, _modes(one, found.space, folder)) for one in found.each if one.sides],
        "importance": [
            (one.controller, plots.importance_bars(names, one, colour(place)))
            for place, one in enumerate(found.each)
            if one.sides and one.found.beta > 0.0
        ],
        "fragility": plots.fragility(found.each),
        "planes": [plots.plane((names[i], names[j]), found.each, k) for k, (i, j) in enumerate(study.planes)],
        "halves": [(one.controller, list(_halves(one, names))) for one in found.each],
        "sobol": [
            {
                "name": one.controller,
                "accuracy": f"{one.sobol.accuracy:.0%}" if one.sobol else "",
                "guess": f"{one.sobol.guess:.0%}" if one.sobol else "",
                "explained": f"{one.margin.accuracy:.0%}" if one.margin else "",
                "rows": list(_sobol(one, names)),
            }
            for one in found.each
            if one.sobol or one.margin
        ],
    }


def probability_words(p: Probability) -> str:
    """A probability with its interval and how it was found."""
    how = f"{p.falls} of {p.draws} draws" if p.method == "crude" else f"{METHODS[p.method]}, {p.draws} walks"
    words = f"{p.value:.2g} (95 %: {p.low:.2g} to {p.high:.2g}; {how})"
    return words + (f"; {p.unknown} without a result" if p.unknown else "")


def beta_words(one: Reliability) -> str:
    """The distance of the nearest fall, in words."""
    if not one.found.nearest.tried:
        return "nearest fall not searched for"
    if not one.found.nearest.modes:
        fell = one.found.draws.fell[one.found.draws.scale == 1.0]
        return f"not found in {one.found.nearest.tried} walks of the search" if np.nansum(fell) else "no fall found"
    if one.found.beta == 0.0:
        return "0: it falls with nothing wrong at all"
    return f"{one.found.beta:.2f}"


def lead(one: Reliability, names: Sequence[str]) -> str:
    """One controller in a sentence."""
    words = f"nearest fall at {beta_words(one)}" if one.sides else beta_words(one)
    if one.sides and one.found.beta > 0.0:
        side = one.sides[0]
        made = ", ".join(f"{name} {value:+.2f}" for name, value in shares(side.importance, names, side.mode.outside))
        words += f" deviations ({made}; {side.outside.cause or side.outside.why})"
    return f"{words}; P of a fall {probability_words(one.found.probability)}; {one.trials} walks"


def certificate_words(study: CertificateStudy, found: Certified | None) -> str:
    """What a certificate says of one controller."""
    if found is None:
        return "not all walks have been run yet"
    what = f"a walk falls with a probability below {study.probability:g}, at {study.confidence:.4g} confidence"
    counted = f"{found.falls} of {found.walks} walks fell"
    if found.verdict is Verdict.CERTIFIED:
        return f"certified: {what}; {counted}"
    if found.verdict is Verdict.REFUSED:
        return f"refused: that {what}, is wrong at that confidence; {counted}"
    return f"neither can be said within {study.most} walks; {counted}"


def certificate_section(results: Results, study: CertificateStudy) -> dict[str, Any]:
    """What a certificate says of each controller."""
    said = certificates(results, study)
    return {"kind": "certificate", "rows": [(name, certificate_words(study, one)) for name, one in said.items()]}


def _row(one: Reliability, names: Sequence[str]) -> tuple[str, ...]:
    p, near = one.found.probability, one.found.nearest
    made = "-"
    if one.sides and one.found.beta > 0.0:
        side = one.sides[0]
        made = ", ".join(f"{name} {value:+.2f}" for name, value in shares(side.importance, names, side.mode.outside, 3))
    looked = f"{near.fell} of {near.looked}" if near.looked else "-"
    return one.controller, beta_words(one), made, looked, probability_words(p), str(one.trials)


def _against(found: ReliabilityFindings) -> Iterator[tuple[str, ...]]:
    for one in found.against:
        low, high = one.beta_interval
        p_low, p_high = one.probability_interval
        beta = (
            f"{one.beta:+.2f} ({low:+.2f} to {high:+.2f})"
            if math.isfinite(high - low)
            else "no nearest fall found of one of them"
        )
        yield one.controller, beta, f"{one.probability:+.3g} ({p_low:+.3g} to {p_high:+.3g})"


def _modes(one: Reliability, space: Space, folder: Path) -> list[dict[str, Any]]:
    return [
        {
            "beta": f"{side.mode.beta:.3f}",
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
    order = sorted(range(len(space.names)), key=lambda k: -side.importance[k])[:MOST_ROWS]
    for k in order:
        if side.importance[k] < LEAST and side.mode.beta > 0.0:
            break
        value, unit = side.values[k], space.units[k]
        words = value if isinstance(value, str) else number(value)
        share = f"{side.importance[k]:.0%}" if side.mode.beta > 0.0 else "-"
        yield space.names[k], f"{words} {unit if unit != '1' else ''}".strip(), f"{side.mode.outside[k]:+.2f}", share


def _halves(one: Reliability, names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    p = one.found.probability
    order = sorted(range(len(names)), key=lambda k: one.halves[k].value)[:MOST_ROWS]
    for k in order:
        half, (_, low, high) = one.halves[k], one.changes[k]
        told = "yes" if high < 0.0 else "no: more falls" if low > 0.0 else "not told"
        yield (
            names[k],
            f"{p.value:.2g}",
            f"{half.value:.2g}",
            f"{half.low:.2g} to {half.high:.2g}",
            f"{low:+.2g} to {high:+.2g}",
            told,
        )


def _sobol(one: Reliability, names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Rows of both indices of the fall and of the least margin, the largest total first."""
    both = (one.sobol, one.margin)
    largest = np.max([found.total for found in both if found], axis=0)
    for k in np.argsort(-largest, kind="stable")[:MOST_ROWS]:
        figures = [(found.first[k], found.total[k]) if found else None for found in both]
        yield names[k], *(f"{part:.2f}" if pair else "-" for pair in figures for part in pair or (0.0, 0.0))
