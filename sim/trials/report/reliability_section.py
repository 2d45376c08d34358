"""What a page says of a study of the nearest fall, each figure with a line on what it means."""

from collections.abc import Sequence
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np

from sim.pages.palette import colour
from sim.trials.plan import CertificateStudy, ReliabilityStudy
from sim.trials.reliability.certificate import Verdict
from sim.trials.reliability.nearest import WITHIN
from sim.trials.reliability.probability import LEVEL, Probability
from sim.trials.reliability.procedure import RADII, SPOKES, Certified
from sim.trials.report import reliability_plots as plots
from sim.trials.report import reliability_tables as tables
from sim.trials.report.reliability_findings import (
    Reliability,
    certificates,
    reliability_findings,
    shares,
)
from sim.trials.report.reliability_tables import percent, probable
from sim.trials.run import Results

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
        "legend": [plots.key(place, one.controller) for place, one in enumerate(found.each)],
        "open": list(found.open),
        "level": percent(LEVEL),
        "rows": [
            (one.controller, beta_words(one), *tables.nearest(one, found.space), _words(one), str(one.trials))
            for one in found.each
        ],
        "errors": tables.errors(found.space),
        "phi": _phi(found.each),
        "within": f"{100.0 * WITHIN:g} %",
        "looked": study.look,
        "hidden": f"{_hidden(study.look):.2g}",
        "modes": study.modes,
        "reduce": [
            (one.controller, tables.reduce_first(one, names)) for one in found.each if one.found.probability.value > 0.0
        ],
        "leads": [lead(one, names) for one in found.each],
        "against": list(tables.against(found)),
        "reference": found.each[0].controller,
        "points": [(one.controller, tables.modes(one, found.space, folder)) for one in found.each if one.sides],
        "importance": [
            (one.controller, plots.importance_bars(names, one, colour(place)))
            for place, one in enumerate(found.each)
            if one.sides and one.found.beta > 0.0
        ],
        "fragility": plots.fragility(found.each),
        "walks": [_walks(found.each, at_plan=at_plan) for at_plan in (True, False)],
        "planes": [plots.plane((names[i], names[j]), found.each, k) for k, (i, j) in enumerate(study.planes)],
        "spokes": {"number": SPOKES, "radii": len(RADII), "furthest": f"{RADII[-1]:g}"},
        "halves": [
            (one.controller, probable(one.found.probability.value), tables.halves(one, names)) for one in found.each
        ],
        "axes": len(names),
        "shown": min(tables.MOST_ROWS, len(names)),
        "by_chance": f"{(1.0 - LEVEL) * len(names):.1g}",
        "margins": any(one.margin for one in found.each),
        "sobol": [
            {
                "name": one.controller,
                "accuracy": percent(one.sobol.accuracy) if one.sobol else "",
                "guess": percent(one.sobol.guess) if one.sobol else "",
                "explained": percent(one.margin.accuracy) if one.margin else "",
                "rows": list(tables.sobol(one, names, margins=any(other.margin for other in found.each))),
            }
            for one in found.each
            if one.sobol or one.margin
        ],
    }


def _words(one: Reliability) -> str:
    return probability_words(one.found.probability)


def _phi(each: Sequence[Reliability]) -> str:
    """Phi(-distance) at the nearest distance of the study, and at 1 and 3 deviations, in words."""
    found = {round(one.found.beta, 1) for one in each if one.sides and one.found.beta >= 0.05}
    distances = sorted({min(found, default=1.0), 1.0, 3.0})
    return ", ".join(f"{NormalDist().cdf(-d):.2g} at {d:g}" for d in distances)


def _hidden(looked: int) -> float:
    """Percent of directions that may hide a nearer fall if none of so many fell, at 95 %."""
    return 100.0 * (1.0 - (1.0 - LEVEL) ** (1.0 / looked))


def _walks(each: Sequence[Reliability], *, at_plan: bool) -> str:
    """How many walks a point of the fragility curve is from, at the plan's spreads or at others."""
    known = {known for one in each for scale, _, known, _ in one.scales if (scale == 1.0) == at_plan}
    return f"{min(known)}" + (f" to {max(known)}" if len(known) > 1 else "") if known else ""


def probability_words(p: Probability) -> str:
    """A probability with its interval and how it was found."""
    how = f"{p.falls} of {p.draws} draws" if p.method == "crude" else f"{METHODS[p.method]}, {p.draws} walks"
    words = f"{probable(p.value)} (95 %: {probable(p.low)} to {probable(p.high)}; {how})"
    return words + (f"; {p.unknown} without a result" if p.unknown else "")


def beta_words(one: Reliability) -> str:
    """The distance of the nearest fall, in words."""
    if not one.found.nearest.tried:
        return "nearest fall not searched for"
    if not one.found.nearest.modes:
        fell = one.found.draws.fell[one.found.draws.scale == 1.0]
        return f"not found in {one.found.nearest.tried} walks of the search" if np.nansum(fell) else "no fall found"
    if one.found.beta == 0.0:
        return "0: it falls with every error at its middle"
    return f"{one.found.beta:.2f}"


def lead(one: Reliability, names: Sequence[str]) -> str:
    """One controller in a sentence."""
    words = f"nearest fall at {beta_words(one)}" if one.sides else beta_words(one)
    if one.sides and one.found.beta > 0.0:
        side = one.sides[0]
        made = ", ".join(
            f"{name} {value:+.2f}"
            for name, value in shares(side.importance, names, side.mode.outside, tables.MOST_MADE)
        )
        words += f" deviations ({made}; first symptom: {side.outside.cause or side.outside.why})"
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
