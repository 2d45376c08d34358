"""Margin study: how far along an axis, up and down, is survived; what is mixed beyond; where all that was tried falls.

The values of an axis are a lattice around the nominal one, as wide as the tolerance, so that a value is a
trial index and the search needs no memory but the results: the next trials follow from those there are.

Bisection finds an edge, and edges of walking are blurred: values below the one it finds fall, values above it are
survived. So the search then looks closely, value by value, below the lowest fall until `look` values in a row are
survived, and beyond the largest survivor until as many fall.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, TypeVar

from controller.common.units import AT_LEAST_ONE, NOT_NEGATIVE, POSITIVE, Radian, Unit
from sim.errors import UserError
from sim.scenario import Scenario
from sim.trials.plan.axis import label, spec_of

T = TypeVar("T")

MOST_POINTS = 1_000_000  # lattice points of an axis


@dataclass(frozen=True, slots=True, kw_only=True)
class MarginAxis:
    """One axis searched away from its nominal value, as far as its limits.

    Attributes:
        name: Name in tables and plots; the first path if empty.
        paths: Settings that take the axis' value.
        also: Further settings the axis needs, each "path = value".
        nominal: Value at which the walker is expected to survive.
        low: Smallest value tried; the nominal one for an axis with one side.
        high: Largest value tried.
        tolerance: Width of the lattice of values, the accuracy of the margin; a ratio on a "log" scale.
        scale: Whether values are spaced evenly, or by equal ratios.
        scan: Values tried on each side before the bisection, evenly spread up to the limit; they find
            survival that comes back beyond a fall.
        look: Values in a row that must be survived below the lowest fall, and fall beyond the largest survivor, before
            the search ends; 0 to believe the bisection.
        typical: Deviation from nominal to expect of a real machine, by which axes are compared; 0 for
            none; a ratio above 1 on a "log" scale.
    """

    paths: tuple[str, ...]
    name: str = ""
    also: tuple[str, ...] = ()
    nominal: float
    low: float
    high: float
    tolerance: Annotated[float, POSITIVE]
    scale: Literal["linear", "log"] = "linear"
    scan: Annotated[int, Unit("values"), AT_LEAST_ONE] = 3
    look: Annotated[int, Unit("values"), NOT_NEGATIVE] = 8
    typical: float = 0.0

    @property
    def ends(self) -> tuple[int, int]:
        """Lattice positions of the outermost values, (0 or below, 0 or above)."""
        return -self._count(self.low), self._count(self.high)

    def _count(self, limit: float) -> int:
        if self.scale == "log":
            return math.floor(abs(math.log(limit / self.nominal)) / math.log1p(self.tolerance) + 1e-6)
        return math.floor(abs(limit - self.nominal) / self.tolerance + 1e-6)

    def value(self, position: int) -> float:
        """Value at a lattice position; 0 is the nominal one."""
        if self.scale == "log":
            return float(f"{self.nominal * (1.0 + self.tolerance) ** position:.12g}")
        return float(f"{self.nominal + position * self.tolerance:.12g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class MarginStudy:
    """Margins along several axes, one at a time.

    Attributes:
        name: Name in tables and plots.
        draws: Trials of every value: the first as the plan says, each other one with small random offsets of the
            first joint and torso angles. A value is survived where all are; their share is the probability of walking.
        blur: Standard deviation of these offsets.
        axes: The axes.
    """

    name: str = "margin"
    draws: Annotated[int, Unit("trials"), AT_LEAST_ONE] = 1
    blur: Annotated[Radian, POSITIVE] = 1e-4
    axes: tuple[MarginAxis, ...] = ()

    @property
    def size(self) -> int:
        """Number of trials that could be asked for, for each controller; far fewer are."""
        return self.draws * self.lattice

    @property
    def lattice(self) -> int:
        """Number of values of all axes."""
        return sum(high - low + 1 for low, high in (axis.ends for axis in self.axes))

    def draw(self, index: int) -> int:
        """Which draw of its value a trial is; 0 is undisturbed."""
        return index // self.lattice

    def place(self, index: int) -> tuple[int, int]:
        """Axis number and lattice position of a trial, index from 0."""
        if not 0 <= index < self.size:
            raise IndexError(index)
        index %= self.lattice
        for number, axis in enumerate(self.axes):
            low, high = axis.ends
            if index <= high - low:
                return number, index + low
            index -= high - low + 1
        raise IndexError(index)

    def first_index(self, number: int) -> int:
        """Index of the nominal trial of an axis, its first draw."""
        before = sum(high - low + 1 for low, high in (axis.ends for axis in self.axes[:number]))
        return before - self.axes[number].ends[0]

    def by_position(self, number: int, known: Callable[[int, int], Iterable[tuple[int, T]]]) -> dict[int, list[T]]:
        """What is known of the trials of an axis, by lattice position, draw after draw.

        Args:
            number: Of the axis.
            known: What is known of the trials from one index on to before another, with their indices.
        """
        low, high = self.axes[number].ends
        found: dict[int, list[T]] = {}
        for draw in range(self.draws):
            zero = self.first_index(number) + draw * self.lattice
            for index, value in known(zero + low, zero + high + 1):
                found.setdefault(index - zero, []).append(value)
        return found

    def check(self, base: Scenario) -> None:
        """Refuse axes that are not legal.

        Raises:
            UserError: names the study, the axis and the value.
        """
        if not self.axes:
            raise UserError(f"margin {self.name!r}: has no axes; must have at least one")
        for axis in self.axes:
            where = f"margin {self.name!r}, axis {label(axis)!r}"
            spec = spec_of(axis, base)
            if spec.type not in (int, float):
                raise UserError(f"{where}: {axis.paths[0]} takes no number; a margin needs one")
            if not axis.low <= axis.nominal <= axis.high or axis.low == axis.high:
                raise UserError(
                    f"{where}: low = {axis.low:g}, nominal = {axis.nominal:g}, high = {axis.high:g} "
                    f"[{spec.unit}]: must be in this order, and low below high"
                )
            if axis.scale == "log" and axis.low <= 0.0:
                raise UserError(f'{where}: low = {axis.low:g} [{spec.unit}]: must be above 0 on a "log" scale')
            span = math.log(axis.high / axis.low) if axis.scale == "log" else axis.high - axis.low
            if not (math.isfinite(span) and span <= MOST_POINTS * axis.tolerance * 1.1):
                raise UserError(
                    f"{where}: low = {axis.low:g} to high = {axis.high:g} [{spec.unit}] is more than {MOST_POINTS} "
                    f"parts of tolerance = {axis.tolerance:g}"
                )
            if axis.typical < 0.0 or (axis.scale == "log" and 0.0 < axis.typical <= 1.0):
                least = 'a ratio above 1 on a "log" scale' if axis.scale == "log" else "above 0"
                raise UserError(f"{where}: typical = {axis.typical:g}: must be {least}, or 0 for none")
            if spec.type is int and not (axis.tolerance.is_integer() and axis.nominal.is_integer()):
                raise UserError(f"{where}: nominal and tolerance must be whole numbers of {spec.unit}")
            low, high = axis.ends
            if high - low > MOST_POINTS or (low, high) == (0, 0):
                raise UserError(
                    f"{where}: tolerance = {axis.tolerance:g}: must divide the range into 1 to {MOST_POINTS} parts"
                )


def next_positions(axis: MarginAxis, side: int, survived: Mapping[int, bool]) -> list[int]:
    """Lattice positions to try next on one side of an axis; none when the margin is known.

    Args:
        axis: The axis.
        side: -1 below the nominal value, 1 above.
        survived: Whether the trials there are survived, by position.
    """
    limit = axis.ends[0] if side < 0 else axis.ends[1]
    if limit == 0:
        return []
    scan = [0, *(round(limit * k / axis.scan) for k in range(1, axis.scan + 1))]
    missing = [position for position in dict.fromkeys(scan) if position not in survived]
    if missing:
        return missing
    middle = between(side, survived)
    if middle is not None:
        return [middle]
    held, fell = bracket(side, survived)
    if held is None or fell is None:
        return []
    top = max((abs(p) for p, ok in survived.items() if ok and p * side > 0), default=0)  # largest survivor
    below = range(max(1, abs(fell) - axis.look), abs(fell))
    beyond = range(top + 1, min(abs(limit), top + axis.look) + 1)
    return [side * p for p in (*below, *beyond) if side * p not in survived]


def bracket(side: int, survived: Mapping[int, bool]) -> tuple[int | None, int | None]:
    """Last position survived before the first fall, and that fall; None where there is none."""
    held = None
    for position in sorted((p for p in survived if p * side >= 0), key=abs):
        if not survived[position]:
            return held, position
        held = position
    return held, None


def between(side: int, survived: Mapping[int, bool]) -> int | None:
    """The position that halves the bracket of the first fall; None where there is no fall, or nothing between."""
    held, fell = bracket(side, survived)
    if held is None or fell is None or abs(fell - held) <= 1:
        return None
    return (held + fell) // 2 if side > 0 else -((-held - fell) // 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Margin:
    """What one side of an axis holds.

    Attributes:
        value: Largest value survived without a fall before it; None if the nominal one falls.
        fell_at: First value that falls; None if every value up to the limit is survived.
        fell_position: Its lattice position.
        reason: Why it falls.
        again: Values beyond the first fall that are survived: survival is not monotone on this side.
        trials: Number of trials it took.
        beyond: Least value tried such that it and every larger one tried fall; None if the largest is survived.
        mixed: From the first fall to the last survivor beyond it, (trials survived, trials); (0, 0) for a clean edge.
        rates: Share of trials survived by value tried, from the nominal one outwards.
    """

    value: float | None
    fell_at: float | None
    fell_position: int | None
    reason: str
    again: tuple[float, ...]
    trials: int
    beyond: float | None = None
    mixed: tuple[int, int] = (0, 0)
    rates: tuple[tuple[float, float], ...] = ()


def margin(axis: MarginAxis, side: int, reasons: Mapping[int, Sequence[str]]) -> Margin:
    """The margin on one side of an axis.

    Args:
        axis: The axis.
        side: -1 below the nominal value, 1 above.
        reasons: Why each trial fell by position, draw after draw, empty for one survived.
    """
    here = {p: reasons[p] for p in sorted(reasons, key=abs) if p * side >= 0}
    held, fell = bracket(side, {p: not any(fates) for p, fates in here.items()})
    walked = {p: sum(not reason for reason in fates) for p, fates in here.items()}
    outside = [] if fell is None else [p for p in here if abs(p) >= abs(fell)]
    again = [p for p in outside if walked[p]]
    last = abs(again[-1]) if again else -1
    beyond = next((p for p in outside if abs(p) > last), None)
    mixed = [p for p in outside if abs(p) <= last]
    return Margin(
        value=None if held is None else axis.value(held),
        fell_at=None if fell is None else axis.value(fell),
        fell_position=fell,
        reason="" if fell is None else next(filter(None, here[fell])),
        again=tuple(axis.value(p) for p in again),
        trials=sum(len(fates) for fates in here.values()),
        beyond=None if beyond is None else axis.value(beyond),
        mixed=(sum(walked[p] for p in mixed), sum(len(here[p]) for p in mixed)),
        rates=tuple((axis.value(p), walked[p] / len(fates)) for p, fates in here.items()),
    )
