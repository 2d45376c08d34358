"""Which errors matter: importance at the nearest fall, what halving a spread changes, Sobol' indices of the fall."""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim.errors import UserError
from sim.trials.reliability.asking import Array
from sim.trials.reliability.nearest import Mode
from sim.trials.reliability.probability import Probability, Sample, estimate

FEWEST = 10  # falls, and walks, from which a model of the fall is fitted
FOLDS = 5
BASE = 512  # base points of Saltelli's design; n + 2 evaluations of the model each


def importance(mode: Mode) -> Array:
    """Importance factor of each axis: its part of the squared distance, (n,), 1 in all (FORM's alpha squared)."""
    factors: Array = mode.direction**2
    return factors


def halved(sample: Sample, axis: int) -> Probability:
    """The probability of a fall if the spread of one axis were half of what it is.

    The same walks are weighted by the ratio of the two densities, 2 exp(-1.5 u^2), which no walk exceeds by more than
    twofold: no new walk is needed, and nothing is biased. Of a bounded axis the values move half way to the median, in
    standard normal space.

    Args:
        sample: Draws under the plan's spreads.
        axis: Number of the axis.
    """
    return estimate(sample, times=2.0 * np.exp(-1.5 * sample.u[:, axis] ** 2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sobol:
    """Sobol' indices of the fall, of a model fitted to the walks.

    Attributes:
        first: Part of the variance of fall or walk that each axis explains alone, (n,).
        total: Part that would go if it alone were known, with all it does together with others, (n,).
        accuracy: Share of walks that the model foretells when it has not seen them (5-fold cross-validation).
        guess: The same for the more frequent answer every time.
    """

    first: Array
    total: Array
    accuracy: float
    guess: float


def sobol(u: Array, fell: Array) -> Sobol | None:
    """Sobol' indices of a logistic model with each axis and its square; None with too few falls or walks.

    Args:
        u: Walks in standard normal space, (k, n).
        fell: 1.0 or 0.0, (k,).

    Raises:
        UserError: SALib is not installed.
    """
    if min(fell.sum(), len(fell) - fell.sum()) < FEWEST:
        return None
    try:
        from SALib.analyze import sobol as analysis
        from SALib.sample import sobol as design
    except ImportError as error:
        raise UserError("Sobol' indices need SALib; install cmpc-walker[reliability]") from error
    right = 0.0
    for fold in range(FOLDS):
        out = np.arange(len(u)) % FOLDS == fold
        right += float(((_fitted(u[~out], fell[~out])(u[out]) > 0.5) == (fell[out] > 0.5)).sum())
    n = u.shape[1]
    if n < 2:
        one = np.ones(1)
        return Sobol(first=one, total=one, accuracy=right / len(u), guess=_guess(fell))
    names = [str(k) for k in range(n)]
    problem = {"num_vars": n, "names": names, "bounds": [[0.0, 1.0]] * n, "dists": ["norm"] * n}
    points = design.sample(problem, BASE, calc_second_order=False, seed=0)
    model = _fitted(u, fell)(points)
    if np.ptp(model) < 1e-9:
        return None
    found = analysis.analyze(problem, model, calc_second_order=False, num_resamples=2, seed=0)
    return Sobol(
        first=np.clip(found["S1"], 0.0, 1.0), total=np.clip(found["ST"], 0.0, None),
        accuracy=right / len(u), guess=_guess(fell),
    )  # fmt: skip


def _guess(fell: Array) -> float:
    share = float(fell.mean())
    return max(share, 1.0 - share)


def _features(u: Array) -> Array:
    return np.column_stack((np.ones(len(u)), u, u**2 - 1.0))


def _fitted(u: Array, fell: Array) -> Callable[[Array], Array]:
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
