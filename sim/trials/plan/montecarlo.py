"""Monte-Carlo study: every axis drawn at random, the same draws for every controller."""

import hashlib
import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from controller.common.units import AT_LEAST_ONE, NOT_NEGATIVE, Unit
from sim.errors import UserError
from sim.scenario import Scenario
from sim.trials.plan.axis import Value, label, spec_of

MOST_REDRAWS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomAxis:
    """One axis and its distribution.

    Attributes:
        name: Name in tables and plots; the first path if empty.
        paths: Settings that take the axis' value.
        also: Further settings the axis needs, each "path = value".
        distribution: normal (centre, spread: mean, standard deviation), uniform (low, high), log-normal
            (centre, spread: median, standard deviation of the natural logarithm) or choice (values or words,
            all equally likely).
        centre: Mean of a normal, median of a log-normal distribution.
        spread: Standard deviation, of the logarithm for log-normal.
        low: Lower end; a normal or log-normal value below it is drawn anew.
        high: Upper end; one above it is drawn anew.
        values: Values to choose from.
        words: Words to choose from.
    """

    paths: tuple[str, ...]
    name: str = ""
    also: tuple[str, ...] = ()
    distribution: Literal["normal", "uniform", "log-normal", "choice"]
    centre: float | None = None
    spread: Annotated[float | None, NOT_NEGATIVE] = None
    low: float | None = None
    high: float | None = None
    values: tuple[float, ...] = ()
    words: tuple[str, ...] = ()

    def draw(self, generator: np.random.Generator, *, whole: bool) -> Value:
        """One value; `whole` rounds it, for settings that count."""
        options: tuple[Value, ...] = self.values or self.words
        if self.distribution == "choice":
            return options[int(generator.integers(len(options)))]
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        if self.distribution == "uniform":
            return float(generator.integers(int(low), int(high) + 1)) if whole else float(generator.uniform(low, high))
        for _ in range(MOST_REDRAWS):
            value = float(generator.normal(0.0, 1.0)) * (self.spread or 0.0)
            centre = self.centre or 0.0
            value = centre * math.exp(value) if self.distribution == "log-normal" else centre + value
            value = float(round(value)) if whole else value
            if low <= value <= high:
                return value
        raise UserError(f"axis {label(self)!r}: {MOST_REDRAWS} draws lay outside [{low:g}, {high:g}]")


def _generator(seed: int, study: str, axis: str, number: int) -> np.random.Generator:
    name = hashlib.sha256(f"{study}\0{axis}".encode()).digest()
    words = np.frombuffer(name, dtype=np.uint32)[:4].tolist()
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(*words, number)))


@dataclass(frozen=True, slots=True, kw_only=True)
class MonteCarloStudy:
    """Random trials over several axes at once.

    Attributes:
        name: Name in tables and plots.
        trials: Number of trials for each controller.
        axes: The axes.
    """

    name: str = "montecarlo"
    trials: Annotated[int, Unit("trials"), AT_LEAST_ONE] = 100
    axes: tuple[RandomAxis, ...] = ()

    @property
    def size(self) -> int:
        """Number of trials for each controller."""
        return self.trials

    def draw(self, seed: int, number: int, base: Scenario) -> tuple[Value, ...]:
        """Values of the axes for one trial, each from a generator of its own.

        A draw depends on the plan's seed, the names of study and axis, and the trial's number within the study: it
        stays what it is when other axes or studies are added.

        Args:
            seed: The plan's.
            number: Of the trial within the study, from 0.
            base: The plan's scenario.
        """
        return tuple(
            axis.draw(_generator(seed, self.name, label(axis), number), whole=spec_of(axis, base).type is int)
            for axis in self.axes
        )

    def check(self, base: Scenario) -> None:
        """Refuse axes that are not legal.

        Raises:
            UserError: names the study, the axis and what is missing.
        """
        if not self.axes:
            raise UserError(f"montecarlo {self.name!r}: has no axes; must have at least one")
        for axis in self.axes:
            unit = spec_of(axis, base).unit
            given = [
                value for value in (axis.centre, axis.spread, axis.low, axis.high, *axis.values) if value is not None
            ]
            if not all(math.isfinite(value) for value in (*given, (axis.high or 0.0) - (axis.low or 0.0))):
                raise UserError(f"montecarlo {self.name!r}, axis {label(axis)!r}: its numbers must be finite [{unit}]")
            missing = self._missing(axis)
            if missing:
                where = f"montecarlo {self.name!r}, axis {label(axis)!r}"
                raise UserError(f'{where}: distribution = "{axis.distribution}" needs {missing} [{unit}]')

    @staticmethod
    def _missing(axis: RandomAxis) -> str:
        if axis.distribution == "choice":
            return "" if bool(axis.values) != bool(axis.words) else "either values or words"
        if axis.distribution == "uniform":
            ordered = axis.low is not None and axis.high is not None and axis.low < axis.high
            return "" if ordered else "low and high, low below high"
        if axis.centre is None or axis.spread is None:
            return "centre and spread"
        if axis.distribution == "log-normal" and axis.centre <= 0.0:
            return "a centre above 0"
        return ""
