"""Results in words for the terminal."""

import dataclasses
import json

from sim.log.tools.text import printable
from sim.trials.plan import CertificateStudy, GridStudy, MarginStudy, ReliabilityStudy
from sim.trials.plan.axis import label
from sim.trials.report.findings import Rate, Side, edge_words, grid_rows, random_findings, sides, weakest
from sim.trials.report.reliability_findings import certificates, reliability_findings
from sim.trials.report.reliability_section import certificate_words, lead
from sim.trials.run import Results, TrialResult
from sim.trials.run.store import Counts

DIRECTIONS = {-1: "down", 1: "up"}
_UNITS = {
    "_Nm": " N.m",
    "_N": " N",
    "_rad_s": " rad/s",
    "_m_s": " m/s",
    "_ms": " ms",
    "_s": " s",
    "_m": " m",
    "_rad": " rad",
}


def describe(result: TrialResult) -> str:
    """One trial, a line a figure."""
    lines = [f"trial {result.controller}/{result.trial} of study {result.study}"]
    lines += [f"  {name:<24}{_shown(value)}" for name, value in result.axis_values.items()]
    figures = {field.name: getattr(result, field.name) for field in dataclasses.fields(result)}
    evidence = json.loads(figures.pop("evidence") or "{}")
    for name, value in (figures | evidence).items():
        if name not in ("controller", "trial", "study", "values") and value not in (None, ""):
            end = next((end for end in _UNITS if name.endswith(end)), "")
            lines.append(f"  {name.removesuffix(end).replace('_', ' '):<24}{_shown(value)}{_UNITS.get(end, '')}")
    return "\n".join(printable(line) for line in lines)


def _shown(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def counted(counts: Counts) -> str:
    """How many trials walked, fell or came to no result."""
    words = f"{counts.survived} walked, {counts.fell} fell"
    return words + (f", {counts.unknown} without a result" if counts.unknown else "")


def summarise(results: Results) -> str:
    """Every study in a few lines."""
    lines = []
    for study in results.plan.studies:
        if isinstance(study, MarginStudy):
            lines += _margins(results, study)
        elif isinstance(study, ReliabilityStudy):
            found_near = reliability_findings(results, study)
            lines += [f"{study.name}: {one.controller}: {lead(one, found_near.space.names)}" for one in found_near.each]
        elif isinstance(study, CertificateStudy):
            said = certificates(results, study)
            lines += [f"{study.name}: {name}: {certificate_words(study, one)}" for name, one in said.items()]
        elif isinstance(study, GridStudy):
            for controller, rows in grid_rows(results, study).items():
                survived, known = sum(row.survived for row in rows.values()), sum(row.known for row in rows.values())
                lines.append(
                    f"{study.name}: {controller} survives {survived} of {known} grid points"
                    + (f", {len(rows) - known} without a result" if known < len(rows) else "")
                )
        else:
            found = random_findings(results, study)
            for rate in found.rates:
                lines.append(f"{study.name}: {rate_words(rate)}")
            for other, pair in found.pairs.items():
                lines.append(
                    f"{study.name}: only {found.reference} survives {pair.first}, only {other} {pair.second}; "
                    f"McNemar p = {found.p[other]:.2g}"
                )
            for controller, axes in found.attributions.items():
                if axes and axes[0].strength > 0:
                    lines.append(f"{study.name}: falls of {controller} follow most of all {axes[0].axis}")
    unknown = sum(counts.unknown for counts in results.store.counts().values())
    if unknown:
        lines.append(
            f"{unknown} trials have no result: errors, and trials given up; see results.csv. They are tried again by "
            "cmpc trials retry DIR --errors"
        )
    return "\n".join(printable(line) for line in lines)


def rate_words(rate: Rate) -> str:
    """Survival with its interval over the trials with a result, and the worst case where some have none."""
    low, high = rate.interval
    words = (
        f"{rate.controller} survives {rate.survived} of {rate.trials}, {100 * rate.share:.1f} % "
        f"(95 %: {100 * low:.1f} to {100 * high:.1f} %)"
    )
    if rate.unknown:
        words += f"; {rate.unknown} without a result, {100 * rate.worst:.1f} % if all of them fell"
    return words


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
    """An axis, its direction, where it falls first, how much that is for a machine, and what breaks."""
    where = f"{label(side.axis)} {DIRECTIONS[side.sign]}"
    if side.whole:
        return f"{where}: holds all that was tried"
    why = f"; {side.fall.cause}" if side.fall and side.fall.cause else ""
    errors = side.typical_errors
    times = f" (first fall {errors:.2g} times what is typical)" if errors is not None else ""
    return f"{where}: {edge_words(side)}{times}{why}"
