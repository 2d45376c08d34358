"""The part of a page about a Monte-Carlo study: survival rates, paired comparisons, what explains the falls."""

import html
from collections.abc import Iterator

from sim.trials.plan import MonteCarloStudy
from sim.trials.plan.axis import label, spec_of
from sim.trials.report import plots
from sim.trials.report.findings import RandomFindings, random_findings
from sim.trials.report.page import controller_colour
from sim.trials.run import Results

MOST_CURVES = 9  # survival curves


def random_section(results: Results, study: MonteCarloStudy) -> Iterator[str]:
    """Rates with intervals, each controller against the first, and the axes that explain the falls."""
    found = random_findings(results, study)
    if not found.rates:
        return
    yield plots.rate_bars(found)
    yield "<p>" + " ".join(_rate_words(found)) + "</p>"
    if found.pairs:
        yield from _pairs(found)
    yield (
        "<h3>Which axes explain the falls</h3><p class=muted>Spearman's rank correlation with survival: solid of "
        "the value, pale of its distance from the median.</p>"
    )
    for place, (controller, axes) in enumerate(found.attributions.items()):
        if axes:
            yield f"<h4>{html.escape(controller)}</h4>" + plots.attribution_bars(axes, controller_colour(place))
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


def _pairs(found: RandomFindings) -> Iterator[str]:
    """Each controller against the reference, on the same draws."""
    reference = html.escape(found.reference)
    several = ", adjusted for the number of comparisons by Holm's method" if len(found.p) > 1 else ""
    yield f"<h3>Against {reference}, draw by draw</h3>" + plots.paired_bars(found)
    yield (
        f"<p class=muted>The same draws for all. p is that of McNemar's exact test{several}: how likely so uneven a "
        f"split of the draws they differ on is if both survive alike.</p><div class=wide><table style='width:auto'>"
        f"<tr><th><th class=number>both survive<th class=number>{reference} alone<th class=number>it alone"
        "<th class=number>neither<th class=number>difference<th class=number>p</tr>"
    )
    for other, pair in found.pairs.items():
        trials = pair.both + pair.first + pair.second + pair.neither
        difference = 100 * (pair.second - pair.first) / max(1, trials)
        yield (
            f"<tr><td>{html.escape(other)}<td class=number>{pair.both}<td class=number>{pair.first}"
            f"<td class=number>{pair.second}<td class=number>{pair.neither}<td class=number>{difference:+.1f} %"
            f"<td class=number>{found.p[other]:.2g}</tr>"
        )
    yield "</table></div>"
