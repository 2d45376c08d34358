"""Results in words for the terminal."""

import dataclasses

from sim.trials.axis import label
from sim.trials.campaign import Results
from sim.trials.findings import Side, grid_rows, random_findings, sides, weakest
from sim.trials.grid import GridStudy
from sim.trials.margin import MarginStudy
from sim.trials.result import TrialResult

_UNITS = {"_Nm": " N.m", "_N": " N", "_m_s": " m/s", "_ms": " ms", "_s": " s", "_m": " m", "_rad": " rad"}


def describe(result: TrialResult) -> str:
    """One trial, a line a figure."""
    lines = [f"trial {result.controller}/{result.trial} of study {result.study}"]
    lines += [
        f"  {name:<24}{value:g}" if isinstance(value, float) else f"  {name:<24}{value}"
        for name, value in result.axis_values.items()
    ]
    for field in dataclasses.fields(result):
        value = getattr(result, field.name)
        if field.name in ("controller", "trial", "study", "values") or value in (None, ""):
            continue
        unit = next((unit for end, unit in _UNITS.items() if field.name.endswith(end)), "")
        stem = next((field.name.removesuffix(end) for end in _UNITS if field.name.endswith(end)), field.name)
        shown = (
            f"{value:.4g}"
            if isinstance(value, float)
            else "yes"
            if value is True
            else "no"
            if value is False
            else str(value)
        )
        lines.append(f"  {stem.replace('_', ' '):<24}{shown}{unit}")
    return "\n".join(lines)


def summarise(results: Results) -> str:
    """Every study in a few lines."""
    lines = []
    for study in results.plan.studies:
        if isinstance(study, MarginStudy):
            lines += _margins(results, study)
        elif isinstance(study, GridStudy):
            for controller, rows in grid_rows(results, study).items():
                survived = sum(row.survived for row in rows.values())
                lines.append(f"{study.name}: {controller} survives {survived} of {len(rows)} grid points")
        else:
            found = random_findings(results, study)
            for rate in found.rates:
                low, high = rate.interval
                lines.append(
                    f"{study.name}: {rate.controller} survives {rate.survived} of {rate.trials}, "
                    f"{100 * rate.survived / rate.trials:.1f} % (95 %: {100 * low:.1f} to {100 * high:.1f} %)"
                )
            for a, b, pair in found.pairs:
                lines.append(
                    f"{study.name}: only {a} survives {pair.first}, only {b} {pair.second}; McNemar p = {pair.p:.2g}"
                )
            for controller, axes in found.attributions.items():
                if axes and axes[0].strength > 0:
                    lines.append(f"{study.name}: falls of {controller} follow most of all {axes[0].axis}")
    errors = sum(row.outcome == "error" for row in results)
    if errors:
        lines.append(f"{errors} trials ended in an error; see results.csv")
    return "\n".join(lines)


def _margins(results: Results, study: MarginStudy) -> list[str]:
    found = list(sides(results, study))
    lines = []
    for controller in results.plan.controllers:
        broken = weakest(found, controller)
        total = sum(side.controller == controller for side in found)
        held = f"{study.name}: {controller} holds {total - len(broken)} of {total} sides as far as was tried"
        lines.append(held + (f"; breaks first on {side_words(broken[0])}" if broken else ""))
    return lines


def side_words(side: Side) -> str:
    """An axis, its direction and what it holds."""
    value = side.margin.value
    held = "not even the nominal value" if value is None else f"{value:.4g} {side.unit}".strip()
    errors = side.typical_errors
    times = f", {errors:.2g} times what is typical" if errors is not None else ""
    return f"{label(side.axis)} {'down' if side.sign < 0 else 'up'}: {held}{times}"
