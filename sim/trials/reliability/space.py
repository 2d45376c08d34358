"""From a study's axes to standard normal space and back: distributions by OpenTURNS, correlations by a normal copula.

A point u of independent standard normal coordinates becomes correlated ones z = L u, L L^T = R, and each z_i the value
of its axis with the same probability of being exceeded (Nataf's transformation; Lebrun, Dutfoy, An innovating analysis
of the Nataf transformation from the copula viewpoint, Probabilistic Engineering Mechanics 2009).
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from sim.errors import UserError
from sim.scenario import Scenario
from sim.trials.plan.axis import Value, label, spec_of
from sim.trials.plan.montecarlo import RandomAxis
from sim.trials.plan.reliability import AdaptiveStudy, correlation
from sim.trials.reliability.asking import Array

DIGITS = 12  # of a value


class Space:
    """Standard normal space of a study."""

    def __init__(self, study: AdaptiveStudy, base: Scenario) -> None:
        """Build the distributions.

        Args:
            study: The study.
            base: The plan's scenario.

        Raises:
            UserError: OpenTURNS is not installed.
        """
        try:
            import openturns
        except ImportError as error:
            raise UserError("a reliability study needs OpenTURNS; install cmpc-walker[reliability]") from error
        self.names = [label(axis) for axis in study.axes]
        self.units = [spec_of(axis, base).unit for axis in study.axes]
        self.whole = [spec_of(axis, base).type is int for axis in study.axes]
        self.axes = study.axes
        self.factor = np.linalg.cholesky(correlation(study, study.name))
        self._quantiles = [
            _quantile(openturns, axis, whole) for axis, whole in zip(study.axes, self.whole, strict=True)
        ]

    def values(self, u: Array) -> tuple[Value, ...]:
        """Values of the axes at a point, (n,)."""
        z = self.factor @ u
        return tuple(quantile(float(x)) for quantile, x in zip(self._quantiles, z, strict=True))

    def normal(self, values: Sequence[Value]) -> Array:
        """The nearest point to the origin that has these values, (n,); axes that are independent alone.

        Args:
            values: Of the axes.
        """
        return np.array([_inverse(quantile, axis, value) for quantile, axis, value
                         in zip(self._quantiles, self.axes, values, strict=True)])  # fmt: skip


def _upper(z: float) -> float:
    return 0.5 * math.erfc(z / math.sqrt(2.0))


def _quantile(ot: Any, axis: RandomAxis, whole: bool) -> Callable[[float], Value]:
    """The axis' value at a standard normal coordinate."""
    if axis.distribution == "choice":
        options: tuple[Value, ...] = axis.values or axis.words
        return lambda z: options[min(int(_upper(-z) * len(options)), len(options) - 1)]
    if axis.distribution == "uniform" and whole:
        assert axis.low is not None and axis.high is not None
        low, count = int(axis.low), int(axis.high) - int(axis.low) + 1
        return lambda z: float(low + min(int(_upper(-z) * count), count - 1))
    if axis.distribution != "uniform" and not axis.spread:
        assert axis.centre is not None
        centre = axis.centre
        return lambda z: centre
    distribution = _distribution(ot, axis)

    def value(z: float) -> Value:
        upper = z > 0.0
        found = float(distribution.computeQuantile(_upper(abs(z)), upper)[0])
        return float(round(found)) if whole else float(f"{found:.{DIGITS}g}")

    return value


def _distribution(ot: Any, axis: RandomAxis) -> Any:
    if axis.distribution == "uniform":
        return ot.Uniform(axis.low, axis.high)
    assert axis.centre is not None
    whole_line = (
        ot.Normal(axis.centre, axis.spread)
        if axis.distribution == "normal"
        else ot.LogNormal(math.log(axis.centre), axis.spread, 0.0)
    )
    if axis.low is None and axis.high is None:
        return whole_line
    low = -math.inf if axis.low is None else axis.low
    high = math.inf if axis.high is None else axis.high
    interval = ot.Interval([low], [high], [math.isfinite(low)], [math.isfinite(high)])
    return ot.TruncatedDistribution(whole_line, interval)


def _inverse(quantile: Callable[[float], Value], axis: RandomAxis, value: Value) -> float:
    """The coordinate nearest to 0 with a value; by bisection, since a quantile never falls."""
    options: tuple[Value, ...] = axis.values or axis.words
    if axis.distribution == "choice":
        place, count = options.index(value), len(options)
        ends = [_normal(place / count), _normal((place + 1) / count)]
        return min(max(0.0, ends[0]), ends[1])
    low, high = -9.0, 9.0
    here = quantile(0.0)
    if here == value:
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if quantile(middle) < value else (low, middle)  # type: ignore[operator]
    return 0.5 * (low + high)


def _normal(p: float) -> float:
    from statistics import NormalDist

    return NormalDist().inv_cdf(min(max(p, 1e-19), 1.0 - 1e-16))
