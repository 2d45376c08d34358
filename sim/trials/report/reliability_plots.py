"""Pictures of a study of the nearest fall: planes of two axes, importance, the fragility curve."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sim.pages.palette import GREY, colour
from sim.pages.picture import INK, picture
from sim.trials.reliability.procedure import RADII
from sim.trials.report.reliability_findings import LEAST, Reliability

MARKERS = {"o": "●", "s": "■", "D": "◆", "^": "▲", "v": "▼", "P": "✚", "X": "✖", "*": "★"}
"""Of controllers, in the plan's order, and as text."""
BESIDE = 0.012  # between the intervals of neighbouring controllers, of all spreads

if TYPE_CHECKING:
    from markupsafe import Markup


def plane(names: tuple[str, str], each: Sequence[Reliability], number: int) -> "Markup":
    """Distance of the first fall all around in the plane of two axes, in standard deviations; open where none fell."""
    edge = RADII[-1]
    with picture(f"nearest fall in the plane of {names[0]} and {names[1]}", 260, 270) as made:
        axes = made.axes
        turn = np.linspace(0.0, 2.0 * np.pi, 100)
        for ring in range(1, int(edge) + 1):
            axes.plot(ring * np.cos(turn), ring * np.sin(turn), color=GREY, linewidth=0.4)
        for place, one in enumerate(each):
            beta = one.found.planes[number]
            angle = 2.0 * np.pi * np.arange(len(beta) + 1) / len(beta)
            r = np.array([*beta, beta[0]])
            r[~np.isfinite(r)] = math.nan
            line = axes.plot(r * np.cos(angle), r * np.sin(angle), _style(place), color=colour(place), markersize=3)[0]
            made.title(line, one.controller)
        axes.plot(0.0, 0.0, "+", color=INK)
        axes.set(xlim=(-edge, edge), ylim=(-edge, edge), aspect="equal")
        axes.set(xlabel=f"{names[0]} [deviations]", ylabel=f"{names[1]} [deviations]")
        axes.set_xticks(range(-int(edge), int(edge) + 1))
        axes.set_yticks(range(-int(edge), int(edge) + 1))
    return made.svg


def importance_bars(names: Sequence[str], one: Reliability, shade: str, most: int = 8) -> "Markup":
    """Share of each axis in the squared distance of the nearest fall, with its deviations and the direction."""
    side = one.sides[0]
    order = [k for k in np.argsort(-side.importance)[:most] if side.importance[k] >= LEAST]
    with picture(f"importance of each axis, {one.controller}", 560, 20 + 18 * len(order), bare=True) as made:
        for row, k in enumerate(order):
            share, deviations = float(side.importance[k]), float(side.mode.outside[k])
            made.axes.barh(row, share, 0.7, color=shade)
            words = f"{100.0 * share:.0f} %, {deviations:+.2f} deviations"
            made.axes.annotate(words, (share, row), (5, 0), textcoords="offset points", va="center", color=INK)
        made.axes.set_yticks(range(len(order)), [names[k] for k in order])
        made.axes.set(xlim=(0.0, 1.4), ylim=(len(order) - 0.4, -0.6))
    return made.svg


def fragility(each: Sequence[Reliability]) -> "Markup":
    """Probability of a fall against the scale of all spreads, with 95 % intervals."""
    with picture("probability of a fall against the scale of all spreads", 420, 230) as made:
        for place, one in enumerate(each):
            scale = [scale + BESIDE * (place - 0.5 * (len(each) - 1)) for scale, _, _, _ in one.scales]
            share = [falls / max(known, 1) for _, falls, known, _ in one.scales]
            low, high = zip(*(interval for *_, interval in one.scales), strict=True)
            made.axes.vlines(scale, low, high, color=colour(place), alpha=0.4)
            line = made.axes.plot(scale, share, _style(place), color=colour(place), markersize=3.5)[0]
            made.title(line, one.controller)
        ticks = sorted({scale for one in each for scale, _, _, _ in one.scales})
        made.axes.set_xticks(ticks, [f"{scale:g}" for scale in ticks])
        made.axes.set(
            ylim=(-0.02, 1.02), xlabel="all spreads [times those of the plan]", ylabel="share of walks that fall"
        )
        made.axes.grid(axis="y")
    return made.svg


def _style(place: int) -> str:
    """Marker and line of the controller at a place in the plan."""
    return f"{_marker(place)[0]}-"


def key(place: int, controller: str) -> tuple[str, str]:
    """Colour, and marker and name, of the controller at a place in the plan."""
    return colour(place), f"{_marker(place)[1]} {controller}"


def _marker(place: int) -> tuple[str, str]:
    return list(MARKERS.items())[place % len(MARKERS)]
