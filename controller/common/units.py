"""Units, legal values and help, written once beside each setting: `Annotated[float, Unit("N"), NOT_NEGATIVE]`.

The command line's help, error messages and the log all read them from the annotation.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi
from typing import Annotated


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of a setting.

    Attributes:
        symbol: As printed, "N" or "rad/s"; "ratio" for a quantity without dimension.
    """

    symbol: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """Legal values of a setting, in its unit.

    Attributes:
        low: Lower end.
        high: Upper end.
        open: Whether the ends themselves are illegal.
        words: How a message names the range.
    """

    low: float = -inf
    high: float = inf
    open: bool = False
    words: str

    def __contains__(self, value: float) -> bool:
        """Whether the value is legal; NaN never is."""
        if self.open:
            return self.low < value < self.high
        return self.low <= value <= self.high


@dataclass(frozen=True, slots=True)
class Doc:
    """One sentence of help beside a setting, where its class has no line for it under `Attributes:`."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """Words a setting may hold that are known by heart, and a test for others.

    Attributes:
        known: The words, as help and messages list them.
        others: Whether another word is legal.
        legal: How a message names the others.
    """

    known: tuple[str, ...]
    others: Callable[[str], bool]
    legal: str


POSITIVE = Range(low=0.0, open=True, words="above 0")
NOT_NEGATIVE = Range(low=0.0, words="0 or above")
AT_LEAST_ONE = Range(low=1.0, words="1 or above")
FRACTION = Range(low=0.0, high=1.0, words="between 0 and 1")
SLOPE = Range(low=-pi / 2, high=pi / 2, open=True, words="between -pi/2 and pi/2")

Newton = Annotated[float, Unit("N")]
Metre = Annotated[float, Unit("m")]
Radian = Annotated[float, Unit("rad")]
Second = Annotated[float, Unit("s")]
Ratio = Annotated[float, Unit("ratio")]
PositiveRatio = Annotated[float, Unit("ratio"), POSITIVE]


def whole(low: int, high: int) -> Range:
    """Numbers of things that take room or time each, from few to as many as anybody has use for."""
    return Range(low=float(low), high=float(high), words=f"from {low} to {high}")
