"""The summary of a run as a table for people and as one JSON object for programs."""

import dataclasses
import json
import math
from typing import Any

from rich.table import Table
from rich.text import Text

from sim.loop import Outcome, RunSummary
from sim.scenario import Scenario

OUTCOME_STYLES = {Outcome.COMPLETED.value: "bold green", Outcome.FELL.value: "bold yellow"}


def as_json(summary: RunSummary) -> str:
    """The fields of a `RunSummary` as one JSON object on one line; what is not finite becomes null."""
    return json.dumps(_finite(dataclasses.asdict(summary)), allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def as_table(summary: RunSummary, scenario: Scenario, why: str = "") -> Table:
    """The summary as a rich table, one figure a row.

    Args:
        summary: What came out.
        scenario: What was run.
        why: What broke in a run that fell, or is about to in one that walked on.
    """
    table = Table(title=f"{scenario.name}, {scenario.controller.kind}", show_header=False, title_justify="left")
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for name, text in _rows(summary, scenario, why):
        style = OUTCOME_STYLES.get(summary.outcome, "red") if name == "outcome" else ""
        table.add_row(Text(name), Text(text, style=style))
    return table


def _rows(summary: RunSummary, scenario: Scenario, why: str) -> list[tuple[str, str]]:
    assumed, fell = scenario.controller.friction, summary.outcome == Outcome.FELL.value
    rows = [
        ("outcome", _outcome(summary)),
        *([("why" if summary.fall_reason else "but", why)] if why else []),
        ("steps", f"{summary.steps} of {scenario.steps} in {summary.time_s:.2f} s"),
        ("step time", _number(summary.step_time_s, "{:.3f} s")),
        ("step length", _number(summary.step_length_m, "{:.3f} m")),
    ]
    for joint, peak in summary.peak_torque_Nm.items():
        limit = summary.torque_limit_Nm.get(joint, math.inf)
        name = f"peak torque, {joint.replace('_', ' ')}"
        rows.append((name, f"{peak:.1f} N.m" + (f" of {limit:.0f}" if math.isfinite(limit) else ", no limit")))
    rows += [
        (
            "worst |F_T/F_N|",
            _number(summary.friction_ratio_max, f"{{:.3f}} (controller assumes {assumed:g})"),
        ),
        ("output error, RMS", _number(summary.output_error_rms_rad, "{:.4f} rad" + ", the fall with it" * fell)),
        ("MPC torque / ZD+PD torque", _number(summary.mpc_torque_share, "{:.3f}")),
        ("solve time", _times(summary.solve_ms)),
        ("tick time", _times(summary.tick_ms)),
        ("speed", _number(summary.realtime_factor, "{:.2f} x real time")),
    ]
    if summary.scuff_time_s > 0.0:
        depth, time = 1e3 * summary.scuff_depth_m, 1e3 * summary.scuff_time_s
        rows.append(("swing foot below ground", f"{depth:.2f} mm at most, {time:.0f} ms in all"))
    if summary.fallbacks:
        rows.append(("fall-backs to ZD+PD", f"{summary.fallbacks} ticks"))
    if summary.slack_max_N > 0.0:
        rows.append(("contact rows softened by", f"{summary.slack_max_N:.3g} N at most"))
    rows.append(("log", summary.log or "none"))
    return rows


def _outcome(summary: RunSummary) -> str:
    detail = summary.fall_reason or summary.message
    return summary.outcome + (f": {detail}" if detail else "")


def _number(value: float | None, pattern: str) -> str:
    return pattern.format(value) if value is not None and math.isfinite(value) else "-"


def _times(milliseconds: dict[str, float]) -> str:
    known = {key: value for key, value in milliseconds.items() if value is not None and math.isfinite(value)}
    if not any(known.values()):
        return "-"  # a law without a solver spends no time in one
    return ", ".join(f"{key} {value:.3f} ms" for key, value in known.items())
