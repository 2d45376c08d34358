"""The probability of a fall by subset simulation: a product of moderate probabilities, each of a level within the last.

Levels are those of a continuous measure, a walk's least margin; a walk that falls is in all of them, so that falls
alone are what is counted, and the measure only decides how soon they are met (Au, Beck, Estimation of small failure
probabilities in high dimensions by subset simulation, Probabilistic Engineering Mechanics 2001). A pilot chooses the
levels; then several independent copies climb them, which makes each copy's product unbiased (fixed levels; Cerou, Del
Moral, Furon, Guyader, Sequential Monte Carlo for rare event estimation, Statistics and Computing 2012) and gives an
interval by their spread alone, since walks of one copy descend from each other. Within a level chains move by
u' = sqrt(1 - s^2) u + s z, with noise drawn anew, which keeps the plan's density (Papaioannou, Betz, Zwirglmaier,
Straub, MCMC algorithms for subset simulation, Probabilistic Engineering Mechanics 2015).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.trials.reliability.asking import Array, Batch, Search, ask
from sim.trials.reliability.draws import FURTHEST
from sim.trials.reliability.probability import Sample

PILOT = 100  # walks of each level of the pilot
EACH = 100  # walks of each level of a copy
LENGTH = 5  # steps of a chain
SHARE = 0.2  # of walks that are to lie within the next level
ALIKE = 0.6  # share within a level from which on no further one is made: the measure says nothing there
LEVELS = 12  # at most
STEP, ACCEPTED = 0.7, 0.44  # first step of a chain, and the share of accepted steps to aim at
FEWEST = 6  # copies, if the walks allowed are enough
WORSE = 3.0  # times the variance that independent walks would have, a level, by which the number of copies is planned


@dataclass(slots=True, kw_only=True, eq=False)
class _Walks:
    """Walks of a level: points (c, k, n), how they ended and their margins, (c, k); c copies."""

    u: Array
    fell: Array
    margin: Array

    def within(self, level: float) -> NDArray[np.bool_]:
        """Those that lie within a level; a walk without a result, or without a margin, does not, (c, k)."""
        found: NDArray[np.bool_] = (np.nan_to_num(self.fell) > 0.5) | (np.nan_to_num(self.margin, nan=np.inf) <= level)
        return found

    def __getitem__(self, which: tuple[NDArray[np.int64], NDArray[np.int64]]) -> "_Walks":
        return _Walks(u=self.u[which], fell=self.fell[which], margin=self.margin[which])


class _Noise:
    """Numbers of realisations of the noise, each once."""

    def __init__(self) -> None:
        self.next = 1_000_001

    def ask(self, u: Array) -> Batch:
        """A guided batch of points, (..., n), each under a realisation of its own."""
        points = np.clip(u.reshape(-1, u.shape[-1]), -FURTHEST, FURTHEST)
        self.next += len(points)
        return ask(points, np.arange(self.next - len(points), self.next), guided=True)


def subset(n: int, rng: np.random.Generator, *, variation: float, most: int) -> Search[Sample]:
    """Climb the levels of a pilot with as many copies as it says are needed.

    Args:
        n: Number of axes.
        rng: Draws everything.
        variation: Coefficient of variation asked for.
        most: Walks at most, the pilot's aside; two copies climb in any case.
    """
    noise = _Noise()
    levels, steps, parts = yield from _pilot(n, rng, noise)
    variance = sum((1.0 - p) / max(p, 1.0 / PILOT) / EACH * (WORSE if k else 1.0) for k, p in enumerate(parts))
    copies = max(FEWEST, math.ceil(variance / variation**2))
    copies = max(2, min(copies, most // (EACH * (len(levels) + 1))))
    walks = yield from _walks(rng.normal(size=(copies, EACH, n)), noise)
    share = np.ones(copies)
    alive = np.arange(copies)
    for level, step in zip(levels, steps, strict=True):
        within = walks.within(level)
        share[alive] *= within.mean(axis=1)
        some = within.any(axis=1)
        share[alive[~some]] = 0.0
        alive = alive[some]
        if not len(alive):
            break
        walks, _ = yield from _climb(_Walks(u=walks.u[some], fell=walks.fell[some], margin=walks.margin[some]),
                                     level, step, rng, noise)  # fmt: skip
    # A copy that met no walk within a level is a draw of nothing: one of its walks stands for it, with no weight.
    group = np.concatenate((np.repeat(alive, EACH), np.setdiff1d(np.arange(copies), alive)))
    rest = copies - len(alive)
    return Sample(
        u=np.concatenate((walks.u[: len(alive)].reshape(-1, n), np.zeros((rest, n)))),
        fell=np.concatenate((np.nan_to_num(walks.fell[: len(alive)]).ravel(), np.zeros(rest))),
        weight=np.concatenate((np.repeat(share[alive] / EACH, EACH), np.zeros(rest))),
        method="subset",
        group=group,
    )


def _pilot(n: int, rng: np.random.Generator, noise: _Noise) -> Search[tuple[list[float], list[float], list[float]]]:
    """Levels, the step of a chain within each, and the share of walks within each and of falls in the last."""
    walks = yield from _walks(rng.normal(size=(1, PILOT, n)), noise)
    levels: list[float] = []
    steps: list[float] = []
    parts: list[float] = []
    step = STEP
    while len(levels) < LEVELS:
        fell = np.nan_to_num(walks.fell) > 0.5
        margin = np.where(fell, -np.inf, np.nan_to_num(walks.margin, nan=np.inf))
        level = float(np.quantile(margin, SHARE, method="lower"))
        share = float(walks.within(level).mean())
        if fell.mean() >= SHARE or not math.isfinite(level) or share > ALIKE:
            break
        levels.append(level)
        steps.append(step)
        parts.append(share)
        walks, accepted = yield from _climb(walks, level, step, rng, noise)
        step = float(np.clip(step * math.exp(accepted - ACCEPTED), 0.1, 1.0))
    parts.append(float((np.nan_to_num(walks.fell) > 0.5).mean()))
    return levels, steps, parts


def _walks(u: Array, noise: _Noise) -> Search[_Walks]:
    """Try points, (c, k, n)."""
    batch = noise.ask(u)
    answers = yield batch
    shape = u.shape[:-1]
    return _Walks(u=batch.u.reshape(u.shape), fell=answers[:, 0].reshape(shape), margin=answers[:, 1].reshape(shape))


def _climb(
    walks: _Walks, level: float, step: float, rng: np.random.Generator, noise: _Noise
) -> Search[tuple[_Walks, float]]:
    """As many walks within a level, by chains from those there are, and the share of steps that were accepted."""
    copies, k, n = walks.u.shape
    within = walks.within(level)
    chains = k // LENGTH
    picked = np.array([np.resize(rng.permutation(np.flatnonzero(row)), chains) for row in within])
    at = walks[np.arange(copies)[:, None], picked]
    kept: list[_Walks] = []
    accepted = 0.0
    for _ in range(LENGTH):
        u = math.sqrt(1.0 - step**2) * at.u + step * rng.normal(size=(copies, chains, n))
        new = yield from _walks(u, noise)
        ok = new.within(level)
        accepted += float(ok.mean()) / LENGTH
        at = _Walks(
            u=np.where(ok[:, :, None], new.u, at.u),
            fell=np.where(ok, new.fell, at.fell),
            margin=np.where(ok, new.margin, at.margin),
        )
        kept.append(at)
    joined = (np.concatenate([getattr(one, name) for one in kept], axis=1) for name in ("u", "fell", "margin"))
    u, fell, margin = joined
    return _Walks(u=u, fell=fell, margin=margin), accepted
