"""Panels by matplotlib: a PNG good enough for a talk."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim.errors import UserError
from sim.reproduce.panels import GREY, LinePanel, MapPanel, Panel

WIDTH, HEIGHT = 5.2, 3.1  # [inch] of a panel
LETTERS = 13.0  # of a legend in an inch
DPI = 160


def draw(rows: Sequence[Sequence[Panel]], title: str, path: Path) -> None:
    """Write a figure as PNG.

    Args:
        rows: Panels, row by row.
        title: Above all of them.
        path: The file to write.

    Raises:
        UserError: it cannot be written.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = max(len(row) for row in rows)
    panels = [panel for row in rows for panel in row]
    width, height = WIDTH, HEIGHT
    if any(isinstance(panel, MapPanel) for panel in panels):
        height = 4.2
    if any(isinstance(panel, LinePanel) and panel.equal for panel in panels):
        width = 2.6
    style: dict[Any, Any] = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 10}
    with rc_context(style):
        figure = Figure(figsize=(width * columns, height * len(rows) + 0.8), layout="constrained")
        FigureCanvasAgg(figure)
        figure.suptitle(title, fontsize=12, fontweight="bold")
        axes = figure.subplots(len(rows), columns, squeeze=False)
        named: dict[str, Any] = {}  # one legend for all panels
        for row, members in enumerate(rows):
            for column in range(columns):
                ax = axes[row][column]
                if column >= len(members):
                    ax.set_axis_off()
                    continue
                panel = members[column]
                handles = _lines(ax, panel) if isinstance(panel, LinePanel) else _map(ax, panel)
                named = {**{handle.get_label(): handle for handle in handles}, **named}
        if named:
            fitting = int(width * columns * LETTERS / (6 + max(map(len, named)))) or 1
            figure.legend(
                handles=list(named.values()),
                loc="outside lower center",
                ncols=min(len(named), fitting),
                frameon=False,
                fontsize=9,
            )
        # Without the software's version and a date the same numbers make the same bytes.
        try:
            figure.savefig(path, dpi=DPI, metadata={"Software": None})
        except OSError as error:
            raise UserError(f"{path}: cannot be written: {error.strerror}") from error


def _lines(ax: Any, panel: LinePanel) -> list[Any]:
    """Draw; returns what belongs into the legend."""
    from matplotlib.ticker import LogLocator, NullFormatter

    for span in panel.spans:
        ax.axvspan(span.x0, span.x1, color="#e6e6e0", zorder=0, linewidth=0)
        ax.annotate(
            span.name,
            (0.5 * (span.x0 + span.x1), 1.0),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="top",
            color="#55554f",
            fontsize=8,
        )
    for level in panel.levels:
        ax.axhline(level.y, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
        if level.name:
            ax.annotate(
                level.name,
                (1.01, level.y),
                xycoords=("axes fraction", "data"),
                ha="left",
                va="center",
                annotation_clip=False,
                color="#55554f",
                fontsize=8,
            )
    handles = []
    for series in panel.series:
        (line,) = ax.plot(
            series.x,
            series.y,
            label=series.name or "_",
            color=series.colour,
            linewidth=series.width,
            linestyle={"solid": "-", "dashed": "--", "dotted": ":"}[series.dash],
            marker="o" if series.marker else None,
            markersize=4,
        )
        if series.name:
            handles.append(line)
    if panel.log_x:
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter(NullFormatter())
    if panel.y_range:
        ax.set_ylim(*panel.y_range)
    if panel.equal:
        ax.set_aspect("equal", adjustable="box")
    ax.set_title(panel.title)
    ax.set_xlabel(panel.x_label)
    ax.set_ylabel(panel.y_label)
    return handles


def _map(ax: Any, panel: MapPanel) -> list[Any]:
    """Draw; returns what belongs into the legend."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    x, y = (_edges(values) for values in (panel.x, panel.y))
    top = len(panel.names) - 0.5
    ax.pcolormesh(x, y, panel.classes, cmap=ListedColormap(list(panel.colours)), vmin=-0.5, vmax=top)
    for region in panel.regions:
        lines = LineCollection(
            _outline(region.inside, x, y),
            colors=region.colour,
            linewidths=2.2,
            linestyles=region.dash,
            label=region.name,
        )
        ax.add_collection(lines)
    if panel.regions:
        ax.legend(frameon=True, fontsize=8, loc="upper left")
    ax.axhline(0.0, color="#55554f", linewidth=0.6)
    ax.axvline(0.0, color="#55554f", linewidth=0.6)
    ax.set_title(panel.title)
    ax.set_xlabel(panel.x_label)
    ax.set_ylabel(panel.y_label)
    return [
        Patch(facecolor=colour, edgecolor="#55554f", label=name)
        for name, colour in zip(panel.names, panel.colours, strict=True)
    ]


def _outline(inside: Any, x: Any, y: Any) -> list[list[tuple[float, float]]]:
    """Borders between cells inside and outside a region, as line segments."""
    padded = np.pad(inside, 1)
    upright = padded[1:-1, 1:] != padded[1:-1, :-1]  # (n, m + 1), between columns
    level = padded[1:, 1:-1] != padded[:-1, 1:-1]  # (n + 1, m), between rows
    segments = [[(x[j], y[i]), (x[j], y[i + 1])] for i, j in np.argwhere(upright)]
    return segments + [[(x[j], y[i]), (x[j + 1], y[i])] for i, j in np.argwhere(level)]


def _edges(centres: Any) -> Any:
    """Borders of the cells around evenly spaced centres."""
    half = 0.5 * (centres[1] - centres[0])
    return np.append(centres - half, centres[-1] + half)
