"""What the results of a study of the nearest fall say, with the trials to run again. No pictures, no pages."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.trials.plan import CertificateStudy, ReliabilityStudy
from sim.trials.plan.axis import Value
from sim.trials.reliability.asking import Array
from sim.trials.reliability.nearest import Mode
from sim.trials.reliability.probability import Probability
from sim.trials.reliability.procedure import Certified, Found
from sim.trials.reliability.sensitivity import Sobol, halved, importance, sobol
from sim.trials.reliability.space import Space
from sim.trials.report.stats import wilson
from sim.trials.run import Results, TrialResult
from sim.trials.run.replay import Replay, Replays

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
        halves: By axis, the probability with half its spread.
        sobol: Sobol' indices; None with too few falls or walks.
    """

    controller: str
    found: Found
    trials: int
    sides: tuple[Side, ...]
    scales: tuple[tuple[float, int, int, tuple[float, float]], ...]
    halves: tuple[Probability, ...]
    sobol: Sobol | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Against:
    """A controller against the reference, on the same random walks.

    Attributes:
        controller: Kind of controller.
        beta: Difference of the distances of the nearest fall.
        beta_interval: Between what is known: both lie between the walk just inside and the fall.
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
    return Reliability(
        controller=controller,
        found=found,
        trials=len(u),
        sides=tuple(sides),
        scales=tuple(scales),
        halves=tuple(halved(found.sample, axis) for axis in range(u.shape[1])),
        sobol=sobol(draws.u[near], draws.fell[near]),
    )


def _reach(one: Reliability) -> tuple[float, float]:
    """Distances of the walk just inside the nearest fall and of the fall; infinite if nothing fell."""
    if not one.sides:
        return math.inf, math.inf
    mode = one.sides[0].mode
    inside = float(np.linalg.norm(mode.inside))
    return (0.0 if math.isnan(inside) else inside), mode.beta


def _against(first: Reliability, other: Reliability) -> Against:
    (inside, fall), (other_inside, other_fall) = _reach(first), _reach(other)
    value, low, high = _difference(first, other)
    return Against(
        controller=other.controller,
        beta=_minus(other_fall, fall),
        beta_interval=(other_inside - fall, other_fall - inside),
        probability=value,
        probability_interval=(low, high),
    )


def _minus(one: float, other: float) -> float:
    return 0.0 if one == other else one - other


def _difference(first: Reliability, other: Reliability) -> tuple[float, float, float]:
    """Difference of the probabilities with its 95 % interval: paired where both are of the same draws."""
    p, q = first.found.probability, other.found.probability
    if p.method == q.method == "crude" and len(first.found.sample.fell) == len(other.found.sample.fell):
        apart = other.found.sample.fell - first.found.sample.fell
        apart = apart[~np.isnan(apart)]
        value, k = float(apart.mean()), len(apart)
        # a draw more on which each alone falls keeps the width from vanishing where none differ (Agresti, Min 2005)
        width = 1.96 * math.sqrt((apart**2).sum() + 2.0 - k * value**2) / (k + 2.0)
        return value, value - width, value + width
    low, high = unpaired((p.value, p.low, p.high), (q.value, q.low, q.high))
    return q.value - p.value, low, high


def unpaired(one: tuple[float, float, float], other: tuple[float, float, float]) -> tuple[float, float]:
    """Interval of the other's probability less the one's, each with an interval of its own: value, low, high.

    Newcombe's square-and-add (Statistics in Medicine 1998), for estimates that are independent.
    """
    (p, p_low, p_high), (q, q_low, q_high) = one, other
    return q - p - math.hypot(q - q_low, p_high - p), q - p + math.hypot(q_high - q, p - p_low)


def certificates(results: Results, study: CertificateStudy) -> dict[str, Certified | None]:
    """What a certificate says of each controller; None while its course is not over."""
    start = next(start for start, other in results.plan.offsets() if other is study)
    replays = Replays(results.plan, results.store)
    found = {c: replays.replay(study, start, c).found for c in results.plan.controllers}
    return {c: one if isinstance(one, Certified) else None for c, one in found.items()}


def shares(importances: Array, names: Sequence[str], signs: Array, most: int = 5) -> list[tuple[str, float]]:
    """The axes with the largest shares, signed deviations each, largest first."""
    order = np.argsort(-importances)[:most]
    return [(names[k], float(signs[k])) for k in order if importances[k] >= 0.005]
