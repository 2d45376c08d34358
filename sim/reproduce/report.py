"""Writes what an experiment found: data, verdict, PNG, interactive figure, and the page with everything."""

import base64
import csv
import dataclasses
import html
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sim.reproduce import EXPERIMENTS
from sim.reproduce.criteria import RULES
from sim.reproduce.draw import draw
from sim.reproduce.panels import LinePanel, Panel
from sim.reproduce.study import PLANT_NAMES, Evaluation, Finding, Verdict

HERE = Path(__file__).parent
DIGITS = 5  # significant ones in the page; the data files have all


def write(name: str, found: Evaluation, folder: Path, *, quick: bool) -> None:
    """Write one experiment's files: data/*.csv, <name>.json, <name>.png, <name>.html.

    Args:
        name: A name in `EXPERIMENTS`.
        found: What it found.
        folder: Where the files go.
        quick: Whether this is the coarse version, which the page then says.
    """
    data = folder / "data"
    data.mkdir(exist_ok=True)
    for stem, columns in found.tables.items():
        write_csv(data / f"{name}-{stem}.csv", columns)
    verdict = {
        "experiment": name,
        "title": EXPERIMENTS[name],
        "quick": quick,
        "verdicts": [dataclasses.asdict(verdict) for verdict in found.verdicts],
        "notes": list(found.notes),
    }
    (folder / f"{name}.json").write_text(json.dumps(verdict, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    draw(found.panels, f"{name}: {EXPERIMENTS[name]}", folder / f"{name}.png")
    page = _html(f"{name}: {EXPERIMENTS[name]}", _section(name, found, picture=None))
    (folder / f"{name}.html").write_text(page, encoding="utf-8")


def write_page(found: Mapping[str, Evaluation], folder: Path, *, quick: bool) -> Path:
    """Write index.html, self-contained: every experiment with verdicts, interactive figure and picture.

    Args:
        found: What each experiment found.
        folder: Where its PNGs are and the page goes.
        quick: Whether these are the coarse versions.

    Returns:
        The page's path.
    """
    rows = [(name, verdict) for name, evaluation in found.items() for verdict in evaluation.verdicts]
    held = {plant: sum(_finding(v, plant).holds is True for _, v in rows) for plant in PLANT_NAMES}
    kind = " Coarse version (--quick)." if quick else ""
    head = [
        "<h1>The paper, made again</h1>",
        '<p class="about">Cascaded MPC of underactuated bipedal walking: every figure and table on the paper\'s own '
        "kind of plant (pinned stance foot, rigid impacts) and on MuJoCo with contact, a verdict for each claim."
        f"{kind} Of {len(rows)} claims {held['rigid']} hold on the rigid plant and {held['mujoco']} on MuJoCo.</p>",
        "<nav>" + "".join(f'<a href="#{name}">{name}</a>' for name in found) + "</nav>",
        "<h2>Verdicts</h2>",
        _table(rows),
        "<h3>When a claim holds</h3>",
        _criteria(),
    ]
    sections = [_section(name, evaluation, picture=folder / f"{name}.png") for name, evaluation in found.items()]
    path = folder / "index.html"
    path.write_text(_html("Reproduction", "\n".join([*head, *sections])), encoding="utf-8")
    return path


def _criteria() -> str:
    lines = ["<table><tr><th>words</th><th>the claim holds when</th><th>used in</th></tr>"]
    for rule in RULES:
        cells = (rule.words, rule.meaning, rule.used)
        lines.append("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>")
    return "\n".join([*lines, "</table>"])


def _finding(verdict: Verdict, plant: str) -> Finding:
    return verdict.rigid if plant == "rigid" else verdict.mujoco


def _section(name: str, found: Evaluation, picture: Path | None) -> str:
    notes = "".join(f"<li>{html.escape(note)}</li>" for note in found.notes)
    parts = [
        f'<h2 id="{name}">{name}: {html.escape(EXPERIMENTS[name])}</h2>',
        _table([(None, verdict) for verdict in found.verdicts]),
        f'<figure data-panels="{name}-panels"></figure>',
        f'<script type="application/json" id="{name}-panels">{_panels_json(found)}</script>',
        f'<ul class="notes">{notes}</ul>',
    ]
    if picture is not None:
        data = base64.b64encode(picture.read_bytes()).decode()
        alt = html.escape(EXPERIMENTS[name])
        parts.append(f'<details><summary>As a picture</summary><img alt="{alt}" src="data:image/png;base64,{data}">')
        parts.append("</details>")
    return "\n".join(parts)


def _table(rows: list[tuple[str, Verdict]] | list[tuple[None, Verdict]]) -> str:
    named = any(name for name, _ in rows)
    head = ("<th>experiment</th>" if named else "") + "<th>claim</th><th>paper</th>"
    head += "".join(f"<th>{plant}</th>" for plant in PLANT_NAMES.values())
    lines = [f"<table><tr>{head}</tr>"]
    for name, verdict in rows:
        cells = f'<td><a href="#{name}">{name}</a></td>' if named else ""
        cells += f"<td>{html.escape(verdict.claim)}</td><td>{html.escape(verdict.paper)}</td>"
        for plant in PLANT_NAMES:
            finding = _finding(verdict, plant)
            kind = {True: "yes", False: "no", None: ""}[finding.holds]
            cells += f'<td class="{kind}">{html.escape(finding.text)}</td>'
        lines.append(f"<tr>{cells}</tr>")
    return "\n".join([*lines, "</table>"])


def _html(title: str, body: str) -> str:
    css, script = ((HERE / name).read_text(encoding="utf-8") for name in ("page.css", "page.js"))
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<style>{css}</style></head>\n'
        f"<body>\n{body}\n<script>{script}</script>\n</body></html>\n"
    )


def _panels_json(found: Evaluation) -> str:
    rows = [[_plain_panel(panel) for panel in row] for row in found.panels]
    return json.dumps(rows, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")


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
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True))
