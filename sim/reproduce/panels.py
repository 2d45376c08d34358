"""What a figure shows, said once: drawn by matplotlib (`draw.py`) and by the page's script (`panels.js`)."""

import dataclasses
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.pages.palette import BLACK, BLUE, GREY, ORANGE

JOINT_STYLES = ((BLUE, "solid"), (ORANGE, "solid"), (BLACK, "dashed"), (GREY, "dashed"))
"""Colour and dash of the four joints: told apart in greyscale by dash and brightness."""

CONTROLLER_STYLES = {"zd-pd": (ORANGE, "dashed"), "c-mpc": (BLUE, "solid")}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Series:
    """A line, or markers.

    Attributes:
        name: Name in the legend; empty for none.
        x: Values along x, (n,).
        y: Values along y, (n,); NaN breaks the line.
        colour: "#rrggbb".
        dash: "solid", "dashed" or "dotted".
        width: Line width in points.
        marker: Whether to mark the points.
    """

    name: str
    x: NDArray[Any]
    y: NDArray[Any]
    colour: str = BLACK
    dash: str = "solid"
    width: float = 1.3
    marker: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """A horizontal line: a limit, or the paper's value."""

    y: float
    name: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """A shaded stretch of x: a push."""

    x0: float
    x1: float
    name: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinePanel:
    """Lines over a common x axis.

    Attributes:
        title: Above the panel.
        x_label: With unit.
        y_label: With unit.
        series: The lines.
        levels: Horizontal lines.
        spans: Shaded stretches.
        equal: Whether both axes have the same scale.
        log_x: Whether x is logarithmic.
        y_range: Limits of y, None to fit.
    """

    title: str
    x_label: str
    y_label: str
    series: Sequence[Series]
    levels: Sequence[Level] = ()
    spans: Sequence[Span] = ()
    equal: bool = False
    log_x: bool = False
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """A part of a map.

    Attributes:
        name: Name in the legend.
        inside: Which points belong to it, (n, m).
        colour: Of its outline.
        dash: "solid", "dashed" or "dotted".
    """

    name: str
    inside: NDArray[Any]
    colour: str
    dash: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapPanel:
    """Classes over a grid, with boundaries.

    Attributes:
        title: Above the panel.
        x_label: With unit.
        y_label: With unit.
        x: Columns, (m,).
        y: Rows, (n,).
        classes: Index into `names`, (n, m).
        names: Names of the classes.
        colours: Their colours, light to dark.
        regions: Whose outlines are drawn.
    """

    title: str
    x_label: str
    y_label: str
    x: NDArray[Any]
    y: NDArray[Any]
    classes: NDArray[Any]
    names: Sequence[str]
    colours: Sequence[str]
    regions: Sequence[Region] = ()


Panel = LinePanel | MapPanel


def same_scale(row: Sequence[LinePanel], most: float = np.inf) -> tuple[LinePanel, ...]:
    """The panels with one symmetric y range, so that they compare by eye; `most` bounds it, and cuts off a fall."""
    values = np.concatenate([series.y for panel in row for series in panel.series])
    bound = 1.08 * float(min(np.nanmax(np.abs(values)), most))
    return tuple(dataclasses.replace(panel, y_range=(-bound, bound)) for panel in row)


def thinned(x: NDArray[Any], y: NDArray[Any], most: int = 1200) -> tuple[NDArray[Any], NDArray[Any]]:
    """At most `most` points of a line that keep every peak: the least and the greatest of each bucket."""
    if len(x) <= most:
        return x, y
    edges = np.linspace(0, len(x), most // 2 + 1).astype(int)
    keep = {0, len(x) - 1}
    for first, last in itertools.pairwise(edges.tolist()):
        piece = y[first:last]
        if np.isfinite(piece).any():
            keep |= {first + int(np.nanargmin(piece)), first + int(np.nanargmax(piece))}
        else:
            keep.add(int(first))
    index = np.array(sorted(keep))
    return x[index], y[index]
