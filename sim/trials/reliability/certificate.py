"""A certificate: "a walk falls with a probability below p, at 95 % confidence", said or refused as walks come in.

One may look after every walk and stop when one likes: the test multiplies likelihood ratios against the probability
asked about. As long as the truth lies on the other side, such a product is a non-negative supermartingale that starts
at 1, so it ever reaches 1 / alpha with a probability of alpha at most (Ville's inequality; Ramdas, Gruenwald, Vovk,
Shafer, Game-theoretic statistics and safe anytime-valid inference, Statistical Science 2023). Products for several
alternatives are averaged, which is such a product again.
"""

import math
from dataclasses import dataclass
from enum import Enum

BELOW = (0.0, 0.1, 0.3, 0.6)
"""Alternatives to the asked probability for saying it is lower, in parts of it."""

BELOW_SHARES = (0.7, 0.1, 0.1, 0.1)
"""What is staked on each; mostly on no fall at all, which is what a certificate is asked for."""

ABOVE = (1.5, 3.0, 10.0, 100.0)
"""Alternatives for saying it is higher, in multiples; evenly staked."""


class Verdict(Enum):
    """What can be said; the value is what users read."""

    CERTIFIED = "certified"
    REFUSED = "refused"
    OPEN = "cannot be said yet"


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """A sequential test of a probability of a fall.

    Attributes:
        probability: Asked about.
        confidence: At which either answer is given: a wrong one has a probability of 1 minus this at most.
    """

    probability: float
    confidence: float

    def verdict(self, falls: int, walks: int) -> Verdict:
        """What can be said after some falls and some walks that did not fall, in whatever order they came."""
        limit = -math.log1p(-self.confidence)
        if _stake(falls, walks, self.probability, BELOW, BELOW_SHARES) >= limit:
            return Verdict.CERTIFIED
        shares = (1.0 / len(ABOVE),) * len(ABOVE)
        above = tuple(min(times, (1.0 - 1e-9) / self.probability) for times in ABOVE)
        return Verdict.REFUSED if _stake(falls, walks, self.probability, above, shares) >= limit else Verdict.OPEN

    @property
    def least(self) -> int:
        """Walks without a fall after which it is certified: the fewest it can take."""
        low, high = 1, 2
        while self.verdict(0, high) is not Verdict.CERTIFIED:
            low, high = high, 2 * high
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if self.verdict(0, middle) is Verdict.CERTIFIED else (middle, high)
        return high


def _stake(falls: int, walks: int, p: float, times: tuple[float, ...], shares: tuple[float, ...]) -> float:
    """Logarithm of the averaged likelihood ratios of the alternatives `times` * p against p."""
    logs = []
    for factor, share in zip(times, shares, strict=True):
        if falls and factor == 0.0:
            continue
        for_falls = falls * math.log(factor) if falls else 0.0
        logs.append(math.log(share) + for_falls + walks * (math.log1p(-factor * p) - math.log1p(-p)))
    largest = max(logs)
    return largest + math.log(sum(math.exp(one - largest) for one in logs))
