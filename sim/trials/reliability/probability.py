"""The probability of a fall with an interval: importance sampling around the nearest falls, or plain draws.

Importance sampling draws from a mixture of the plan's own density and of ones moved to the nearest falls, and counts
each fall by the ratio of the densities (Melchers, Beck, Structural Reliability Analysis and Prediction, chapter 3).
The part of the plan's own density keeps every ratio below one over its share, and falls that no search found count
too: the estimate is unbiased whatever the modes are. Its interval cannot know of a mode that no draw has met.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.trials.plan.reliability import Method
from sim.trials.reliability.asking import Array, Search, ask
from sim.trials.reliability.draws import FURTHEST, Draws, normal_draws
from sim.trials.reliability.nearest import Mode

OWN = 0.15  # share of the plan's own density in the mixture
LEAST = 0.1  # of the nearest mode's part, for one further out, which may be a wide one
PILOT = 60  # draws from which the number of draws follows; they count for nothing else, so nothing is biased
MARGIN = 1.3  # more draws than the pilot says, since a pilot is a guess
LEVEL = 0.95  # of every interval
MADE = 0.975  # level for which one of weighted draws is made: its theory takes many falls of even weight for granted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """Weighted draws under the plan's density.

    Attributes:
        u: Points, (k, n).
        fell: 1.0, 0.0, or NaN without a result, (k,).
        weight: Ratio of the plan's density to that they were drawn from, (k,); 1 for plain draws.
        method: How they were drawn.
        group: Which of them are one draw, numbered from 0, (k,), whose weights add up; None if each is one.
    """

    u: Array
    fell: Array
    weight: Array
    method: Method
    group: NDArray[np.int64] | None = None

    def draws(self, y: Array) -> Array:
        """A value for each draw from one for each point, (k,); those of which a point has no result are left out."""
        if self.group is None:
            return y[~np.isnan(self.fell)]
        lost = np.bincount(self.group, weights=np.isnan(self.fell))
        found: Array = np.bincount(self.group, weights=np.nan_to_num(y))[lost == 0]
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Probability:
    """A probability with its interval.

    Attributes:
        value: The estimate.
        low: Lower end of its 95 % interval.
        high: Upper end.
        method: How it was found.
        draws: Walks with a result.
        falls: How many of them fell.
        unknown: Walks without a result, which count for nothing.
    """

    value: float
    low: float
    high: float
    method: Method
    draws: int
    falls: int
    unknown: int = 0


def shares(modes: Sequence[Mode]) -> Array:
    """Shares of the plan's own density and of the modes' parts in a mixture, (m + 1,)."""
    if not modes:
        return np.ones(1)
    beta = np.array([mode.beta for mode in modes])
    part = np.maximum(np.exp(-0.5 * (beta**2 - beta.min() ** 2)), LEAST)
    return np.concatenate(([OWN], (1.0 - OWN) * part / part.sum()))


def mixture(u: Array, modes: Sequence[Mode]) -> tuple[Array, Array]:
    """Shares of the parts of the mixture, (m + 1,), and the ratio of the plan's density to the mixture's, (k,)."""
    share = shares(modes)
    exponents = np.column_stack(
        [np.zeros(len(u)), *(u @ mode.outside - 0.5 * mode.beta**2 for mode in modes)]
    )  # of each part's density over the plan's
    largest = exponents.max(axis=1, keepdims=True)
    ratio = np.exp(-largest[:, 0]) / (np.exp(exponents - largest) @ share)
    return share, ratio


def importance(
    n: int, modes: Sequence[Mode], rng: np.random.Generator, *, variation: float, most: int
) -> Search[Sample]:
    """Draw from the mixture: a pilot, and then once as many as it says are needed.

    Args:
        n: Number of axes.
        modes: The nearest falls.
        rng: Draws the points.
        variation: Coefficient of variation asked for.
        most: Draws at most.
    """
    share, _ = mixture(np.zeros((1, n)), modes)
    centres = np.vstack([np.zeros((1, n)), *(mode.outside for mode in modes)])
    count, noise = min(PILOT, most), 1_000_001
    for is_pilot in (True, False):
        which = rng.choice(len(share), size=count, p=share)
        u = np.clip(centres[which] + rng.normal(size=(count, n)), -FURTHEST, FURTHEST)
        batch = ask(u, np.arange(noise, noise + count))
        fell = yield batch
        sample = Sample(u=batch.u, fell=fell, weight=mixture(batch.u, modes)[1], method="importance")
        noise += count
        if is_pilot:
            y = np.nan_to_num(fell) * sample.weight
            mean, spread = float(y.mean()), float(y.std())
            needed = MARGIN * (spread / (variation * mean)) ** 2 if mean > 0.0 else math.inf
            count = int(min(most, max(PILOT, needed)))
    return sample


def further(draws: Draws, n: int, seed: np.random.SeedSequence, *, variation: float, most: int) -> Search[Sample]:
    """Draw plainly, once as many as the draws there are say are needed; they count for nothing else.

    Args:
        draws: The draws there are; at the plan's spreads they are the first of the same sequence.
        n: Number of axes.
        seed: Of the points.
        variation: Coefficient of variation asked for.
        most: Draws at most.
    """
    pilot = plain(draws).fell
    first, share = len(pilot), float(np.nan_to_num(pilot).mean())
    needed = MARGIN * (1.0 - share) / (share * variation**2) if share > 0.0 else math.inf
    count = int(min(most, max(PILOT, needed)))
    u = np.clip(normal_draws(n, seed, first, count), -FURTHEST, FURTHEST)
    batch = ask(u, np.arange(first, first + count) + 1)
    fell = yield batch
    return Sample(u=batch.u, fell=fell, weight=np.ones(count), method="crude")


def plain(draws: Draws) -> Sample:
    """The draws at the plan's own spreads."""
    own = draws.at(1.0)
    return Sample(u=own.u, fell=own.fell, weight=np.ones(len(own.u)), method="crude")


def estimate(sample: Sample) -> Probability:
    """The probability of a fall."""
    known = ~np.isnan(sample.fell)
    fell, k = sample.fell[known], int(known.sum())
    falls, unknown = int(fell.sum()), len(known) - k
    if sample.method == "crude":
        low, high = wilson(falls, k)
        return Probability(
            value=falls / max(k, 1), low=low, high=high, method="crude", draws=k, falls=falls, unknown=unknown
        )
    y = sample.draws(sample.fell * sample.weight)
    mean = float(y.mean()) if len(y) else 0.0
    low, high = interval(y)
    return Probability(value=mean, low=low, high=high, method=sample.method, draws=k, falls=falls, unknown=unknown)


def interval(y: Array) -> tuple[float, float]:
    """95 % interval of a mean of values of 0 and above, by Student's t on its logarithm; (0, 1) of nothing.

    It is made for `MADE` and covers 97 to 98 % where the answer is known (docs/reliability.md).
    """
    from scipy.stats import t

    k = len(y)
    mean = float(y.mean()) if k else 0.0
    if mean <= 0.0 or k < 3:
        return 0.0, min(1.0, 3.0 / k) if k else 1.0
    alike = float(y.sum()) ** 2 / float((y**2).sum())  # falls of the same weight that would say as much
    width = float(t.isf(0.5 * (1.0 - MADE), max(alike - 1.0, 1.0))) * float(y.std(ddof=1)) / math.sqrt(k) / mean
    return mean * math.exp(-width), min(1.0, mean * math.exp(width))


def wilson(count: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % score interval for a proportion; (0, 1), of which nothing is known, without trials.

    Args:
        count: Number of those meant, survivors or falls.
        trials: Number of trials.
    """
    from scipy.stats import binomtest

    if not trials:
        return 0.0, 1.0
    found = binomtest(count, trials).proportion_ci(LEVEL, method="wilson")
    return float(found.low), float(found.high)
