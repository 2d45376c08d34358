"""Two checks of a study of the nearest fall: the same under other seeds, and against many plain draws."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.trials.plan import ReliabilityStudy
from sim.trials.reliability.differences import unpaired
from sim.trials.reliability.probability import wilson
from sim.trials.report.reliability_findings import ReliabilityFindings, reliability_findings
from sim.trials.run import Results


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeats:
    """A study of one controller under several seeds.

    Attributes:
        controller: Kind of controller.
        seeds: Of the plan, one each.
        betas: Distances of the nearest falls [standard deviations], infinite where nothing fell, one each.
        probabilities: Of a fall with their 95 % intervals: value, low, high, one each.
    """

    controller: str
    seeds: tuple[int, ...]
    betas: tuple[float, ...]
    probabilities: tuple[tuple[float, float, float], ...]

    @property
    def mean(self) -> float:
        """Mean distance [standard deviations]."""
        return float(np.mean(self.betas))

    @property
    def deviation(self) -> float:
        """Standard deviation of the distance over the seeds, as a part of its mean."""
        return float(np.std(self.betas, ddof=1)) / self.mean if len(self.betas) > 1 else math.nan

    @property
    def spread(self) -> float:
        """Largest less smallest distance, as a part of their mean."""
        return (max(self.betas) - min(self.betas)) / self.mean

    @property
    def lines(self) -> list[str]:
        """In words: two lines for all, then one for each seed."""
        least, most = min(self.betas), max(self.betas)
        head = f"{self.controller}: distance of the nearest fall {least:.3f} to {most:.3f} deviations"
        if math.isfinite(self.mean) and self.mean > 0.0:
            head += (
                f", mean {self.mean:.3f}: largest less smallest {100 * self.spread:.1f} % of the mean, standard "
                f"deviation {100 * self.deviation:.1f} %; {len(self.seeds)} seeds, "
                "each with its own noise and rough ground"
            )
        values = [value for value, _, _ in self.probabilities]
        mean = float(np.mean(values))
        holding = sum(low <= mean <= high for _, low, high in self.probabilities)
        return [
            head,
            f"  P of a fall {min(values):.3g} to {max(values):.3g}, mean {mean:.3g}; "
            f"{holding} of {len(values)} intervals of 95 % hold the mean",
            *(
                f"  seed {seed}: {beta:.3f} deviations; P {value:.3g} (95 %: {low:.3g} to {high:.3g})"
                for seed, beta, (value, low, high) in zip(self.seeds, self.betas, self.probabilities, strict=True)
            ),
        ]


def repeats(seeds: Sequence[int], found: Sequence[ReliabilityFindings]) -> list[Repeats]:
    """Gather the findings of one study under several seeds, by controller.

    Args:
        seeds: Of the plans.
        found: What each found; all of the same controllers.
    """
    made = []
    for place, one in enumerate(found[0].each):
        each = [other.each[place] for other in found]
        said = [one.found.probability for one in each]
        made.append(
            Repeats(
                controller=one.controller,
                seeds=tuple(seeds),
                betas=tuple(one.found.beta for one in each),
                probabilities=tuple((p.value, p.low, p.high) for p in said),
            )
        )
    return made


@dataclass(frozen=True, slots=True, kw_only=True)
class CrudeCheck:
    """A study of one controller against plain draws.

    Attributes:
        controller: Kind of controller.
        draws: Plain draws with a result.
        falls: How many of them fell.
        nearest: Distance of the nearest that fell [standard deviations], infinite if none did.
        trial: Its trial.
        nearer: Falls among the draws that are nearer than the study's nearest.
        beta: Distance of the study's nearest fall [standard deviations].
        probability: The study's probability of a fall with its 95 % interval: value, low, high.
    """

    controller: str
    draws: int
    falls: int
    nearest: float
    trial: str
    nearer: int
    beta: float
    probability: tuple[float, float, float]

    @property
    def lines(self) -> list[str]:
        """In words."""
        share, (low, high) = self.falls / max(self.draws, 1), wilson(self.falls, self.draws)
        value, p_low, p_high = self.probability
        inside = "inside" if p_low <= share <= p_high else "outside"
        less, more = unpaired(self.probability, (share, low, high))
        agree = "agree" if less <= 0.0 <= more else "do not agree"
        far = "never farther" if not self.nearer else f"FARTHER than {self.nearer} of the falls among the draws"
        return [
            f"{self.controller}: nearest of {self.falls} falls among {self.draws} draws {self.nearest:.3f} deviations"
            f"{f' ({self.trial})' if self.trial else ''}; the study's nearest fall {self.beta:.3f}: {far}",
            f"  share of falls {share:.3g} (95 %: {low:.3g} to {high:.3g}); the study's P {value:.3g} "
            f"(95 %: {p_low:.3g} to {p_high:.3g}): the share is {inside} its interval, the two {agree}",
        ]


def crude_checks(found: ReliabilityFindings, crude: Results, study: ReliabilityStudy) -> list[CrudeCheck]:
    """Compare a study with a plan's plain draws of the same axes.

    Args:
        found: What the study found.
        crude: Results of the plain draws.
        study: Their study in that plan.
    """
    start = next(start for start, other in crude.plan.offsets() if other is study)
    checks = []
    for one in reliability_findings(crude, study).each:
        theirs = next(other for other in found.each if other.controller == one.controller)
        draws, p = one.found.draws, theirs.found.probability
        fell = np.flatnonzero(np.nan_to_num(draws.fell) > 0.5)
        far = np.linalg.norm(draws.u[fell], axis=1)
        at = int(fell[far.argmin()]) if len(fell) else -1
        checks.append(
            CrudeCheck(
                controller=one.controller,
                draws=int((~np.isnan(draws.fell)).sum()),
                falls=len(fell),
                nearest=float(far.min(initial=math.inf)),
                trial=f"{one.controller}/{start + at}" if len(fell) else "",
                nearer=int((far < theirs.found.beta).sum()),
                beta=theirs.found.beta,
                probability=(p.value, p.low, p.high),
            )
        )
    return checks
