"""The full proof of the searches on limit states with known answers: `make reliability-proof` prints the tables.

Every row is a limit state that answers yes and no alone, searched from 100 seeds as a study does it: 200 draws, 40 of
them at four more scales, the nearest falls, and the probability by each method to a coefficient of variation of 0.2.
Subset simulation is told a margin too, which is off by a wave and blind to curvature and to what lies beyond islands.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from limit_states import LimitState, all_limit_states, linear, parabolic

from sim.trials.plan import ReliabilityStudy
from sim.trials.plan.montecarlo import RandomAxis
from sim.trials.reliability.asking import answer
from sim.trials.reliability.certificate import Certificate, Verdict
from sim.trials.reliability.differences import beta_difference, probability_difference
from sim.trials.reliability.procedure import Found, course

SCALES = (0.5, 0.7, 1.4, 2.0)
VARIATION = 0.2
MOST = {"importance": 1500, "directional": 3000, "subset": 8000, "crude": 8000}
"""Walks for a probability at most, by method."""


def study(n: int, method: str = "importance", draws: int = 200, look: int = 60) -> ReliabilityStudy:
    """A study of n standard normal axes."""
    axes = tuple(
        RandomAxis(name=str(k), paths=("pushes.0.force",), distribution="normal", centre=0.0, spread=1.0)
        for k in range(n)
    )
    return ReliabilityStudy(
        draws=draws, rays=40, scales=SCALES, modes=4, search=10**6, look=look, variation=VARIATION,
        most=MOST[method], probability=method, axes=axes,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Searched:
    """A study of a limit state from one seed.

    Attributes:
        found: What it found.
        calls: Walks in all.
        more: Walks for the probability among them.
    """

    found: Found
    calls: int
    more: int

    def covers(self, truth: float) -> bool:
        """Whether the interval of the probability holds a value."""
        return self.found.probability.low <= truth <= self.found.probability.high


def searched(state: LimitState, seed: int, method: str = "importance") -> Searched:
    """Study a limit state."""
    found, calls = answer(course(study(state.n, method), seed), state.falls, state.margin)
    assert isinstance(found, Found)
    before = len(found.draws.u) + found.nearest.tried
    return Searched(found=found, calls=calls, more=calls - before)


def certificates(truth: float, seeds: int) -> dict[Verdict, int]:
    """How often a certificate of 1e-2 at 95 % ends how for a true probability, within 20,000 walks."""
    ends = dict.fromkeys(Verdict, 0)
    test = Certificate(probability=1e-2, confidence=0.95)
    for seed in range(seeds):
        falls = np.cumsum(np.random.default_rng(seed).random(20_000) < truth)
        looks = range(49, 20_000, 50)
        ends[next((v for k in looks if (v := test.verdict(int(falls[k]), k + 1 - int(falls[k]))) is not Verdict.OPEN),
                  Verdict.OPEN)] += 1  # fmt: skip
    return ends


P_HEAD = ("mean / P", "cv", "covered", "calls")
HEAD = ("limit state", "beta", "within 2 %", "worst", "calls", "most", "P", *P_HEAD, "crude")


def line(state: LimitState, seeds: range) -> tuple[str, ...]:
    """One row of the table of distances and importance sampling."""
    rows = [searched(state, seed) for seed in seeds]
    error = np.abs(np.array([row.found.beta for row in rows]) / state.beta - 1.0)
    calls = np.array([row.calls - row.more for row in rows])
    return (
        state.name,
        f"{state.beta:.2f}",
        f"{np.sum(error < 0.02)}/{len(rows)}",
        f"{error.max():.1%}",
        f"{calls.mean():.0f}",
        f"{calls.max()}",
        *probability_cells(state, rows),
        f"{(1.0 / state.probability - 1.0) / VARIATION**2:.0f}",
    )


def probability_cells(state: LimitState, rows: list[Searched]) -> tuple[str, ...]:
    """Truth, bias, coefficient of variation, coverage and calls of a probability."""
    truth = state.probability
    p = np.array([row.found.probability.value for row in rows])
    return (
        f"{truth:.2e}",
        f"{p.mean() / truth:.2f}",
        f"{p.std() / truth:.2f}",
        f"{sum(row.covers(truth) for row in rows)}/{len(rows)}",
        f"{np.mean([row.more for row in rows]):.0f}",
    )


OTHERS = ("directional", "subset", "crude")
OTHERS_HEAD = ("limit state", "P", *(word for name in OTHERS for word in (name, "cv", "covered", "calls")))


def others(state: LimitState, seeds: range) -> tuple[str, ...]:
    """One row of the table of the other methods."""
    cells = [probability_cells(state, [searched(state, seed, name) for seed in seeds]) for name in OTHERS]
    return (state.name, cells[0][0], *(cell for each in cells for cell in each[1:]))


PAIRS = (
    (linear(5), linear(5, 3.3)),
    (linear(5), linear(5)),
    (linear(5), parabolic(5)),
    (linear(20), parabolic(20, curvature=0.02)),
    (linear(5, 1.0), linear(5, 0.8)),
    (linear(5, 1.0), linear(5, 2.0)),
)
PAIRS_HEAD = ("one", "other", "beta", "covered", "width", "P", "covered", "width")


def pair(one: LimitState, other: LimitState, seeds: range) -> tuple[str, ...]:
    """One row of the table of differences: both studied from the same seeds, so on the same draws."""
    betas, ps = [], []
    for seed in seeds:
        a, b = (searched(state, seed).found for state in (one, other))
        betas.append(beta_difference(a.nearest, b.nearest))
        ps.append(probability_difference((a.probability, a.sample), (b.probability, b.sample)))
    cells: list[str] = []
    truths = (other.beta - one.beta, other.probability - one.probability)
    for truth, found in zip(truths, (betas, ps), strict=True):
        covered = sum(low <= truth <= high for _, low, high in found)
        width = float(np.mean([high - low for _, low, high in found]))
        cells += [f"{truth:.3g}", f"{covered}/{len(found)}", f"{width:.2g}"]
    return (f"{one.name} at {one.beta:g}", f"{other.name} at {other.beta:g}", *cells)


def show(title: str, head: tuple[str, ...], rows: Sequence[Callable[[], tuple[str, ...]]]) -> None:
    """Print a table, each row as soon as it is there."""
    print(f"\n{title}")
    for row in (lambda: head, *rows):
        print("".join(f"{cell:<22}" if not place else f"{cell:>12}" for place, cell in enumerate(row())), flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="searches on limit states with known answers")
    parser.add_argument("seeds", nargs="?", type=int, default=100, help="of each row (default: 100)")
    parser.add_argument("--first", type=int, default=0, help="the first seed (default: 0)")
    parser.add_argument("--only", choices=("nearest", "methods", "differences", "certificates"), help="one table")
    found = parser.parse_args()
    seeds, states = range(found.first, found.first + found.seeds), all_limit_states()
    if found.only in (None, "nearest"):
        rows = [lambda state=state: line(state, seeds) for state in states]
        show("nearest fall, and probability by importance sampling", HEAD, rows)
    if found.only in (None, "methods"):
        rows = [lambda state=state: others(state, seeds) for state in states]
        show("probability by other methods: mean / P", OTHERS_HEAD, rows)
    if found.only in (None, "differences"):
        rows = [lambda one=one, other=other: pair(one, other, seeds) for one, other in PAIRS]
        show("differences on the same draws", PAIRS_HEAD, rows)
    for truth in (1e-3, 5e-3, 1e-2, 2e-2, 5e-2) if found.only in (None, "certificates") else ():
        ends = ", ".join(f"{verdict.value} {count}" for verdict, count in certificates(truth, found.seeds).items())
        print(f"certificate of 1e-2 at 95 %, truth {truth:g}: {ends}")


if __name__ == "__main__":
    main()
