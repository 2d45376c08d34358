"""One HTML page from a log, or from two: everything in it, nothing fetched, nothing in it executed but ours."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sim import pages
from sim.errors import UserError
from sim.interface import LEGS
from sim.log.read import Log
from sim.log.read.frames import Run, run_of
from sim.pages.packing import packed
from sim.review import facts
from sim.review.answer import answer
from sim.review.bands import bands
from sim.review.horizon import horizon
from sim.review.mechanics import mechanics_of
from sim.review.panels import PANELS, Panel, diagnostics_panels
from sim.review.signals import Signals, decimated, diagnostics_units, difference, signals_of
from sim.review.steps import HEAD, UNITS, steps

MOST_SAMPLES = 120_000
"""Samples of a signal, which two logs share: a minute of each is there tick by tick."""
MOST_FRAMES = 6_000
MOST_PUSHES = 3
MOST_SPANS = 100
FRAME_RATE = 100.0  # [1/s] of the figure


def page(logs: list[Log], renew: int = 0) -> str:
    """The page of one log or two.

    Args:
        logs: One or two, perhaps truncated or damaged; the page says so.
        renew: Seconds after which the page loads itself anew, at the same moment and view; 0 for never.

    Raises:
        UserError: a log is of a format this program does not know, or has nothing to show.
    """
    for log in logs:
        if log.unknown_format:
            raise UserError(f"{log.path} {log.unknown_format}")
    runs = [run_of(log) for log in logs]
    signals = [signals_of(run) for run in runs]
    for run, one in zip(runs, signals, strict=True):
        one.columns.update(mechanics_of(run, one.columns))
    panels = _panels(runs, signals)
    keys = {line.key for panel in panels for line in panel.lines} | {panel.x for panel in panels if panel.x}
    keys.add("s")  # by which two runs are aligned
    samples = MOST_SAMPLES // len(runs)
    data: dict[str, Any] = {
        "panels": [_panel(panel) for panel in panels],
        "steps": [f"{name} [{unit}]" if unit else name for name, unit in zip(HEAD, UNITS, strict=True)],
        "runs": [_run(run, one, keys, samples) for run, one in zip(runs, signals, strict=True)],
    }
    if len(runs) == 2:
        gap = difference(*signals)
        if not gap.tick.size:
            raise UserError(f"{logs[0].path} and {logs[1].path} have no tick in common")
        data["difference"] = _samples(gap, keys, samples)
    names = " | ".join(run["head"]["name"] for run in data["runs"])
    return pages.render("review.html", title=f"{names} – C-MPC log review", data=data, renew=renew)


def _panels(runs: list[Run], signals: list[Signals]) -> list[Panel]:
    """Panels with something in them: a plain ZD+PD run has no MPC, an undisturbed one no push."""

    def has_data(key: str) -> bool:
        return any(key in one.columns and bool(np.nan_to_num(one.columns[key]).any()) for one in signals)

    def there(key: str) -> bool:
        return any(key in one.columns for one in signals)

    units = {name: unit for run in runs for name, unit in diagnostics_units(run).items()}
    panels = [*PANELS, *diagnostics_panels(units)]
    panels = [replace(panel, lines=tuple(x for x in panel.lines if there(x.key))) for panel in panels]
    return [panel for panel in panels if any(has_data(line.key) for line in panel.lines)]


def _panel(panel: Panel) -> dict[str, Any]:
    lines = [{"key": x.key, "label": x.label, "colour": x.colour, "horizon": x.horizon} for x in panel.lines]
    names = ("name", "title", "unit", "x", "x_unit", "limits", "clip", "log", "note")
    return {**{name: getattr(panel, name) for name in names}, "lines": lines}


def _run(run: Run, signals: Signals, keys: set[str], samples: int) -> dict[str, Any]:
    words, moment = answer(run, signals)
    return {
        "head": facts.headline(run) | {"controller": facts.controller_of(run), "answer": words},
        "began": moment,
        "changed": facts.changed(run),
        "disagreements": facts.disagreements(run),
        "bands": bands(run, signals),
        "steps": steps(run, signals),
        "ticks": len(signals.t),
        "summary": facts.summary(run),
        "provenance": facts.provenance(run),
        "scenario": facts.scenario_text(run),
        "events": facts.events(run),
        "spans": _spans(signals),
        "limits": facts.limits(run),
        "geometry": facts.geometry(run),
        "end": float(signals.t[-1]),
        "data": _samples(signals, keys, samples),
        "frames": _frames(run, signals),
        "horizon": horizon(run),
    }


def _spans(signals: Signals) -> list[dict[str, Any]]:
    """Stretches of time in which something pushes."""
    size = np.nan_to_num(np.hypot(signals.columns["push.x"], signals.columns["push.z"]))
    edges = np.flatnonzero(np.diff(np.concatenate(([0.0], size > 0.0, [0.0]))))
    times = np.append(signals.t, signals.t[-1])
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [
        {"from": float(times[a]), "to": float(times[b]), "name": f"{size[a:b].max():.0f} N", "colour": "push"}
        for a, b in list(pairs)[:MOST_SPANS]
    ]


def _samples(signals: Signals, keys: set[str], most: int) -> dict[str, Any]:
    t, columns = decimated(signals, most)
    nothing = np.full(len(t), np.nan)  # figures that only the other log's controller gives
    order = sorted(keys)
    rows = [columns.get(key, nothing) for key in order]
    return {"keys": order, "t": packed(t, bits=22), "numbers": packed(rows)}


def _frames(run: Run, signals: Signals) -> dict[str, Any]:
    """What the figure draws: angles, hip, contact forces, and pushes as (tail x, tail z, force x, force z)."""
    span = float(signals.t[-1] - signals.t[0])
    count = max(1, min(MOST_FRAMES, len(signals.t), round(span * FRAME_RATE)))
    at = np.unique(np.linspace(0, len(signals.t) - 1, count).astype(np.int64))
    names = [f"q.{name}" for name in ("left_hip", "right_hip", "left_knee", "right_knee", "torso")]
    names += [
        "hip.x",
        "hip.z",
        *(f"force.{leg}.{axis}" for leg in LEGS for axis in ("tangential", "normal")),
        "stance",
    ]
    rows = [signals.t[at], *(signals.columns[name][at] for name in names)]
    return {"numbers": packed(rows, bits=22), "pushes": _pushes(run)}


def _pushes(run: Run) -> dict[str, Any]:
    rows = []
    for time_ns, scene in run.log.messages("/forces") if "/forces" in run.log.channels else ():
        for entity in [e for e in scene.entities if e.id.startswith("push")][:MOST_PUSHES]:
            if not entity.arrows:
                continue
            force = {note.key: note.value for note in entity.metadata}
            tail = entity.arrows[0].pose.position
            x, z = (_number(force.get(f"{axis} [N]", "")) for axis in "xz")
            rows.append([time_ns * 1e-9, tail.x, tail.z, x, z])
    return {"numbers": packed(np.array(rows).T, bits=22)} if rows else {}


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0


def write_page(logs: list[Log], target: Path) -> None:
    """Write the page; an existing page of that name is replaced.

    Raises:
        UserError: a log is of a format this program does not know, has nothing to show, or the page cannot be written.
    """
    text = page(logs)
    if target.is_dir() or target.suffix == ".mcap":
        raise UserError(f"--out {target}: must be the name of an .html file")
    pages.write(target, text)
