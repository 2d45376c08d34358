"""Pictures as SVG text: a few marks, no library, readable on paper."""

import html
from collections.abc import Sequence

COLOURS = ("#1f6fb2", "#d9722a", "#2f9e6e", "#8a5fbf", "#b8962e", "#c2608f")
"""Of the controllers, in the plan's order."""

GREY, LIGHT, INK = "#9aa1a9", "#eef0f2", "#22272d"
FELL, SURVIVED = "#c8442f", "#3d9a63"


def element(name: str, text: str = "", **attributes: object) -> str:
    """One SVG element; "_" in attribute names stands for "-"."""
    words = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{html.escape(_shown(value))}"' for key, value in attributes.items()
    )
    return f"<{name}{words}>{text}</{name}>" if text else f"<{name}{words}/>"


def _shown(value: object) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)


def label(x: float, y: float, text: str, **attributes: object) -> str:
    """Text at a point; the first line's baseline is at y."""
    style: dict[str, object] = {"font_size": 11, "fill": INK} | attributes
    return element("text", html.escape(text), x=x, y=y, **style)


def titled(shape: str, title: str) -> str:
    """A shape that tells more when the mouse rests on it."""
    return f"<g>{element('title', html.escape(title))}{shape}</g>"


def picture(width: float, height: float, parts: Sequence[str], description: str) -> str:
    """A whole picture, with a description for those who cannot see it."""
    return element(
        "svg",
        element("title", html.escape(description)) + "".join(parts),
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {width:g} {height:g}",
        width=width,
        height=height,
        role="img",
        font_family="system-ui, sans-serif",
    )
