"""A run step by step: what each took, gave and cost."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.interface import JOINTS
from sim.log.format.fields import OUTPUTS
from sim.log.read.frames import Event, Run
from sim.log.tools.judged import IMPACT
from sim.loop import Outcome
from sim.review.facts import limit_of_torque
from sim.review.signals import Signals

MOST_STEPS = 1000
HEAD = ("step", "from", "time", "length", "speed", "motor work", "energy", "peak torque", "worst ratio", "output RMS")
UNITS = ("", "s", "s", "m", "m/s", "J", "J", "", "", "rad")


def steps(run: Run, signals: Signals) -> list[dict[str, Any]]:
    """A row a step, the last perhaps cut short by a fall: where it begins in [s], its cells, and whether it is whole.

    Args:
        run: A log, perhaps damaged.
        signals: Its signals.
    """
    limits, last = limit_of_torque(run), float(signals.t[-1])
    period = float(signals.t[1] - signals.t[0]) if len(signals.t) > 1 else 0.0
    seen = [event for event in run.events if event.name == "impact" and event.t <= last + 1.5 * period]
    impacts = seen[:MOST_STEPS]
    starts = [0.0, *(event.t for event in impacts)]
    found = [_row(number, signals, (starts[number], event.t), limits, event) for number, event in enumerate(impacts)]
    if run.result.get("outcome") != Outcome.COMPLETED.value and last > starts[-1]:
        found.append(_row(len(impacts), signals, (starts[-1], last), limits, None))
    return found


def _row(
    number: int, signals: Signals, times: tuple[float, float], limits: Mapping[str, float], landing: Event | None
) -> dict[str, Any]:
    start, end = times
    a, b = np.searchsorted(signals.t, np.array(times) - 1e-9).tolist()
    a = min(a, len(signals.t) - 1)
    part = slice(a, max(b, a + 1))
    told = IMPACT.match(landing.message) if landing else None
    taken, length = (float(told[3]), float(told[4])) if told else (end - start, np.nan)
    columns = {key: values[part] for key, values in signals.columns.items()}
    power = sum(np.abs(columns[f"torque.{joint}"] * columns[f"dq.{joint}"]) for joint in JOINTS)
    y = np.concatenate([columns[f"y.{output}"] for output in OUTPUTS])
    peaks = [_most(np.abs(columns[f"torque.{joint}"])) for joint in JOINTS]
    shares = [
        peak / limits[joint] if limits.get(joint) else peak / 1e6 for joint, peak in zip(JOINTS, peaks, strict=True)
    ]
    worst = int(np.nanargmax(shares)) if np.isfinite(shares).any() else 0
    energy = columns["energy"] if "energy" in columns else np.array([np.nan])
    cells = (
        str(number + 1),
        _text(start, 3),
        _text(taken, 3),
        _text(length, 3),
        _text(length / taken if taken > 0.0 else np.nan, 3),
        _text(float(np.nansum(power)) * taken / max(1, len(np.atleast_1d(power))), 1),
        _text(float(energy[-1]), 1),
        f"{_text(peaks[worst], 1)} N·m {JOINTS[worst].replace('_', ' ')}",
        _text(_most(columns["ratio"]), 3),
        _text(float(np.sqrt(np.nanmean(y**2))) if np.isfinite(y).any() else np.nan, 4),
    )
    return {"t": start, "cells": cells, "whole": landing is not None}


def _most(values: Any) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else float("nan")


def _text(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) and abs(value) < 1e6 else "–"
