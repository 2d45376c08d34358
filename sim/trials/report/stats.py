"""Statistics of survival: intervals, paired tests, and which axes explain the falls."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Paired:
    """Two controllers on the same draws.

    Attributes:
        both: Trials both survive.
        first: Trials the first alone survives.
        second: Trials the second alone survives.
        neither: Trials neither survives.
        p: Two-sided p-value of McNemar's exact test of "they survive alike".
    """

    both: int
    first: int
    second: int
    neither: int
    p: float


def mcnemar(pairs: Sequence[tuple[bool, bool]]) -> Paired:
    """Compare paired survivals by McNemar's exact test: of the trials they differ on, half should go each way."""
    from scipy.stats import binomtest

    first = sum(a and not b for a, b in pairs)
    second = sum(b and not a for a, b in pairs)
    both = sum(a and b for a, b in pairs)
    differ = first + second
    p = float(binomtest(first, differ).pvalue) if differ else 1.0
    return Paired(both=both, first=first, second=second, neither=len(pairs) - both - differ, p=p)


def holm(p: Sequence[float]) -> list[float]:
    """p-values of several tests, adjusted by Holm's step-down method: each holds for the whole family of tests."""
    found, largest = [0.0] * len(p), 0.0
    for rank, i in enumerate(sorted(range(len(p)), key=lambda i: p[i])):
        largest = max(largest, min(1.0, (len(p) - rank) * p[i]))
        found[i] = largest
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribution:
    """How far one axis explains the falls.

    Attributes:
        axis: Name of the axis.
        value: Spearman's rank correlation of the axis' value with survival; positive: larger survives.
        deviation: The same of the distance from the median; negative: the far ones fall.
        p: p-value of the stronger of the two, doubled because it was picked.
    """

    axis: str
    value: float
    deviation: float
    p: float

    @property
    def strength(self) -> float:
        """The larger magnitude of the two correlations."""
        return max(abs(self.value), abs(self.deviation))


def attribute(axis: str, values: Sequence[float], survived: Sequence[bool]) -> Attribution:
    """Rank correlation of an axis with survival; zeros where nothing varies.

    Args:
        axis: Name of the axis.
        values: Its value in each trial, (n,).
        survived: Whether each survived, (n,).
    """
    from scipy.stats import spearmanr

    x, y = np.asarray(values, dtype=float), np.asarray(survived, dtype=float)
    if len(x) < 3 or np.ptp(y) == 0.0:
        return Attribution(axis=axis, value=0.0, deviation=0.0, p=1.0)

    def correlate(v: "np.typing.NDArray[np.float64]") -> tuple[float, float]:
        if np.ptp(v) == 0.0:
            return 0.0, 1.0
        found = spearmanr(v, y)
        return float(found.statistic), float(found.pvalue)

    (value, p_value), (deviation, p_deviation) = correlate(x), correlate(np.abs(x - np.median(x)))
    return Attribution(axis=axis, value=value, deviation=deviation, p=min(1.0, 2 * min(p_value, p_deviation)))
