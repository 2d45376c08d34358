"""The plots of a campaign: margins, grids, survival rates, what breaks, what explains the falls."""

import math
from collections.abc import Mapping, Sequence

from sim.trials.plan.axis import Value, label
from sim.trials.plan.grid import GridAxis
from sim.trials.report.findings import RandomFindings, Side
from sim.trials.report.stats import Attribution, wilson
from sim.trials.report.svg import (
    COLOURS,
    FELL,
    GREY,
    INK,
    LIGHT,
    SURVIVED,
    element,
    picture,
    titled,
)
from sim.trials.report.svg import label as text
from sim.trials.run import TrialResult

BAR = 11.0  # height of a bar

CAUSE_COLOURS = {
    "start": "#9aa1a9",
    "clearance": "#8d6e4a",
    "friction": "#3f9aa8",
    "contact": "#5b78c7",
    "energy": "#d8a31f",
    "prediction": "#8a5fbf",
    "torque": "#c8442f",
    "unclear": "#c9ced4",
}
"""Of the first words of `sim.trials.falls.cause.Cause`."""


def margin_bars(sides: Sequence[Side], controllers: Sequence[str]) -> str:
    """One axis: a bar to either side for each controller, as long as the share of the tried range it holds.

    A bar that ends in a line broke there; one that fills its track held all that was tried; a ring marks a
    value that is survived beyond the first fall.
    """
    half, height = 120.0, 6.0 + (BAR + 3) * len(controllers)
    parts = []
    signs = {side.sign for side in sides}
    for row, controller in enumerate(controllers):
        y = 3.0 + row * (BAR + 3)
        for sign in sorted(signs):
            x0 = half if sign > 0 else 0.0
            parts.append(element("rect", x=x0, y=y, width=half, height=BAR, fill=LIGHT))
        for side in sides:
            if side.controller != controller:
                continue
            width = half * min(1.0, side.share)
            x = half if side.sign > 0 else half - width
            shape = element("rect", x=x, y=y, width=width, height=BAR, fill=COLOURS[row % len(COLOURS)])
            if not side.whole:
                edge = half + side.sign * width
                shape += element("rect", x=edge - 1.0, y=y - 2.0, width=2.0, height=BAR + 4, fill=FELL)
            for again in side.margin.again:
                at = half + side.sign * half * side.share_of(again)
                shape += element("circle", cx=at, cy=y + BAR / 2, r=3.0, fill="none", stroke=INK)
            parts.append(titled(shape, side_title(side)))
    parts.append(element("line", x1=half, x2=half, y1=0.0, y2=height, stroke=INK))
    return picture(2 * half, height, parts, f"margins of {label(sides[0].axis)}")


def side_title(side: Side) -> str:
    """One side in words: what it holds, where and how it falls, whether survival comes back."""
    m, unit = side.margin, side.unit
    words = f"{side.controller}: "
    words += "falls at the nominal value" if m.value is None else f"holds {m.value:.4g} {unit}"
    words += "" if m.fell_at is None else f"; falls at {m.fell_at:.4g} {unit}: {m.reason}"
    if m.again:
        words += f"; survives again at {', '.join(f'{value:.4g}' for value in m.again)} {unit}"
    return words


def cause_bars(falls: Mapping[str, Mapping[str, int]], title: str) -> str:
    """What broke, a bar for each controller, as long as it has falls.

    Args:
        falls: Number of falls by controller and by cause (the value of a `sim.trials.falls.cause.Cause`).
        title: What the falls are those of.
    """
    left, width = 90.0, 560.0
    most = max((sum(counts.values()) for counts in falls.values()), default=0) or 1
    order = list(CAUSE_COLOURS)
    parts = []
    for row, (controller, counts) in enumerate(falls.items()):
        y, x = 4.0 + 24.0 * row, left
        parts.append(text(left - 6, y + 12, controller, text_anchor="end"))
        for place, cause in sorted((order.index(cause.split(":")[0]), cause) for cause in counts):
            part, colour = width * counts[cause] / most, CAUSE_COLOURS[order[place]]
            shape = element("rect", x=x, y=y, width=max(0.5, part - 1), height=16.0, fill=colour)
            if part > 18:
                shape += text(x + part / 2, y + 12, str(counts[cause]), text_anchor="middle", fill="#fff")
            parts.append(titled(shape, f"{controller}: {counts[cause]} falls, {cause}"))
            x += part
        parts.append(text(x + 8, y + 12, f"{sum(counts.values())} falls", fill=GREY))
    return picture(left + width + 80, 8 + 24 * len(falls), parts, f"what breaks, {title}")


def paired_bars(found: RandomFindings) -> str:
    """Draws that only one of two survives: to the left the reference, to the right the other."""
    left, half = 90.0, 170.0
    middle = left + half + 40
    most = max((max(pair.first, pair.second) for pair in found.pairs.values()), default=0) or 1
    names = list(found.results)
    parts = [
        text(middle - 4, 11, f"only {found.reference} survives", fill=GREY, font_size=10, text_anchor="end"),
        text(middle + 4, 11, "only it survives", fill=GREY, font_size=10),
    ]
    for row, (other, pair) in enumerate(found.pairs.items()):
        y = 18.0 + 24 * row
        parts.append(text(left - 6, y + 12, other, text_anchor="end"))
        for value, sign, colour in (
            (pair.first, -1, COLOURS[0]),
            (pair.second, 1, COLOURS[names.index(other) % len(COLOURS)]),
        ):
            width = half * value / most
            parts.append(element("rect", x=middle - width * (sign < 0), y=y, width=width, height=16.0, fill=colour))
            at, anchor = middle + sign * (width + 5), "start" if sign > 0 else "end"
            parts.append(text(at, y + 12, str(value), text_anchor=anchor))
    bottom = 20.0 + 24 * len(found.pairs)
    parts.append(element("line", x1=middle, x2=middle, y1=15.0, y2=bottom, stroke=INK))
    return picture(middle + half + 40, bottom + 2, parts, f"draws that only one survives, against {found.reference}")


def grid_map(axes: Sequence[GridAxis], rows: Mapping[int, TrialResult], title: str) -> str:
    """One or two axes of a grid: a cell a trial, green where it survived, with the steps where it fell.

    Args:
        axes: The axis upwards, if there are two, and the axis to the right.
        rows: Results by index within this picture.
        title: Heading.
    """
    across = axes[-1].points
    up: tuple[Value, ...] = axes[0].points if len(axes) == 2 else ("",)
    cell, left, top = max(16.0, min(44.0, 420.0 / len(across))), 76.0, 24.0
    height = top + cell * len(up) + 40
    parts = [text(left, 14, title, font_weight=600)]
    for i, row_value in enumerate(up):
        y = top + cell * (len(up) - 1 - i)
        parts.append(text(left - 6, y + cell / 2 + 4, _value(row_value), text_anchor="end"))
        for j, column_value in enumerate(across):
            found = rows.get(i * len(across) + j)
            if found is None:
                continue
            box = element(
                "rect",
                x=left + j * cell + 1,
                y=y + 1,
                width=cell - 2,
                height=cell - 2,
                rx=2,
                fill=SURVIVED if found.survived else GREY if found.outcome == "error" else FELL,
                fill_opacity=1.0 if found.survived else 0.35 + 0.5 / (1 + found.steps),
            )
            inside = (
                ""
                if found.survived
                else text(
                    left + (j + 0.5) * cell, y + cell / 2 + 4, str(found.steps), text_anchor="middle", font_size=9
                )
            )
            words = f"{_value(row_value)} {_value(column_value)}: {found.why or 'survived'}"
            parts.append(titled(box + inside, words.strip()))
    every = max(1, math.ceil(len(across) * 34 / (cell * len(across))))
    for j, column_value in enumerate(across):
        if j % every == 0:
            parts.append(text(left + (j + 0.5) * cell, height - 24, _value(column_value), text_anchor="middle"))
    parts.append(text(left + cell * len(across) / 2, height - 8, label(axes[-1]), text_anchor="middle", fill=GREY))
    return picture(left + cell * len(across) + 30, height, parts, title)


def _value(value: Value) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def rate_bars(found: RandomFindings) -> str:
    """Survival of each controller with its 95 % interval."""
    width, left, rows = 360.0, 90.0, len(found.rates)
    parts = []
    for row, rate in enumerate(found.rates):
        y = 4.0 + row * 24
        share = rate.survived / rate.trials
        low, high = (left + width * end for end in rate.interval)
        middle = y + 8
        parts += [
            text(left - 6, y + 12, rate.controller, text_anchor="end"),
            element("rect", x=left, y=y, width=width, height=16, fill=LIGHT),
            element("rect", x=left, y=y, width=width * share, height=16, fill=COLOURS[row % len(COLOURS)]),
            element("line", x1=low, x2=high, y1=middle, y2=middle, stroke=INK, stroke_width=1.5),
            *(element("line", x1=x, x2=x, y1=y + 3, y2=y + 13, stroke=INK, stroke_width=1.5) for x in (low, high)),
            text(left + width + 8, y + 12, f"{100 * share:.1f} % of {rate.trials}"),
        ]
    return picture(left + width + 130, 8.0 + 24 * rows, parts, "survival rate with 95 % interval")


def attribution_bars(found: Sequence[Attribution], colour: str, most: int = 14) -> str:
    """Rank correlations of the axes with survival, strongest first: solid of the value, pale of the distance."""
    left, half = 230.0, 110.0
    middle = left + half
    parts = [
        text(middle - half, 11, "less survives", fill=GREY, font_size=10),
        text(middle + half, 11, "more survives", fill=GREY, font_size=10, text_anchor="end"),
    ]
    shown = found[:most]
    for row, one in enumerate(shown):
        y = 18.0 + row * 17
        parts.append(text(left - 6, y + 10, one.axis, text_anchor="end"))
        for value, top, opacity in ((one.value, y, 1.0), (one.deviation, y + 7, 0.45)):
            x, width = (middle, half * value) if value > 0 else (middle + half * value, -half * value)
            parts.append(element("rect", x=x, y=top, width=width, height=6, fill=colour, fill_opacity=opacity))
        parts.append(text(middle + half + 6, y + 10, f"p = {one.p:.1g}", fill=GREY))
    bottom = 20.0 + 17 * len(shown)
    parts.append(element("line", x1=middle, x2=middle, y1=16.0, y2=bottom, stroke=INK))
    return picture(left + 2 * half + 80, bottom + 2, parts, "rank correlation of each axis with survival")


def survival_curve(axis: str, unit: str, rows: Mapping[str, Sequence[TrialResult]], bins: int = 8) -> str:
    """Share of survivors along one axis, in bins of equal numbers, with 95 % intervals."""
    values = sorted(float(row.axis_values[axis]) for found in rows.values() for row in found)
    lowest, highest = values[0], values[-1]
    span = (highest - lowest) or 1.0
    left, top, width, height = 34.0, 20.0, 190.0, 100.0
    parts = [text(left, 12, f"{axis}", font_weight=600)]
    for share in (0.0, 0.5, 1.0):
        y = top + height * (1 - share)
        parts.append(element("line", x1=left, x2=left + width, y1=y, y2=y, stroke=LIGHT))
        parts.append(text(left - 4, y + 4, f"{100 * share:.0f}", text_anchor="end", font_size=9, fill=GREY))
    for number, found in enumerate(rows.values()):
        colour = COLOURS[number % len(COLOURS)]
        ordered = sorted(found, key=lambda row: float(row.axis_values[axis]))
        size = max(1, math.ceil(len(ordered) / bins))
        points = []
        for k in range(0, len(ordered), size):
            part = ordered[k : k + size]
            survived = sum(row.survived for row in part)
            mean = sum(float(row.axis_values[axis]) for row in part) / len(part)
            low, high = wilson(survived, len(part))
            x, y = left + width * (mean - lowest) / span, top + height * (1 - survived / len(part))
            points.append(f"{x:.1f},{y:.1f}")
            ends = (top + height * (1 - high), top + height * (1 - low))
            parts.append(element("line", x1=x, x2=x, y1=ends[0], y2=ends[1], stroke=colour, stroke_opacity=0.35))
            parts.append(element("circle", cx=x, cy=y, r=2.5, fill=colour))
        parts.append(element("polyline", points=" ".join(points), fill="none", stroke=colour, stroke_width=1.5))
    bottom = top + height + 14
    parts.append(text(left, bottom, f"{lowest:.3g}", font_size=9, fill=GREY))
    parts.append(text(left + width, bottom, f"{highest:.3g} {unit}", font_size=9, fill=GREY, text_anchor="end"))
    return picture(left + width + 14, bottom + 6, parts, f"survival along {axis}")
