"""Which errors matter: importance at the nearest fall, what halving a spread changes, Sobol' indices."""

import functools
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim.errors import UserError
from sim.trials.reliability.asking import Array
from sim.trials.reliability.differences import Difference
from sim.trials.reliability.nearest import Mode
from sim.trials.reliability.probability import LEVEL, Sample

FEWEST = 10  # falls, and walks, from which a model of the fall is fitted
FOLDS = 5
TOGETHER = 4  # axes whose products a model of the margin has
BASE = 512  # base points of Saltelli's design; n + 2 evaluations of the model each


def importance(mode: Mode) -> Array:
    """Importance factor of each axis: its part of the squared distance, (n,), 1 in all (FORM's alpha squared)."""
    factors: Array = mode.direction**2
    return factors


def halving(sample: Sample, axis: int) -> Difference:
    """What halving the spread of one axis changes of the probability, with its 95 % interval.

    The same walks are weighted by the ratio of the two densities, 2 exp(-1.5 u^2), which no walk exceeds by more than
    twofold: no new walk is needed, and nothing is biased. Of a bounded axis the values move half way to the median, in
    standard normal space.

    The ratio of the densities less 1 has a mean of 0, so what all plain draws have in common, the share of falls, can
    be taken from each: the mean stays, and the interval is a tenth to a sixth narrower where a third falls.

    Args:
        sample: Draws under the plan's spreads.
        axis: Number of the axis.
    """
    from scipy.stats import t

    known = sample.draws(sample.fell)
    k = len(known)
    if k < 2:
        return 0.0, -1.0, 1.0
    common = float(known.mean()) if sample.method == "crude" else 0.0
    y = sample.draws((sample.fell - common) * sample.weight * (_narrower(sample, axis) - 1.0))
    value, width = float(y.mean()), float(t.isf(0.5 * (1.0 - LEVEL), k - 1) * y.std(ddof=1) / math.sqrt(k))
    return value, value - width, value + width


def _narrower(sample: Sample, axis: int) -> Array:
    """Ratio of the density with half the spread of an axis to the plan's, (k,)."""
    found: Array = 2.0 * np.exp(-1.5 * sample.u[:, axis] ** 2)
    return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sobol:
    """Sobol' indices of a model fitted to the walks.

    Attributes:
        first: Part of the variance that each axis explains alone, (n,).
        total: Part that would stay if all others were known, with all it does together with them, (n,).
        accuracy: Share of walks whose fall the model foretells when it has not seen them, or the part of a margin's
            variance that it does (5-fold cross-validation).
        guess: The same for the more frequent answer, or the mean, every time.
    """

    first: Array
    total: Array
    accuracy: float
    guess: float


def sobol(u: Array, fell: Array) -> Sobol | None:
    """Sobol' indices of the fall, by a logistic model with each axis and its square; None with too few falls or walks.

    Args:
        u: Walks in standard normal space, (k, n).
        fell: 1.0 or 0.0, (k,).

    Raises:
        UserError: SALib is not installed.
    """
    if min(fell.sum(), len(fell) - fell.sum()) < FEWEST:
        return None
    unseen = _unseen(u, fell, _fitted)
    right = float(((unseen > 0.5) == (fell > 0.5)).mean())
    share = float(fell.mean())
    return _indices(_fitted(u, fell), u.shape[1], right, max(share, 1.0 - share))


def sobol_of_margin(u: Array, margin: Array) -> Sobol | None:
    """Sobol' indices of a walk's least margin, by a quadratic model; None with too few walks, or if it never varies.

    Each axis and its square, and products of the strongest axes.

    Args:
        u: Walks in standard normal space, (k, n).
        margin: Of each, (k,).

    Raises:
        UserError: SALib is not installed.
    """
    if len(u) < 2 * FEWEST or np.ptp(margin) < 1e-9:
        return None
    missed = float(((margin - _unseen(u, margin, _surface)) ** 2).sum() / ((margin - margin.mean()) ** 2).sum())
    return _indices(_surface(u, margin), u.shape[1], max(0.0, 1.0 - missed), 0.0)


Model = Callable[[Array], Array]


def _unseen(u: Array, y: Array, fit: Callable[[Array, Array], Model]) -> Array:
    """What models say of walks that they were not fitted to, (k,)."""
    found = np.zeros(len(u))
    for fold in range(FOLDS):
        out = np.arange(len(u)) % FOLDS == fold
        found[out] = fit(u[~out], y[~out])(u[out])
    return found


def _indices(model: Model, n: int, accuracy: float, guess: float) -> Sobol | None:
    """Sobol' indices of a model of n standard normal axes, by SALib with Saltelli's design; None if it never varies."""
    try:
        from SALib.analyze import sobol as analysis
        from SALib.sample import sobol as design
    except ImportError as error:
        raise UserError("Sobol' indices need SALib; install cmpc-walker[reliability]") from error
    if n < 2:
        return Sobol(first=np.ones(1), total=np.ones(1), accuracy=accuracy, guess=guess)
    names = [str(k) for k in range(n)]
    problem = {"num_vars": n, "names": names, "bounds": [[0.0, 1.0]] * n, "dists": ["norm"] * n}
    y = model(design.sample(problem, BASE, calc_second_order=False, seed=0))
    if np.ptp(y) < 1e-9:
        return None
    found = analysis.analyze(problem, y, calc_second_order=False, num_resamples=2, seed=0)
    first, total = np.clip(found["S1"], 0.0, 1.0), np.clip(found["ST"], 0.0, None)
    return Sobol(first=first, total=total, accuracy=accuracy, guess=guess)


def _surface(u: Array, margin: Array) -> Model:
    """A margin by least squares with a ridge: each axis, its square, and products of the `TOGETHER` strongest axes."""
    mean = float(margin.mean())
    slopes = np.abs(u.T @ (margin - mean))
    pairs = list(itertools.combinations(np.sort(np.argsort(-slopes)[:TOGETHER]), 2))

    def features(u: Array) -> Array:
        return np.column_stack((_features(u), *(u[:, i] * u[:, j] for i, j in pairs)))

    x = features(u)
    ridge = np.eye(x.shape[1])
    ridge[0, 0] = 1e-9
    weights = np.linalg.solve(x.T @ x + ridge, x.T @ (margin - mean))

    def surface(u: Array) -> Array:
        found: Array = mean + features(u) @ weights
        return found

    return surface


def _features(u: Array) -> Array:
    return np.column_stack((np.ones(len(u)), u, u**2 - 1.0))


def _fitted(u: Array, fell: Array) -> Model:
    """Probability of a fall by a logistic regression with a ridge, as a function of points."""
    x = _features(u)
    ridge = np.eye(x.shape[1])
    ridge[0, 0] = 1e-3
    beta = np.zeros(x.shape[1])
    for _ in range(30):
        p = 1.0 / (1.0 + np.exp(-np.clip(x @ beta, -30.0, 30.0)))
        change = np.linalg.solve((x.T * (p * (1.0 - p))) @ x + ridge, x.T @ (fell - p) - ridge @ beta)
        beta += np.clip(change, -3.0, 3.0)
        if np.abs(change).max() < 1e-8:
            break
    return functools.partial(_probability, beta)


def _probability(beta: Array, u: Array) -> Array:
    found: Array = 1.0 / (1.0 + np.exp(-np.clip(_features(u) @ beta, -30.0, 30.0)))
    return found
