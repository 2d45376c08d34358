"""Grid study: every combination of the values of its axes."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

from controller.common.units import NOT_NEGATIVE, Unit
from sim.errors import UserError
from sim.scenario import Scenario
from sim.trials.plan.axis import Value, label, spec_of


@dataclass(frozen=True, slots=True, kw_only=True)
class GridAxis:
    """One axis of a grid: listed values, or evenly spaced ones.

    Attributes:
        name: Name in tables and plots; the first path if empty.
        paths: Settings that take the axis' value.
        also: Further settings the axis needs, each "path = value".
        values: Values, in the unit of the settings.
        words: Values of a setting that takes words.
        low: First of `count` evenly spaced values.
        high: Last of them.
        count: Number of evenly spaced values; 0 when they are listed.
    """

    paths: tuple[str, ...]
    name: str = ""
    also: tuple[str, ...] = ()
    values: tuple[float, ...] = ()
    words: tuple[str, ...] = ()
    low: float = 0.0
    high: float = 0.0
    count: Annotated[int, Unit("values"), NOT_NEGATIVE] = 0

    @property
    def size(self) -> int:
        """Number of values."""
        return self.count or len(self.values or self.words)

    @property
    def points(self) -> tuple[Value, ...]:
        """The values, in order."""
        return tuple(self.point(i) for i in range(self.size))

    def point(self, i: int) -> Value:
        """One of the values."""
        if not self.count:
            return (self.values or self.words)[i]
        width = (self.high - self.low) / (self.count - 1) if self.count > 1 else 0.0
        return float(f"{self.low + i * width:.12g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class GridStudy:
    """Every combination of the values of some axes.

    Attributes:
        name: Name in tables and plots.
        axes: The axes; the last one varies fastest.
    """

    name: str = "grid"
    axes: tuple[GridAxis, ...] = ()

    @property
    def size(self) -> int:
        """Number of trials for each controller."""
        return math.prod(axis.size for axis in self.axes) if self.axes else 0

    def point(self, index: int) -> tuple[Value, ...]:
        """Values of the axes at a trial, index from 0."""
        found: list[Value] = []
        for axis in reversed(self.axes):
            index, at = divmod(index, axis.size)
            found.append(axis.point(at))
        return tuple(reversed(found))

    def check(self, base: Scenario) -> None:
        """Refuse an empty grid and axes that are not legal.

        Raises:
            UserError: names the study and the axis.
        """
        if not self.axes:
            raise UserError(f"grid {self.name!r}: has no axes; must have at least one")
        for axis in self.axes:
            spec = spec_of(axis, base)
            given = [bool(axis.values), bool(axis.words), bool(axis.count)]
            if sum(given) != 1:
                raise UserError(
                    f"grid {self.name!r}, axis {label(axis)!r}: is empty or given twice; must have either values, "
                    f"words, or low, high and count [{spec.unit or spec.type.__name__}]"
                )
            if not (math.isfinite(axis.low) and math.isfinite(axis.high - axis.low)):
                raise UserError(f"grid {self.name!r}, axis {label(axis)!r}: low and high must be finite [{spec.unit}]")


def boundary(points: tuple[Value, ...], survived: list[bool], start: int) -> tuple[int, int] | None:
    """Ends of the stretch of survivors around a start on one line of a grid, None if it falls there.

    Args:
        points: Values along the line.
        survived: Whether each survived.
        start: Index on the line to start from.
    """
    if not survived[start]:
        return None
    low, high = start, start
    while low > 0 and survived[low - 1]:
        low -= 1
    while high < len(points) - 1 and survived[high + 1]:
        high += 1
    return low, high


def lines(study: GridStudy) -> Iterator[tuple[tuple[Value, ...], list[int]]]:
    """Each line of a grid along its last axis: values of the other axes, indices of its trials."""
    *others, last = study.axes
    n = len(last.points)
    for number, fixed in enumerate(itertools.product(*(axis.points for axis in others))):
        yield fixed, list(range(number * n, (number + 1) * n))
