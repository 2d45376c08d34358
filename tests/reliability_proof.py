"""The full proof of the searches on limit states with known answers: `make reliability-proof` prints the table.

Every row is a limit state that answers yes and no alone, searched from 100 seeds as a study does it: 200 draws, 40 of
them at four more scales, the nearest falls, importance sampling to a coefficient of variation of 0.2.
"""

import sys

import numpy as np

from sim.trials.reliability.asking import answer
from sim.trials.reliability.certificate import Certificate, Verdict
from sim.trials.reliability.draws import draw
from sim.trials.reliability.limit_states import LimitState, all_limit_states
from sim.trials.reliability.nearest import nearest
from sim.trials.reliability.probability import estimate, importance

SCALES = (0.5, 0.7, 1.4, 2.0)
VARIATION = 0.2


def searched(state: LimitState, seed: int) -> tuple[float, int, float, bool, int]:
    """Beta, calls for it, probability, whether its interval covers the truth, and calls for it."""
    first, second, third = np.random.SeedSequence(seed).spawn(3)
    draws, drawn = answer(draw(state.n, first, 200, 40, SCALES), state.falls)
    found, calls = answer(nearest(draws.u, draws.fell, np.random.default_rng(second)), state.falls)
    beta = found.modes[0].beta if found.modes else np.inf
    rng = np.random.default_rng(third)
    sample, more = answer(importance(state.n, found.modes, rng, variation=VARIATION, most=1500), state.falls)
    p = estimate(sample)
    return beta, drawn + calls, p.value, p.low <= state.probability <= p.high, more


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


HEAD = (
    "limit state",
    "beta",
    "within 2 %",
    "worst",
    "calls",
    "most",
    "P",
    "mean / P",
    "cv",
    "covered",
    "calls",
    "crude",
)


def line(state: LimitState, seeds: int) -> tuple[str, ...]:
    """One row of the table."""
    rows = [searched(state, seed) for seed in range(seeds)]
    beta, calls, p, covers, more = (np.array(column) for column in zip(*rows, strict=True))
    error, truth = np.abs(beta / state.beta - 1.0), state.probability
    return (
        state.name,
        f"{state.beta:.2f}",
        f"{np.mean(error < 0.02):.0%}",
        f"{error.max():.1%}",
        f"{calls.mean():.0f}",
        f"{calls.max()}",
        f"{truth:.2e}",
        f"{p.mean() / truth:.2f}",
        f"{p.std() / truth:.2f}",
        f"{covers.sum()}/{seeds}",
        f"{more.mean():.0f}",
        f"{(1.0 / truth - 1.0) / VARIATION**2:.0f}",
    )


def main(seeds: int) -> None:
    """Print the table."""
    for row in (HEAD, *(line(state, seeds) for state in all_limit_states())):
        print("".join(f"{cell:<18}" if not place else f"{cell:>11}" for place, cell in enumerate(row)), flush=True)
    for truth in (1e-3, 5e-3, 1e-2, 2e-2, 5e-2):
        ends = ", ".join(f"{verdict.value} {count}" for verdict, count in certificates(truth, seeds).items())
        print(f"certificate of 1e-2 at 95 %, truth {truth:g}: {ends}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
