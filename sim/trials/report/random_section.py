"""What a page says of a Monte-Carlo study: survival rates, paired comparisons, what explains the falls."""

from collections.abc import Iterator
from typing import Any

from sim.pages.palette import colour
from sim.trials.plan import MonteCarloStudy
from sim.trials.plan.axis import label, spec_of
from sim.trials.report import plots
from sim.trials.report.findings import RandomFindings, random_findings
from sim.trials.report.summary import rate_words
from sim.trials.run import Results

CURVES = 9  # survival curves that are shown


def random_section(results: Results, study: MonteCarloStudy) -> dict[str, Any]:
    """Rates with intervals, each controller against the first, and the axes that explain the falls."""
    found = random_findings(results, study)
    if not found.rates:
        return {"kind": "nothing"}
    units = {label(axis): spec_of(axis, results.plan.scenario).unit for axis in study.axes}
    strongest: dict[str, float] = {}
    for one in (one for axes in found.attributions.values() for one in axes):
        strongest[one.axis] = max(strongest.get(one.axis, 0.0), one.strength)
    curves = sorted(strongest, key=lambda name: -strongest[name])[:CURVES]
    return {
        "kind": "random",
        "rates": plots.rate_bars(found),
        "words": " ".join(f"{rate_words(rate)}." for rate in found.rates),
        "reference": found.reference,
        "adjusted": ", adjusted for the number of comparisons by Holm's method" if len(found.p) > 1 else "",
        "paired": plots.paired_bars(found) if found.pairs else "",
        "pairs": list(_pairs(found)),
        "attributions": [
            (name, plots.attribution_bars(axes, colour(place)))
            for place, (name, axes) in enumerate(found.attributions.items())
            if axes
        ],
        "curves": [plots.survival_curve(axis, units[axis], found.results) for axis in curves],
    }


def _pairs(found: RandomFindings) -> Iterator[tuple[Any, ...]]:
    """Each controller against the reference, on the same draws."""
    for other, pair in found.pairs.items():
        trials = pair.both + pair.first + pair.second + pair.neither
        difference = 100 * (pair.second - pair.first) / max(1, trials)
        counts = (pair.both, pair.first, pair.second, pair.neither)
        yield other, *counts, f"{difference:+.1f} %", f"{found.p[other]:.2g}"
