"""Fills tables of docs/reproduction.md, trials.md and controllers.md, and draws docs/atlas.png, from measured results.

python docs/results.py reproduce logs/reproduce     # after cmpc reproduce all
python docs/results.py atlas campaigns/atlas        # after the command of docs/trials.md
python docs/results.py reach campaigns/reach...     # after cmpc trials reach --out campaigns/reach; folders in a row
"""

import collections
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

SHOWN = 10  # axes of the atlas in the picture


def fill(page: Path, name: str, lines: Sequence[str]) -> None:
    """Put lines between the marks of a name in a page."""
    begin, end = f"<!-- {name}: made by docs/results.py -->", f"<!-- {name}: end -->"
    before, marked, rest = page.read_text(encoding="utf-8").partition(begin)
    _, closed, after = rest.partition(end)
    if not (marked and closed):
        raise SystemExit(f"{page}: has no marks {begin} and {end}")
    body = "\n".join(lines)
    page.write_text(f"{before}{begin}\n\n{body}\n\n{end}{after}", encoding="utf-8")


def cell(text: str, *, bold: bool = False) -> str:
    """A text in a table."""
    text = text.replace("|", "\\|")
    return f"**{text}**" if bold and text else text


def verdicts(folder: Path) -> Iterator[str]:
    """Every claim of a reproduction as the lines of a table; bold is what does not hold."""
    from sim.reproduce import EXPERIMENTS

    found = {name: json.loads(path.read_text()) for name in EXPERIMENTS if (path := folder / f"{name}.json").is_file()}
    if missing := [name for name in EXPERIMENTS if name not in found]:
        print(f"{folder}: without {', '.join(missing)}", file=sys.stderr)
    rows = [(name, verdict) for name, one in found.items() for verdict in one["verdicts"]]
    findings = [[v["rigid"], v["mujoco"], *(v["polished"] or [])] for _, v in rows]
    held = [sum(row[i]["holds"] is True for row in findings if len(row) > i) for i in range(4)]
    judged = [sum(row[i]["holds"] is not None for row in findings if len(row) > i) for i in range(4)]
    plants = ("rigid plant", "MuJoCo", "rigid plant, polished gait", "MuJoCo, polished gait")
    words = ", ".join(f"{h} of {j} on {plant}" for h, j, plant in zip(held, judged, plants, strict=True))
    yield f"Claims that hold: {words}."
    yield ""
    yield f"| | claim | paper | {' | '.join(plants)} |"
    yield "|---|---|---|---|---|---|---|"
    before = ""
    for (name, verdict), row in zip(rows, findings, strict=True):
        cells = [cell(one["text"], bold=one["holds"] is False) for one in row] + [""] * (4 - len(row))
        first = name if name != before else ""
        yield f"| {first} | {cell(verdict['claim'])} | {verdict['paper']} | {' | '.join(cells)} |"
        before = name


def atlas(folder: Path) -> Iterator[str]:
    """What each controller of a campaign's margins holds, as the lines of a table; and the picture."""
    from sim.trials.plan import MarginStudy
    from sim.trials.plan.axis import label
    from sim.trials.report.findings import sides, weakest
    from sim.trials.run.recall import open_results

    results = open_results(folder)
    plan, store = results.plan, results.store
    study = next(study for study in plan.studies if isinstance(study, MarginStudy))
    found = list(sides(results, study))
    own = {kind: [side for side in found if side.controller == kind] for kind in plan.controllers}
    counts = store.counts()
    trials, unknown = sum(one.done for one in counts.values()), sum(1 for row in results if not row.known)
    steps = plan.scenario.steps
    yield f"{trials} trials of {steps} steps{f', {unknown} without a result' if unknown else ''}."
    yield ""
    most = max(len(rows) for rows in own.values())
    yield f"| of {most} sides tried | {' | '.join(f'`{kind}`' for kind in own)} |"
    yield f"|---|{'---|' * len(own)}"
    yield _row("held as far as was tried", [str(sum(side.whole for side in rows)) for rows in own.values()])
    mixed = [str(sum(bool(side.margin.again) for side in rows)) for rows in own.values()]
    yield _row("blurred edges (some walk beyond the first fall)", mixed)
    yield _row(
        "with survivors whose energy runs out", [str(sum(s.fading is not None for s in r)) for r in own.values()]
    )
    weak = [next(iter(weakest(found, kind)), None) for kind in own]
    words = [
        f"{label(s.axis)} {'up' if s.sign > 0 else 'down'}, {s.typical_errors or 0:.2g}" if s else "-" for s in weak
    ]
    yield _row("breaks first, in deviations typical of a machine", words)
    falls = [collections.Counter(s.fall.cause.split(":")[0] for s in rows if s.fall) for rows in own.values()]
    causes = [", ".join(f"{cause} {number}" for cause, number in one.most_common(3)) for one in falls]
    yield _row("commonest causes of first falls", causes)
    draw(found, list(own), DOCS / "atlas.png")


ASKED = {
    "push through step 1": (-45.0, 90.0),
    "push through step 2": (-40.0, 80.0),
    "impulse at the beginning of step 2": (-10.1, 15.1),
    "slope from 0.6 m on": (-0.2, 0.2),
    "ledge at 1 m": (-0.1, 0.06),
    "ledge 6 cm up": (None, None),
    "load": (None, 6.0),
}
"""What is asked of c-mpc-plan, back or down and forward or up, by study of `reach`; of impulses 60 % of the limit."""


def reach(folders: Sequence[Path]) -> Iterator[str]:
    """What is held of what was asked, and the limit, as the lines of a table."""
    yield "| disturbance | asked | starts that walked on | limit |"
    yield "|---|---|---|---|"
    for folder in folders:
        yield from _reached(folder)


def _reached(folder: Path) -> Iterator[str]:
    from sim.trials.plan.axis import label
    from sim.trials.plan.limits import shipped_limits
    from sim.trials.run.recall import open_results
    from sim.trials.run.trial import trial_scenario

    limits, tried = shipped_limits("rabbit"), collections.defaultdict(list)
    with open_results(folder) as results:
        plan = results.plan
        for row in results:
            if row.known:
                tried[row.controller, row.study, next(iter(json.loads(row.values).values()))].append(row)
    for start, study in plan.offsets():
        first = study.axes[0]
        for kind in plan.controllers:
            found = {value: rows for (who, name, value), rows in tried.items() if (who, name) == (kind, study.name)}
            for sign, asked in zip((-1, 1), ASKED[study.name], strict=True):
                own = sorted((v for v in found if sign * v > 0.0), key=abs)
                if asked is None or not own:
                    continue
                walked = ", ".join(f"{v:g}: {sum(r.survived for r in found[v])} of {len(found[v])}" for v in own)
                limit = limits.beside(trial_scenario(plan, kind, start), first.paths[0], sign)
                words = f"{limit['value']:.3g} {limit['unit']}" if limit else "-"
                yield f"| `{kind}`: {study.name}, {label(first)} | {asked:g} | {walked} | {words} |"


def _row(name: str, cells: Sequence[str]) -> str:
    return f"| {name} | {' | '.join(cell(text) for text in cells)} |"


def draw(found: Sequence[Any], controllers: Sequence[str], path: Path) -> None:
    """How far every controller holds along the first axes: a bar as long as the share of the tried range."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    from sim.pages.palette import FELL, colour
    from sim.trials.plan.axis import label

    axes = list(dict.fromkeys(label(side.axis) for side in found))[:SHOWN]
    figure, panel = plt.subplots(figsize=(9.6, 0.22 * len(axes) * (len(controllers) + 1.5)), dpi=130)
    ticks = []
    for i, axis in enumerate(axes):
        ours = [side for side in found if label(side.axis) == axis]
        top = i * (len(controllers) + 1.5)
        ticks.append(top + 0.5 * (len(controllers) - 1))
        for side in ours:
            row, place = top + controllers.index(side.controller), controllers.index(side.controller)
            width = side.sign * min(1.0, max(0.0, side.share))
            panel.barh(row, side.sign, 0.9, color="#8a929b2e")
            panel.barh(
                row, width, 0.9, color=colour(place), label=side.controller if i == 0 and side.sign > 0 else None
            )
            if side.margin.again:
                last = side.sign * min(1.0, side.share_of(side.margin.again[-1]))
                panel.barh(row, last - width, 0.9, left=width, color=colour(place), alpha=0.35)
            if not side.whole:
                panel.plot((width, width), (row - 0.45, row + 0.45), color=FELL, linewidth=2)
        for sign, where in ((-1, "right"), (1, "left")):
            limit = next((f"{s.limit:g} {s.unit if s.unit != '1' else ''}" for s in ours if s.sign == sign), "")
            panel.annotate(limit, (1.03 * sign, ticks[-1]), ha=where, va="center", fontsize=8, color="#555")
    panel.axvline(0.0, color="#1a1a1a", linewidth=0.8)
    panel.set_yticks(ticks, axes, fontsize=9)
    panel.set(xlim=(-1.25, 1.25), xticks=[], ylim=(len(axes) * (len(controllers) + 1.5) - 1.0, -1.0))
    panel.spines[:].set_visible(False)
    panel.tick_params(length=0)
    figure.legend(loc="upper center", ncols=len(controllers), frameon=False, fontsize=9)
    figure.tight_layout(rect=(0, 0, 1, 0.965))
    figure.savefig(path, metadata={"Software": None})
    plt.close(figure)


def main(words: Sequence[str]) -> None:
    """Fill the page of what was asked for."""
    if len(words) < 2 or words[0] not in ("reproduce", "atlas", "reach") or (len(words) > 2 and words[0] != "reach"):
        raise SystemExit(__doc__)
    folder = Path(words[1])
    if words[0] == "reproduce":
        fill(DOCS / "reproduction.md", "verdicts", list(verdicts(folder)))
    elif words[0] == "reach":
        fill(DOCS / "controllers.md", "reach", list(reach([Path(word) for word in words[1:]])))
    else:
        fill(DOCS / "trials.md", "atlas", list(atlas(folder)))


if __name__ == "__main__":
    main(sys.argv[1:])
