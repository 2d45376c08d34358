"""What the results of a study of the nearest fall say, with the trials to run again. No pictures, no pages."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.trials.plan import CertificateStudy, ReliabilityStudy
from sim.trials.plan.axis import Value
from sim.trials.reliability.asking import Array
from sim.trials.reliability.differences import Difference, beta_difference, probability_difference
from sim.trials.reliability.nearest import Mode
from sim.trials.reliability.probability import wilson
from sim.trials.reliability.procedure import Certified, Found
from sim.trials.reliability.sensitivity import Sobol, halving, importance, sobol, sobol_of_margin
from sim.trials.reliability.space import Space
from sim.trials.run import Results, TrialResult
from sim.trials.run.replay import Replay, Replays

LEAST = 0.005  # importance of an axis that is shown
SOBOL_SCALE = 1.5  # widest scale whose walks the model of Sobol' indices is fitted to


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Side:
    """A nearest fall and the walk just inside.

    Attributes:
        mode: Both points in standard normal space.
        importance: Each axis' part of the squared distance, (n,).
        values: Of the axes where it falls.
        inside: Trial that walks just inside; None for one that no trial is.
        outside: Trial that falls.
    """

    mode: Mode
    importance: Array
    values: tuple[Value, ...]
    inside: TrialResult | None
    outside: TrialResult


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reliability:
    """What a study says of one controller.

    Attributes:
        controller: Kind of controller.
        found: What its course found.
        trials: Walks it took.
        sides: The nearest falls, nearest first.
        scales: Of each scale of all spreads: the scale, falls, draws, and the 95 % interval of the probability.
        changes: By axis, the probability with half its spread less that as it is, and the ends of its 95 % interval.
        sobol: Sobol' indices of the fall; None with too few falls or walks.
        margin: Sobol' indices of the least forward speed of the hip, 0 where it is less; None where not recorded.
    """

    controller: str
    found: Found
    trials: int
    sides: tuple[Side, ...]
    scales: tuple[tuple[float, int, int, tuple[float, float]], ...]
    changes: tuple[Difference, ...]
    sobol: Sobol | None
    margin: Sobol | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Against:
    """A controller against the reference, on the same random walks.

    Attributes:
        controller: Kind of controller.
        beta: Difference of the distances of the nearest fall.
        beta_interval: Its interval by what the search has been seen to miss.
        probability: Difference of the probabilities of a fall.
        probability_interval: Its 95 % interval.
    """

    controller: str
    beta: float
    beta_interval: tuple[float, float]
    probability: float
    probability_interval: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReliabilityFindings:
    """What a study says.

    Attributes:
        space: Its axes.
        each: Of every controller whose course is over.
        open: Controllers whose course is not.
        against: Each other controller against the first.
    """

    space: Space
    each: tuple[Reliability, ...]
    open: tuple[str, ...]
    against: tuple[Against, ...]


def reliability_findings(results: Results, study: ReliabilityStudy) -> ReliabilityFindings:
    """Go through the study again, and say what it found."""
    start = next(start for start, other in results.plan.offsets() if other is study)
    replays = Replays(results.plan, results.store)
    space = replays.space(study)
    each, left = [], []
    for controller in results.plan.controllers:
        replay = replays.replay(study, start, controller)
        if isinstance(replay.found, Found):
            each.append(_of(results, space, controller, replay, replay.found, start))
        else:
            left.append(controller)
    against = tuple(_against(each[0], other) for other in each[1:])
    return ReliabilityFindings(space=space, each=tuple(each), open=tuple(left), against=against)


def _of(results: Results, space: Space, controller: str, replay: Replay, found: Found, start: int) -> Reliability:
    u, fell = np.concatenate(replay.points), np.concatenate(replay.fell)

    def trial(point: Array, fate: float) -> TrialResult | None:
        here = np.flatnonzero((u == point).all(axis=1) & (fell == fate))
        return results.store.result(controller, start + int(here[-1])) if len(here) else None

    sides = []
    for mode in found.nearest.modes:
        outside = trial(mode.outside, 1.0)
        if outside is not None:
            sides.append(
                Side(
                    mode=mode,
                    importance=importance(mode),
                    values=space.values(mode.outside),
                    inside=trial(mode.inside, 0.0),
                    outside=outside,
                )
            )
    draws = found.draws
    scales = []
    for scale in sorted({float(s) for s in draws.scale if s > 0.0}):
        at = draws.at(scale)
        known = int((~np.isnan(at.fell)).sum())
        falls = int(np.nansum(at.fell))
        scales.append((scale, falls, known, wilson(falls, known)))
    near = (draws.scale <= SOBOL_SCALE) & (draws.scale > 0.0) & ~np.isnan(draws.fell)
    margin = np.concatenate(replay.margins)[: len(near)]  # the draws are what a study asks for first
    told = near & ~np.isnan(margin)
    return Reliability(
        controller=controller,
        found=found,
        trials=len(u),
        sides=tuple(sides),
        scales=tuple(scales),
        changes=tuple(halving(found.sample, axis) for axis in range(u.shape[1])),
        sobol=sobol(draws.u[near], draws.fell[near]),
        margin=sobol_of_margin(draws.u[told], np.maximum(margin[told], 0.0)),
    )


def _against(first: Reliability, other: Reliability) -> Against:
    one, two = first.found, other.found
    beta, *beta_interval = beta_difference(one.nearest, two.nearest)
    value, *interval = probability_difference((one.probability, one.sample), (two.probability, two.sample))
    return Against(
        controller=other.controller,
        beta=beta,
        beta_interval=(beta_interval[0], beta_interval[1]),
        probability=value,
        probability_interval=(interval[0], interval[1]),
    )


def certificates(results: Results, study: CertificateStudy) -> dict[str, Certified | None]:
    """What a certificate says of each controller; None while its course is not over."""
    start = next(start for start, other in results.plan.offsets() if other is study)
    replays = Replays(results.plan, results.store)
    found = {c: replays.replay(study, start, c).found for c in results.plan.controllers}
    return {c: one if isinstance(one, Certified) else None for c, one in found.items()}


def shares(importances: Array, names: Sequence[str], signs: Array, most: int) -> list[tuple[str, float]]:
    """The axes with the largest shares, signed deviations each, largest first."""
    order = np.argsort(-importances)[:most]
    return [(names[k], float(signs[k])) for k in order if importances[k] >= LEAST]
