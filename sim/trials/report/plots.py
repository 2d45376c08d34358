"""The plots of a campaign: margins, grids, survival rates, what breaks, what explains the falls."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from sim.pages import number
from sim.pages.palette import CAUSES, FELL, GREY, LIGHT, SURVIVED, colour
from sim.pages.picture import INK, picture
from sim.trials.plan.axis import Value, label
from sim.trials.plan.grid import GridAxis
from sim.trials.reliability.probability import wilson
from sim.trials.report.findings import RandomFindings, Side, edge_words
from sim.trials.report.stats import Attribution
from sim.trials.run import TrialResult

if TYPE_CHECKING:
    from markupsafe import Markup


def margin_bars(sides: Sequence[Side], controllers: Sequence[str], most: Mapping[int, float] | None = None) -> "Markup":
    """One axis: a bar to either side for each controller, as long as the share of the tried range it holds.

    A bar that ends in a line broke there; one that fills its track held all that was tried; a pale bar goes on to the
    last value survived beyond the first fall, and rings mark those that are. A dashed line is the most that any
    controller could hold, as far as was found: `most`, by sign.
    """
    with picture(f"margins of {label(sides[0].axis)}", 240, 6 + 14 * len(controllers), full=True) as made:
        axes = made.axes
        for row, sign in {(controllers.index(side.controller), side.sign) for side in sides}:
            axes.barh(row, sign, color=LIGHT)
        for side in sides:
            row, width = controllers.index(side.controller), side.sign * min(1.0, side.share)
            made.title(axes.barh(row, width, color=colour(row))[0], side_title(side))
            if side.margin.again:
                last = side.sign * min(1.0, side.share_of(side.margin.again[-1]))
                axes.barh(row, last - width, left=width, color=colour(row), alpha=0.35)
            if not side.whole:
                axes.plot((width, width), (row - 0.5, row + 0.5), color=FELL, linewidth=2)
            at = [side.sign * side.share_of(again) for again in side.margin.again]
            axes.plot(at, [row] * len(at), "o", markersize=5, markerfacecolor="none", markeredgecolor=INK)
        for side in {side.sign: side for side in sides}.values():
            if most and side.sign in most and side.share_of(most[side.sign]) <= 1.0:
                axes.axvline(side.sign * side.share_of(most[side.sign]), color=INK, linewidth=1.2, linestyle="--")
        axes.axvline(0.0, color=INK, linewidth=0.8)
        axes.set(xlim=(-1.02, 1.02), ylim=(len(controllers) - 0.4, -0.6))
    return made.svg


def side_title(side: Side) -> str:
    """One side in words: what it holds, what is mixed, where all falls, and how the first fall ended."""
    reason = f"; first fall: {side.margin.reason}" if side.margin.reason else ""
    return f"{side.controller}: {edge_words(side)}{reason}"


def _rows(axes: Any, names: Sequence[str]) -> None:
    """Name the rows of a bare picture from the top down."""
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)


def cause_bars(falls: Mapping[str, Mapping[str, int]], title: str) -> "Markup":
    """What broke, a bar for each controller, as long as it has falls.

    Args:
        falls: Number of falls by controller and by cause (the value of a `sim.trials.falls.cause.Cause`).
        title: What the falls are those of.
    """
    order = list(CAUSES)
    longest = max((sum(counts.values()) for counts in falls.values()), default=0) or 1
    with picture(f"what breaks, {title}", 730, 14 + 24 * len(falls), bare=True) as made:
        for row, (controller, counts) in enumerate(falls.items()):
            left = 0
            for place, cause in sorted((order.index(cause.split(":")[0]), cause) for cause in counts):
                bar = made.axes.barh(row, counts[cause], left=left, color=CAUSES[order[place]], edgecolor="#fff")
                if counts[cause] > 0.03 * longest:
                    made.axes.bar_label(bar, label_type="center", color="#fff")
                made.title(bar[0], f"{controller}: {counts[cause]} falls, {cause}")
                left += counts[cause]
            made.axes.annotate(f"  {left} fall{'s' * (left != 1)}", (left, row), va="center", color=GREY)
        made.axes.set_xlim(0, 1.12 * longest)
        _rows(made.axes, list(falls))
    return made.svg


def paired_bars(found: RandomFindings) -> "Markup":
    """Draws that only one of two survives: to the left the reference, to the right the other."""
    names = list(found.results)
    longest = max((max(pair.first, pair.second) for pair in found.pairs.values()), default=0) or 1
    description = f"draws that only one survives, against {found.reference}"
    with picture(description, 520, 38 + 24 * len(found.pairs), bare=True) as made:
        for row, (other, pair) in enumerate(found.pairs.items()):
            for count, sign, shade in ((pair.first, -1, colour(0)), (pair.second, 1, colour(names.index(other)))):
                made.axes.bar_label(made.axes.barh(row, sign * count, color=shade), [str(count)], padding=4)
        made.axes.axvline(0.0, color=INK, linewidth=0.8)
        made.axes.set_xlim(-1.2 * longest, 1.2 * longest)
        made.axes.set_title(f"only {found.reference} survives   |   only it survives", color=GREY)
        _rows(made.axes, list(found.pairs))
    return made.svg


def grid_map(axes: Sequence[GridAxis], rows: Mapping[int, TrialResult], title: str) -> "Markup":
    """One or two axes of a grid: a cell a trial, green where it survived, with the steps where it fell.

    Args:
        axes: The axis upwards, if there are two, and the axis to the right.
        rows: Results by index within this picture.
        title: Heading.
    """
    across = axes[-1].points
    up: tuple[Value, ...] = axes[0].points if len(axes) == 2 else ("",)
    cell = max(16.0, min(44.0, 420.0 / len(across)))
    with picture(title, 110 + cell * len(across), 62 + cell * len(up), bare=True) as made:
        for index, found in rows.items():
            i, j = divmod(index, len(across))
            shade = SURVIVED if found.survived else FELL if found.fell else GREY
            alpha = 1.0 if found.survived else 0.35 + 0.5 / (1 + found.steps)
            box = made.axes.bar(j, 0.92, 0.92, bottom=i - 0.46, color=shade, alpha=alpha)
            made.title(box[0], f"{number(up[i])} {number(across[j])}: {found.why or 'survived'}".strip())
            if not found.survived:
                made.axes.annotate(str(found.steps), (j, i), ha="center", va="center", fontsize=7)
        every = max(1, -(-34 // int(cell)))
        made.axes.set_xticks(range(0, len(across), every), [number(value) for value in across[::every]])
        made.axes.set_yticks(range(len(up)), [number(value) for value in up])
        made.axes.set(xlim=(-0.5, len(across) - 0.5), ylim=(-0.5, len(up) - 0.5), xlabel=label(axes[-1]))
        made.axes.set_title(title, loc="left", fontweight="bold")
    return made.svg


def rate_bars(found: RandomFindings) -> "Markup":
    """Survival of each controller with its 95 % interval."""
    with picture("survival rate with 95 % interval", 560, 14 + 24 * len(found.rates), bare=True) as made:
        for row, rate in enumerate(found.rates):
            share = rate.share
            made.axes.barh(row, 1.0, color=LIGHT)
            made.axes.barh(row, share, color=colour(row))
            made.axes.plot(rate.interval, (row, row), "|-", color=INK, markersize=8)
            made.axes.annotate(f"{100 * share:.1f} % of {rate.trials}", (1.02, row), va="center")
        made.axes.set_xlim(0.0, 1.35)
        _rows(made.axes, [rate.controller for rate in found.rates])
    return made.svg


def attribution_bars(found: Sequence[Attribution], shade: str, rows: int = 14) -> "Markup":
    """Rank correlations of the axes with survival, strongest first: solid of the value, pale of the distance."""
    shown = found[:rows]
    with picture("rank correlation of each axis with survival", 530, 40 + 17 * len(shown), bare=True) as made:
        for row, one in enumerate(shown):
            made.axes.barh(row - 0.2, one.value, 0.35, color=shade)
            made.axes.barh(row + 0.2, one.deviation, 0.35, color=shade, alpha=0.45)
            made.axes.annotate(f"p = {one.p:.1g}", (1.03, row), va="center", color=GREY)
        made.axes.axvline(0.0, color=INK, linewidth=0.8)
        made.axes.set_xlim(-1.0, 1.4)
        made.axes.set_title("less survives  |  more survives", x=0.42, color=GREY)
        _rows(made.axes, [one.axis for one in shown])
    return made.svg


def survival_curve(axis: str, unit: str, rows: Mapping[str, Sequence[TrialResult]], bins: int = 8) -> "Markup":
    """Share of survivors along one axis, in bins of equal numbers, with 95 % intervals."""
    with picture(f"survival along {axis}", 250, 160) as made:
        for place, found in enumerate(rows.values()):
            if not found:
                continue
            ordered = sorted(found, key=lambda row: float(row.axis_values[axis]))
            edges = [round(k * len(ordered) / bins) for k in range(bins + 1)]
            parts = [ordered[a:b] for a, b in pairwise(edges) if b > a]
            x = [sum(float(row.axis_values[axis]) for row in part) / len(part) for part in parts]
            counts = [(sum(row.survived for row in part), len(part)) for part in parts]
            low, high = zip(*(wilson(*count) for count in counts), strict=True)
            made.axes.vlines(x, low, high, color=colour(place), alpha=0.35)
            made.axes.plot(x, [a / b for a, b in counts], "o-", color=colour(place), markersize=3, linewidth=1.2)
        made.axes.set_yticks((0.0, 0.5, 1.0), ("0", "50", "100"))
        made.axes.set(ylim=(-0.05, 1.05), xlabel=f"{axis} [{unit}]" if unit else axis)
        made.axes.locator_params(axis="x", nbins=4)
        made.axes.grid(axis="y")
    return made.svg
