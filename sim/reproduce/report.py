"""Writes what an experiment found: data, verdict, PNG, interactive figure, and the page with everything."""

import base64
import csv
import dataclasses
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from sim import pages
from sim.errors import UserError
from sim.reproduce import EXPERIMENTS
from sim.reproduce.criteria import CHANGED, RULES
from sim.reproduce.draw import draw
from sim.reproduce.panels import LinePanel, Panel
from sim.reproduce.study import PLANT_NAMES, Evaluation, Finding, Verdict

DIGITS = 5  # significant ones in the page; the data files have all


def write(
    name: str, found: Evaluation, folder: Path, *, quick: bool, changes: Mapping[str, Any] = MappingProxyType({})
) -> None:
    """Write one experiment's files: data/*.csv, <name>.json, <name>.png, <name>.html.

    Args:
        name: A name in `EXPERIMENTS`.
        found: What it found.
        folder: Where the files go.
        quick: Whether this is the coarse version, which the data then say.
        changes: Settings changed in every run, by dotted path.

    Raises:
        UserError: one of them cannot be written.
    """
    data = folder / "data"
    try:
        data.mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(f"{data}: cannot be made: {error.strerror}") from error
    for stem, columns in found.tables.items():
        write_csv(data / f"{name}-{stem}.csv", columns)
    verdict = {
        "experiment": name,
        "title": EXPERIMENTS[name],
        "quick": quick,
        "changed": {path: str(value) for path, value in changes.items()},
        "verdicts": [dataclasses.asdict(verdict) for verdict in found.verdicts],
        "notes": list(found.notes),
    }
    pages.write(folder / f"{name}.json", json.dumps(verdict, indent=1, ensure_ascii=False) + "\n")
    draw(found.panels, f"{name}: {EXPERIMENTS[name]}", folder / f"{name}.png")
    title = f"{name}: {EXPERIMENTS[name]}"
    sections = [_section(name, found, picture=None)]
    pages.write(folder / f"{name}.html", _page(title, sections, rows=[], lead="", changes=changes))


def write_page(
    found: Mapping[str, Evaluation],
    folder: Path,
    *,
    quick: bool,
    changes: Mapping[str, Any] = MappingProxyType({}),
) -> Path:
    """Write index.html, self-contained: every experiment with verdicts, interactive figure and picture.

    Args:
        found: What each experiment found.
        folder: Where its PNGs are and the page goes.
        quick: Whether these are the coarse versions.
        changes: Settings changed in every run, by dotted path.

    Returns:
        The page's path.
    """
    rows = [(name, verdict) for name, evaluation in found.items() for verdict in evaluation.verdicts]
    held = {plant: _held([getattr(verdict, plant) for _, verdict in rows]) for plant in PLANT_NAMES}
    both = [verdict.polished for _, verdict in rows if verdict.polished]
    polished = [_held([findings[i] for findings in both]) for i in range(2)]
    lead = (
        "Cascaded MPC of underactuated bipedal walking: every figure and table on the paper's own kind of plant "
        "(pinned stance foot, rigid impacts) and on MuJoCo with contact, a verdict for each claim."
        f"{' Coarse version (--quick).' if quick else ''} Of the claims judged {held['rigid']} hold on the rigid "
        f"plant and {held['mujoco']} on MuJoCo"
        f"{f', with the polished gait {polished[0]} and {polished[1]}' if both else ''}."
    )
    sections = [_section(name, evaluation, picture=folder / f"{name}.png") for name, evaluation in found.items()]
    path = folder / "index.html"
    listed = [_row(*row) for row in rows]
    pages.write(path, _page("The paper, made again", sections, rows=listed, lead=lead, changes=changes))
    return path


def _held(findings: Sequence[Finding]) -> str:
    """How many findings hold of those that are judged at all."""
    judged = [finding.holds for finding in findings if finding.holds is not None]
    return f"{sum(judged)} of {len(judged)}"


def _page(
    title: str, sections: list[dict[str, Any]], *, rows: list[dict[str, Any]], lead: str, changes: Mapping[str, Any]
) -> str:
    return pages.render(
        "reproduction.html",
        title=title,
        lead=lead,
        rows=rows,
        rules=[(rule.words, rule.meaning, rule.used) for rule in RULES],
        changed=CHANGED,
        settings=", ".join(f"{path} = {value}" for path, value in changes.items()),
        plants=list(PLANT_NAMES.values()),
        sections=sections,
    )


def _section(name: str, found: Evaluation, picture: Path | None) -> dict[str, Any]:
    return {
        "name": name,
        "title": EXPERIMENTS[name],
        "rows": [_row("", verdict) for verdict in found.verdicts],
        "panels": [[_plain_panel(panel) for panel in row] for row in found.panels],
        "notes": found.notes,
        "picture": base64.b64encode(picture.read_bytes()).decode() if picture else "",
    }


def _row(name: str, verdict: Verdict) -> dict[str, Any]:
    kinds = {True: "yes", False: "no", None: ""}
    found = (verdict.rigid, verdict.mujoco, *(verdict.polished or ()))
    findings = [(kinds[finding.holds], finding.text) for finding in found]
    return {"name": name, "claim": verdict.claim, "paper": verdict.paper, "findings": findings}


def _plain_panel(panel: Panel) -> Any:
    plain = {f.name: _plain(getattr(panel, f.name)) for f in dataclasses.fields(panel)}
    if isinstance(panel, LinePanel):
        return plain
    del plain["regions"]  # the classes tell them apart
    plain["classes"] = [[int(value) for value in row] for row in panel.classes]
    return plain


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value


def write_csv(path: Path, columns: Mapping[str, Any]) -> None:
    """Write columns of equal length, numbers in full."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True))
    pages.write(path, text.getvalue())
