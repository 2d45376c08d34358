"""The probability of a fall by directions: along each, how much of the chi distribution of the distance falls.

Directional sampling (Ditlevsen, Melchers, Gluver, Plane Gaussian outcrossings and directional simulation; Melchers,
Beck, Structural Reliability Analysis and Prediction, chapter 3) usually looks for the root of a limit state along each
direction. Yes and no have none, and survival has islands, so the distance is sampled too: once in each of a few layers,
at a random place in it, which is unbiased whatever falls along a direction. Directions are drawn around those of the
nearest falls, mixed with even ones, and weighted by the ratio of the densities.
"""

import math
from collections.abc import Sequence

import numpy as np

from sim.trials.reliability.asking import Array, Search, ask
from sim.trials.reliability.draws import FURTHEST
from sim.trials.reliability.nearest import WITHIN, Mode
from sim.trials.reliability.probability import MARGIN, Sample, shares

PILOT = 25  # directions from which their number follows; they count for nothing else
LAYERS, THINNER = 6, 3.0  # beyond the nearest fall, and how much less probable each begins than the one before
GRID = 400  # distances of the quadrature of a direction's density
NO_FALL = 2.0  # distance from which layers begin where no fall is known


def directional(
    n: int, modes: Sequence[Mode], rng: np.random.Generator, *, variation: float, most: int
) -> Search[Sample]:
    """Draw directions: a pilot, and then once as many as it says are needed.

    Args:
        n: Number of axes.
        modes: The nearest falls.
        rng: Draws directions and distances.
        variation: Coefficient of variation asked for.
        most: Walks at most, the pilot's aside.
    """
    edges = _edges(n, modes[0].beta if modes else NO_FALL)
    each, noise = len(edges) - 1, 1_000_001
    count = max(2, min(PILOT, most // each))
    for is_pilot in (True, False):
        ways = _ways(n, modes, rng, count)
        u = np.clip(ways[:, None] * _distances(n, edges, rng, count)[:, :, None], -FURTHEST, FURTHEST)
        batch = ask(u.reshape(-1, n), np.arange(noise, noise + count * each))
        fell = yield batch
        weight = _ratio(ways, modes)[:, None] * -np.diff(edges)
        group = np.repeat(np.arange(count), each)
        sample = Sample(u=batch.u, fell=fell, weight=weight.ravel(), method="directional", group=group)
        noise += len(batch)
        if is_pilot:
            y = sample.draws(sample.fell * sample.weight)
            mean = float(y.mean()) if len(y) else 0.0
            needed = MARGIN * (float(y.std()) / (variation * mean)) ** 2 if mean > 0.0 else math.inf
            count = int(min(max(2, most // each), max(PILOT, needed)))
    return sample


def _edges(n: int, beta: float) -> Array:
    """Probabilities of being further out at which layers begin, from 1 to 0, (LAYERS + 2,)."""
    from scipy.stats import chi

    first = float(chi.sf(WITHIN * beta, n))
    return np.concatenate(([1.0], first / THINNER ** np.arange(LAYERS), [0.0]))


def _distances(n: int, edges: Array, rng: np.random.Generator, count: int) -> Array:
    """One distance in each layer of each direction, (count, layers)."""
    from scipy.stats import chi

    further = edges[1:] + rng.uniform(size=(count, len(edges) - 1)) * -np.diff(edges)
    found: Array = chi.isf(further, n)
    return found


def _ways(n: int, modes: Sequence[Mode], rng: np.random.Generator, count: int) -> Array:
    """Unit directions of the mixture, (count, n)."""
    share = shares(modes)
    centres = np.vstack([np.zeros((1, n)), *(mode.outside for mode in modes)])
    u = centres[rng.choice(len(share), size=count, p=share)] + rng.normal(size=(count, n))
    found: Array = u / np.maximum(np.linalg.norm(u, axis=1), 1e-12)[:, None]
    return found


def _ratio(ways: Array, modes: Sequence[Mode]) -> Array:
    """Density of even directions over the mixture's, (count,).

    The direction of a normal vector around m has, over even ones, the density exp(-|m|^2 / 2) E[exp(r m.d)], r by the
    chi distribution of n degrees (projected normal distribution; Mardia, Jupp, Directional Statistics, section 9.3).
    """
    n = ways.shape[1]
    r = np.linspace(0.0, math.sqrt(n) + 10.0 + max((mode.beta for mode in modes), default=0.0), GRID)[1:]
    log_chi = (n - 1) * np.log(r) - 0.5 * r**2 - (0.5 * n - 1.0) * math.log(2.0) - math.lgamma(0.5 * n)
    parts = [np.ones(len(ways))]
    for mode in modes:
        exponent = log_chi + np.outer(ways @ mode.outside, r) - 0.5 * mode.beta**2
        parts.append(np.exp(exponent).sum(axis=1) * (r[1] - r[0]))
    found: Array = 1.0 / (shares(modes) @ np.array(parts))
    return found
