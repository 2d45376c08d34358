"""One controller against another on the same disturbances: differences of distance and probability with intervals."""

import math

import numpy as np
from numpy.typing import NDArray

from sim.trials.reliability.nearest import SHORT, Nearest
from sim.trials.reliability.probability import Probability, Sample

Difference = tuple[float, float, float]
"""The other's less the one's, and the lower and upper end of its interval."""


def beta_difference(one: Nearest, other: Nearest) -> Difference:
    """Difference of the distances of the nearest falls [standard deviations].

    A fall that was found is one, so the true distance is no larger; and no smaller than by the part `SHORT` that the
    search has been seen to miss on limit states with known answers (docs/reliability.md). Both hold for the one
    realisation of noise and rough ground that is the search's, the same for all; infinite where nothing fell.
    """
    a, b = (near.modes[0].beta if near.modes else math.inf for near in (one, other))
    return 0.0 if a == b else b - a, (1.0 - SHORT) * b - a, b - (1.0 - SHORT) * a


def probability_difference(one: tuple[Probability, Sample], other: tuple[Probability, Sample]) -> Difference:
    """Difference of the probabilities of a fall with its 95 % interval.

    Paired, draw by draw, where both are shares of the same draws; otherwise each has walks of its own, and the two
    intervals are put together.
    """
    (p, first), (q, second) = one, other
    if p.method == q.method == "crude" and len(first.fell) == len(second.fell):
        return paired(second.fell - first.fell)
    low, high = unpaired((p.value, p.low, p.high), (q.value, q.low, q.high))
    return q.value - p.value, low, high


def paired(apart: NDArray[np.float64]) -> Difference:
    """Mean of differences of pairs with its 95 % interval (Agresti, Min, Statistics in Medicine 2005).

    Args:
        apart: 1 where the other alone falls, -1 where the one alone does, 0 where they agree, NaN without a result.
    """
    apart = apart[~np.isnan(apart)]
    value, k = float(apart.mean()), len(apart)
    # a pair more on which each alone falls keeps the width from vanishing where none differ
    width = 1.96 * math.sqrt((apart**2).sum() + 2.0 - k * value**2) / (k + 2.0)
    return value, value - width, value + width


def unpaired(one: tuple[float, float, float], other: tuple[float, float, float]) -> tuple[float, float]:
    """Interval of the other's probability less the one's, each with an interval of its own: value, low, high.

    Newcombe's square-and-add (Statistics in Medicine 1998), for estimates that are independent or rise and fall
    together.
    """
    (p, p_low, p_high), (q, q_low, q_high) = one, other
    return q - p - math.hypot(q - q_low, p_high - p), q - p + math.hypot(q_high - q, p - p_low)
