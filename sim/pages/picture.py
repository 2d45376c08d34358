"""Pictures by matplotlib as SVG for a page: ink follows light and dark, the same numbers make the same bytes."""

import io
import re
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.axes import Axes

INK = "#123456"  # stands for the page's ink until the SVG is written

STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.alpha": 0.25,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "cmpc",
    **{name: INK for name in ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color")},
}


class Picture:
    """One plot.

    Attributes:
        axes: Where to draw.
        svg: The SVG, once the context of `picture` is left.
    """

    axes: "Axes"
    svg: "Markup"

    def __init__(self) -> None:
        self._titles: dict[str, str] = {}

    def title(self, artist: Any, words: str) -> None:
        """Words shown when the mouse rests on an artist."""
        artist.set_gid(f"t{len(self._titles)}")
        self._titles[artist.get_gid()] = words


@contextmanager
def picture(
    description: str, width: float, height: float, *, bare: bool = False, full: bool = False
) -> Iterator[Picture]:
    """A picture to draw on while the context lasts.

    Args:
        description: For those who cannot see it, and its file's name.
        width: In pixels.
        height: In pixels.
        bare: Whether to leave frame and ticks out; names may stand on the left.
        full: Whether the axes fill the picture, without room for names.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    made = Picture()
    with rc_context(STYLE):
        figure = Figure(figsize=(width / 72, height / 72), layout=None if full else "constrained")
        FigureCanvasSVG(figure)
        made.axes = figure.add_axes((0.0, 0.0, 1.0, 1.0)) if full else figure.add_subplot()
        if bare or full:
            made.axes.spines[:].set_visible(False)
            made.axes.tick_params(length=0)
            made.axes.set_xticks([])
        yield made
        made.svg = _svg(figure, description, made._titles)


def _svg(figure: Any, description: str, titles: Mapping[str, str]) -> "Markup":
    from markupsafe import Markup, escape
    from matplotlib.text import Text

    text = io.StringIO()
    empty: dict[str, Any] = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    for words in figure.findobj(Text):
        words.set_text("".join(c if c.isprintable() or c == "\n" else " " for c in words.get_text()))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font", UserWarning)  # shown as a box
        figure.savefig(text, format="svg", transparent=True, metadata=empty)
    out = text.getvalue()[text.getvalue().index("<svg") :].replace(INK, "currentColor")
    out = re.sub(r"<metadata>.*?</metadata>", "", out, flags=re.DOTALL)
    out = re.sub(r"(<svg[^>]*?)>", rf"\1 role='img'><title>{escape(description)}</title>", out, count=1)
    out = re.sub(r'<g id="(t\d+)">', lambda found: f"<g><title>{escape(titles[found[1]])}</title>", out)
    # names inside a picture must be the only ones of a page with many
    mark = format(zlib.crc32(out.encode()), "x")
    out = re.sub(r'(id="|url\(#|href="#)', rf"\g<1>{mark}-", out)
    return Markup(out)
