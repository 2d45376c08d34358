"""Panels by matplotlib: a PNG good enough for a talk."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim.errors import UserError
from sim.reproduce.panels import GREY, LinePanel, MapPanel, Panel

WIDTH, HEIGHT = 5.2, 3.1  # [inch] of a panel
DPI = 160


def require() -> None:
    """See that matplotlib is there.

    Raises:
        UserError: it is not; says how to install it.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise UserError("figures need matplotlib, which is missing; pip install 'cmpc-walker[plots]'") from error


def draw(rows: Sequence[Sequence[Panel]], title: str, path: Path) -> None:
    """Write a figure as PNG.

    Args:
        rows: Panels, row by row.
        title: Above all of them.
        path: The file to write.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = max(len(row) for row in rows)
    height = 4.2 if any(isinstance(panel, MapPanel) for row in rows for panel in row) else HEIGHT
    style: dict[Any, Any] = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 10}
    with rc_context(style):
        figure = Figure(figsize=(WIDTH * columns, height * len(rows) + 0.6), layout="constrained")
        FigureCanvasAgg(figure)
        figure.suptitle(title, fontsize=12, fontweight="bold")
        axes = figure.subplots(len(rows), columns, squeeze=False)
        for row, panels in enumerate(rows):
            for column in range(columns):
                ax = axes[row][column]
                if column >= len(panels):
                    ax.set_axis_off()
                    continue
                panel = panels[column]
                if isinstance(panel, LinePanel):
                    _lines(ax, panel, legend=row == 0 and column == 0)
                else:
                    _map(ax, panel, legend=row == 0 and column == 0)
        # Without the software's version and a date the same numbers make the same bytes.
        figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _lines(ax: Any, panel: LinePanel, *, legend: bool) -> None:
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
                (1.0, level.y),
                xycoords=("axes fraction", "data"),
                ha="right",
                va="bottom",
                color="#55554f",
                fontsize=8,
            )
    for series in panel.series:
        ax.plot(
            series.x,
            series.y,
            label=series.name or None,
            color=series.colour,
            linewidth=series.width,
            linestyle={"solid": "-", "dashed": "--", "dotted": ":"}[series.dash],
            marker="o" if series.marker else None,
            markersize=4,
        )
    if panel.log_x:
        ax.set_xscale("log")
    if panel.y_range:
        ax.set_ylim(*panel.y_range)
    if panel.equal:
        ax.set_aspect("equal", adjustable="box")
    ax.set_title(panel.title)
    ax.set_xlabel(panel.x_label)
    ax.set_ylabel(panel.y_label)
    if legend and any(series.name for series in panel.series):
        ax.legend(frameon=False, fontsize=8, ncols=2, loc="best")


def _map(ax: Any, panel: MapPanel, *, legend: bool) -> None:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    x, y = (_edges(values) for values in (panel.x, panel.y))
    ax.pcolormesh(x, y, panel.classes, cmap=ListedColormap(list(panel.colours)), vmin=-0.5, vmax=len(panel.names) - 0.5)
    ax.axhline(0.0, color="#55554f", linewidth=0.6)
    ax.axvline(0.0, color="#55554f", linewidth=0.6)
    ax.set_title(panel.title)
    ax.set_xlabel(panel.x_label)
    ax.set_ylabel(panel.y_label)
    if legend:
        handles = [
            Patch(facecolor=colour, edgecolor="#55554f", label=name)
            for name, colour in zip(panel.names, panel.colours, strict=True)
        ]
        ax.legend(handles=handles, frameon=True, fontsize=8, loc="lower right")


def _edges(centres: Any) -> Any:
    """Borders of the cells around evenly spaced centres."""
    half = 0.5 * (centres[1] - centres[0])
    return np.append(centres - half, centres[-1] + half)
