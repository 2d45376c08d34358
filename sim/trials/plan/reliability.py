"""Studies that ask for walks as they learn: the nearest fall and its probability; a certificate of a probability."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from controller.common.units import AT_LEAST_ONE, NOT_NEGATIVE, POSITIVE, Unit
from sim.errors import UserError
from sim.scenario import Scenario
from sim.trials.plan.axis import label
from sim.trials.plan.montecarlo import MonteCarloStudy, RandomAxis

ROOM = 200_000
"""Numbers of trials set aside for each controller of a study that asks as it learns."""

FEWEST = 10  # draws

Method = Literal["importance", "subset", "directional", "crude"]
"""How a probability is found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliabilityStudy:
    """The nearest fall, the probability of a fall, and what both are made of, over random axes.

    Attributes:
        name: Name in tables and plots.
        draws: Random walks at the plan's spreads, the same for every controller.
        rays: How many of them are tried at other scales of all spreads too.
        scales: These scales.
        modes: Distinct nearest falls to look for, at most; 0 tries the draws alone.
        search: Walks of the search for the nearest falls from which on it begins nowhere anew; what is begun is ended.
        look: Random directions tried on the sphere just inside the nearest fall.
        probability: How the probability is found: by importance sampling around the nearest falls, unless the draws
            show enough falls by themselves; by subset simulation; by directional sampling; or by more plain draws.
        variation: Coefficient of variation at which the probability is known well enough.
        most: Walks for the probability at most, a pilot's aside.
        pairs: Pairs of axes whose plane is searched all around, each "axis, axis".
        correlations: Of the axes in standard normal space, each "axis, axis = value"; all others are independent.
        axes: The axes.
    """

    name: str = "reliability"
    draws: Annotated[int, Unit("trials"), AT_LEAST_ONE] = 200
    rays: Annotated[int, Unit("trials"), NOT_NEGATIVE] = 40
    scales: tuple[float, ...] = (0.5, 0.7, 1.4, 2.0)
    modes: Annotated[int, Unit("points"), NOT_NEGATIVE] = 3
    search: Annotated[int, Unit("trials"), AT_LEAST_ONE] = 2000
    look: Annotated[int, Unit("trials"), AT_LEAST_ONE] = 60
    probability: Method = "importance"
    variation: Annotated[float, POSITIVE] = 0.2
    most: Annotated[int, Unit("trials"), AT_LEAST_ONE] = 1000
    pairs: tuple[str, ...] = ()
    correlations: tuple[str, ...] = ()
    axes: tuple[RandomAxis, ...] = ()

    @property
    def size(self) -> int:
        """Numbers of trials set aside for each controller; far fewer are run."""
        return ROOM

    @property
    def planes(self) -> list[tuple[int, int]]:
        """The pairs, as numbers of axes."""
        return [_pair(text, f"reliability {self.name!r}: pairs", self.axes) for text in self.pairs]

    def check(self, base: Scenario) -> None:
        """Refuse axes, pairs and correlations that are not legal.

        Raises:
            UserError: names the study and what is wrong.
        """
        where = f"reliability {self.name!r}"
        _check_axes(where, self.axes, base)
        if self.draws < FEWEST or self.draws > ROOM // 10 or self.rays > ROOM // 100 or self.most > ROOM // 4:
            raise UserError(
                f"{where}: draws = {self.draws}, rays = {self.rays}, most = {self.most}: must be {FEWEST} to "
                f"{ROOM // 10}, up to {ROOM // 100}, and up to {ROOM // 4} trials"
            )
        if not all(0.0 < scale <= 5.0 and scale != 1.0 for scale in self.scales):
            raise UserError(
                f"{where}: scales = {list(self.scales)}: must be above 0, 5 or below, and not 1, which draws has"
            )
        if len(set(self.scales)) < len(self.scales) or len(self.scales) > 20:
            raise UserError(f"{where}: scales = {list(self.scales)}: must be each once, 20 or fewer")
        _ = self.planes
        _ = correlation(self, where)


@dataclass(frozen=True, slots=True, kw_only=True)
class CertificateStudy:
    """Random walks until it can be said, or refused, that a walk falls with less than some probability.

    Attributes:
        name: Name in tables and plots.
        probability: Of a fall, asked about.
        confidence: At which either answer is given.
        most: Walks after which nothing is said.
        batch: Walks between two looks; the answer holds whenever one looks.
        correlations: As in a `ReliabilityStudy`.
        axes: The axes.
    """

    name: str = "certificate"
    probability: float = 1e-3
    confidence: float = 0.95
    most: Annotated[int, Unit("trials"), AT_LEAST_ONE] = 20_000
    batch: Annotated[int, Unit("trials"), AT_LEAST_ONE] = 50
    correlations: tuple[str, ...] = ()
    axes: tuple[RandomAxis, ...] = ()

    @property
    def size(self) -> int:
        """Numbers of trials set aside for each controller."""
        return self.most

    def check(self, base: Scenario) -> None:
        """Refuse what cannot be certified.

        Raises:
            UserError: names the study and what is wrong.
        """
        where = f"certificate {self.name!r}"
        _check_axes(where, self.axes, base)
        if not 1e-6 <= self.probability <= 0.5:
            raise UserError(f"{where}: probability = {self.probability:g}: must be 1e-6 to 0.5")
        if not 0.5 <= self.confidence <= 0.9999:
            raise UserError(f"{where}: confidence = {self.confidence:g}: must be 0.5 to 0.9999")
        _ = correlation(self, where)


AdaptiveStudy = ReliabilityStudy | CertificateStudy
"""Studies whose next trials follow from the results there are."""


def _check_axes(where: str, axes: tuple[RandomAxis, ...], base: Scenario) -> None:
    if not axes:
        raise UserError(f"{where}: has no axes; must have at least one that is random")
    if all(_fixed(axis) for axis in axes):
        raise UserError(f"{where}: none of its axes is random; must have a spread above 0, or more than one value")
    try:
        MonteCarloStudy(name="", axes=axes).check(base)
    except UserError as error:
        words = str(error)
        words = words.removeprefix("montecarlo ''") if words.startswith("montecarlo ''") else f": {words}"
        raise UserError(where + words) from error
    for axis in axes:
        if axis.distribution in ("normal", "log-normal") and axis.low is not None and axis.high is not None:
            if axis.low >= axis.high:
                raise UserError(f"{where}, axis {label(axis)!r}: low = {axis.low:g} must be below high = {axis.high:g}")


def _fixed(axis: RandomAxis) -> bool:
    if axis.distribution == "choice":
        return len(set(axis.values or axis.words)) < 2
    return axis.distribution != "uniform" and not axis.spread


def _pair(text: str, where: str, axes: Sequence[RandomAxis]) -> tuple[int, int]:
    names = [label(axis) for axis in axes]
    # A name may hold a comma: every way to cut the text in two is tried.
    parts = text.split(",")
    cuts = [(",".join(parts[:k]).strip(), ",".join(parts[k:]).strip()) for k in range(1, len(parts))]
    for one, other in cuts:
        if one in names and other in names and one != other:
            return names.index(one), names.index(other)
    raise UserError(f'{where}: "{text}": must read "axis, axis", two of {"; ".join(names)}')


def correlation(study: AdaptiveStudy, where: str) -> NDArray[np.float64]:
    """Correlation matrix of the axes in standard normal space, (n, n).

    Raises:
        UserError: a line is not legal, or the matrix is not positive definite.
    """
    matrix = np.eye(len(study.axes))
    for text in study.correlations:
        pair, equals, value = text.rpartition("=")
        try:
            r = float(value)
        except ValueError:
            r = math.nan
        if not equals or not -1.0 < r < 1.0:
            raise UserError(f'{where}: correlations: "{text}": must read "axis, axis = value", -1 < value < 1')
        i, j = _pair(pair.strip(), f"{where}: correlations", study.axes)
        if matrix[i, j]:
            raise UserError(f'{where}: correlations: "{text}": this pair is given twice')
        matrix[i, j] = matrix[j, i] = r
    if np.linalg.eigvalsh(matrix).min() < 1e-9:
        least = float(np.linalg.eigvalsh(matrix).min())
        raise UserError(
            f"{where}: correlations: no random numbers are correlated like this (least eigenvalue {least:.3g}); the "
            "matrix must be positive definite: smaller values are"
        )
    return matrix


def extremes(axes: Sequence[RandomAxis], reach: float) -> list[tuple[RandomAxis, list[float | str]]]:
    """Values of each axis as far out as a study goes, `reach` deviations to either side."""
    found: list[tuple[RandomAxis, list[float | str]]] = []
    for axis in axes:
        ends: list[float | None] = [axis.low, axis.high]
        if axis.distribution in ("normal", "log-normal"):
            assert axis.centre is not None and axis.spread is not None
            steps = (-reach * axis.spread, reach * axis.spread)
            far = [axis.centre * math.exp(s) if axis.distribution == "log-normal" else axis.centre + s for s in steps]
            low = far[0] if axis.low is None else max(axis.low, far[0])
            high = far[1] if axis.high is None else min(axis.high, far[1])
            ends = [axis.centre, low, high]
        values: list[float | str] = [end for end in ends if end is not None]
        found.append((axis, list(itertools.chain(values, axis.values, axis.words))))
    return found
