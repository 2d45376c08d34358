"""What the results of each study say: margins, grid lines, survival rates. No pictures, no pages."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sim.trials.plan import GridStudy, MarginStudy, MonteCarloStudy
from sim.trials.plan.axis import Value, label, spec_of
from sim.trials.plan.margin import Margin, MarginAxis, margin, next_positions
from sim.trials.reliability.probability import wilson
from sim.trials.report import stats
from sim.trials.run import Results, TrialResult


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """One side of one axis for one controller.

    Attributes:
        axis: The axis.
        unit: Unit of its values.
        controller: Kind of controller.
        sign: -1 below the nominal value, 1 above.
        limit: Outermost value tried.
        margin: What it holds.
        fall: The first trial that falls, None if everything tried is held.
        fading: Least value whose survivors lose energy step by step; None if none does.
    """

    axis: MarginAxis
    unit: str
    controller: str
    sign: int
    limit: float
    margin: Margin
    fall: TrialResult | None
    fading: float | None = None

    @property
    def mixed_interval(self) -> tuple[float, float] | None:
        """Wilson's 95 % interval of the share that walks from the first fall to the last survivor; None if clean."""
        walked, trials = self.margin.mixed
        return wilson(walked, trials) if trials else None

    @property
    def share(self) -> float:
        """Part of the tried range that is held, 0 to 1; on a log scale, of its logarithm."""
        return 0.0 if self.margin.value is None else self.share_of(self.margin.value)

    def share_of(self, value: float) -> float:
        """Where a value lies between the nominal one (0) and the limit (1)."""
        nominal = self.axis.nominal
        if self.axis.scale == "log":
            return math.log(value / nominal) / math.log(self.limit / nominal)
        return (value - nominal) / (self.limit - nominal)

    @property
    def typical_errors(self) -> float | None:
        """The first value that falls, or the limit, in deviations to expect of a machine; None if the plan names none.

        The value that falls, not the last one held: that is the nominal one where the lattice is coarse.
        """
        if not self.axis.typical:
            return None
        value = self.limit if self.margin.fell_at is None else self.margin.fell_at
        if self.axis.scale == "log":
            return abs(math.log(value / self.axis.nominal)) / math.log(self.axis.typical)
        return abs(value - self.axis.nominal) / self.axis.typical

    @property
    def whole(self) -> bool:
        """Whether everything that was tried is held."""
        return self.margin.fell_at is None


def sides(results: Results, study: MarginStudy) -> Iterator[Side]:
    """Every side of every axis whose search is finished, for every controller."""
    start = next(start for start, other in results.plan.offsets() if other is study)
    for number, axis in enumerate(study.axes):
        low, high = axis.ends
        for sign in (-1, 1):
            limit = low if sign < 0 else high
            if limit == 0:
                continue
            for controller in results.plan.controllers:
                rows = study.by_position(number, _rows(results, controller, start))
                done = {position: trials for position, trials in rows.items() if len(trials) == study.draws}
                survived = {position: all(row.survived for row in trials) for position, trials in done.items()}
                if not next_positions(axis, sign, survived):
                    found = margin(axis, sign, {p: [row.why for row in trials] for p, trials in done.items()})
                    yield Side(
                        axis=axis,
                        unit=spec_of(axis, results.plan.scenario).unit,
                        controller=controller,
                        sign=sign,
                        limit=axis.value(limit),
                        margin=found,
                        fall=None if found.fell_position is None else _first_fall(done[found.fell_position]),
                        fading=_fading(done, sign, axis),
                    )


def _rows(results: Results, controller: str, start: int) -> Callable[[int, int], Iterator[tuple[int, TrialResult]]]:
    """What `MarginStudy.by_position` asks for, of a study whose first trial is `start`."""

    def known(first: int, end: int) -> Iterator[tuple[int, TrialResult]]:
        rows = results.store.results(controller, start + first, start + end)
        return ((row.trial - start, row) for row in rows if row.known)

    return known


def _fading(done: Mapping[int, Sequence[TrialResult]], sign: int, axis: MarginAxis) -> float | None:
    """Least value with a survivor that loses energy step by step, None without one."""
    found = [p for p, trials in done.items() if p * sign >= 0 and any(row.fading for row in trials)]
    return axis.value(min(found, key=abs)) if found else None


def _first_fall(trials: Sequence[TrialResult]) -> TrialResult:
    return next(row for row in trials if not row.survived)


def edge_words(side: Side) -> str:
    """What can be stood for on a side: held up to where, mixed between what, falls beyond."""
    m, unit = side.margin, f" {side.unit}" if side.unit not in ("", "1") else ""
    if side.whole:
        words = f"holds everything tried up to {side.limit:.4g}{unit}"
    else:
        held = "falls at the nominal value" if m.value is None else f"holds everything tried up to {m.value:.4g}{unit}"
        words = f"{held}; {_mixed(side, unit)}"
        words += (
            f"falls at all tried from {m.beyond:.4g}{unit} on" if m.beyond is not None else "walks at the limit again"
        )
    if side.fading is not None:
        words += f"; survivors lose energy step by step from {side.fading:.4g}{unit} on"
    return words


def _mixed(side: Side, unit: str) -> str:
    """Where some walk and some fall, and the share that walks with its interval."""
    m, interval = side.margin, side.mixed_interval
    if interval is None or not m.again:
        return ""
    walked, trials = m.mixed
    low, high = (100.0 * end for end in interval)
    return (
        f"mixed from {m.fell_at:.4g} to {m.again[-1]:.4g}{unit} ({walked} of {trials} walk, 95 %: {low:.0f} to "
        f"{high:.0f} %); "
    )


def side_figures(side: Side) -> dict[str, Any]:
    """What a side holds as plain values: `Margin`'s fields, the axis, how finely was looked, and the words."""
    m, interval = side.margin, side.mixed_interval
    walked, trials = m.mixed
    return {
        "axis": label(side.axis),
        "unit": side.unit,
        "controller": side.controller,
        "direction": "up" if side.sign > 0 else "down",
        "limit": side.limit,
        "holds_up_to": side.limit if side.whole else m.value,
        "first_fall": m.fell_at,
        "mixed_to": m.again[-1] if m.again else None,
        "mixed_walked": walked,
        "mixed_trials": trials,
        "mixed_interval": list(interval) if interval else None,
        "falls_from": m.beyond,
        "tolerance": side.axis.tolerance,
        "scale": side.axis.scale,
        "look": side.axis.look,
        "trials": m.trials,
        "rates": [list(pair) for pair in m.rates],
        "fading_from": side.fading,
        "words": edge_words(side),
    }


def weakest(found: Sequence[Side], controller: str) -> list[Side]:
    """Sides of a controller that break, weakest first: by typical errors held where the plan names them."""
    broken = [side for side in found if side.controller == controller and not side.whole]
    return sorted(broken, key=lambda side: (side.typical_errors is None, side.typical_errors or 0.0, side.share))


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """Survival of one controller in a study.

    Attributes:
        controller: Kind of controller.
        survived: Survivors.
        trials: Trials with a result.
        unknown: Trials without one: errors, and those given up.
        interval: Wilson's 95 % interval of the survival rate of the trials with a result.
    """

    controller: str
    survived: int
    trials: int
    unknown: int
    interval: tuple[float, float]

    @property
    def share(self) -> float:
        """Survivors of the trials with a result, 0 to 1."""
        return self.survived / self.trials if self.trials else 0.0

    @property
    def worst(self) -> float:
        """The same if every trial without a result had fallen."""
        return self.survived / max(1, self.trials + self.unknown)


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomFindings:
    """What a Monte-Carlo study says.

    Attributes:
        rates: Survival of each controller.
        reference: The plan's first controller, to which the others are compared.
        pairs: Paired comparison of the reference with each other controller, by its name.
        p: Its p-value, adjusted by Holm's method for the number of comparisons.
        attributions: For each controller, the axes that explain its falls, strongest first.
        results: Its trials with a result, by controller.
    """

    rates: tuple[Rate, ...]
    reference: str
    pairs: dict[str, stats.Paired]
    p: dict[str, float]
    attributions: dict[str, tuple[stats.Attribution, ...]]
    results: dict[str, list[TrialResult]]


def random_findings(results: Results, study: MonteCarloStudy) -> RandomFindings:
    """Survival rates, paired comparisons and attributions of a Monte-Carlo study."""
    start = next(start for start, other in results.plan.offsets() if other is study)
    every = {c: list(results.store.results(c, start, start + study.size)) for c in results.plan.controllers}
    every = {controller: rows for controller, rows in every.items() if rows}
    rates = tuple(_rate(controller, rows) for controller, rows in every.items())
    found = {controller: [row for row in rows if row.known] for controller, rows in every.items()}
    reference, *others = list(found) or [""]
    first = {row.trial: row.survived for row in found.get(reference, ())}
    pairs = {
        other: stats.mcnemar([(first[row.trial], row.survived) for row in found[other] if row.trial in first])
        for other in others
    }
    attributions = {
        controller: tuple(
            sorted(
                (
                    stats.attribute(label(axis), values, [row.survived for row in rows])
                    for axis in study.axes
                    if (values := _numbers([row.axis_values.get(label(axis)) for row in rows]))
                ),
                key=lambda found: -found.strength,
            )
        )
        for controller, rows in found.items()
    }
    p = dict(zip(pairs, stats.holm([pair.p for pair in pairs.values()]), strict=True))
    return RandomFindings(rates=rates, reference=reference, pairs=pairs, p=p, attributions=attributions, results=found)


def _rate(controller: str, rows: list[TrialResult]) -> Rate:
    survived, trials = sum(row.survived for row in rows), sum(row.known for row in rows)
    return Rate(
        controller=controller,
        survived=survived,
        trials=trials,
        unknown=len(rows) - trials,
        interval=wilson(survived, trials),
    )


def _numbers(values: list[Value | None]) -> list[float]:
    """The values as numbers; none at all if one is a word or missing."""
    numbers = [value for value in values if isinstance(value, int | float)]
    return [float(value) for value in numbers] if len(numbers) == len(values) else []


def grid_rows(results: Results, study: GridStudy) -> dict[str, dict[int, TrialResult]]:
    """Results of a grid by controller and index within the study."""
    start = next(start for start, other in results.plan.offsets() if other is study)
    return {
        controller: {row.trial - start: row for row in results.store.results(controller, start, start + study.size)}
        for controller in results.plan.controllers
    }
