"""Pages from templates: everything that is not markup of a template is escaped, nothing is fetched."""

import functools
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

HERE = Path(__file__).parent


def number(value: Any) -> str:
    """A figure in four digits; other values as they are."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def render(template: str, **values: Any) -> str:
    """A page.

    Args:
        template: Name of a file in `templates/`.
        values: What the template asks for.
    """
    return _environment().get_template(template).render(**values)


def link(href: str, text: str) -> "Markup":
    """A link for a cell of a table."""
    from markupsafe import Markup, escape

    return Markup(f'<a href="{escape(href)}">{escape(text)}</a>')


@functools.cache
def _environment() -> "Environment":
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    made = Environment(
        loader=FileSystemLoader(HERE / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"number": number, "json": _json}
    made.globals["asset"] = _asset
    return made


def _asset(name: str) -> "Markup":
    """A style sheet or script of ours, as it is."""
    from markupsafe import Markup

    return Markup((HERE / name).read_text(encoding="utf-8"))


def _json(value: Any) -> "Markup":
    """Data for a script element, which nothing in it can end; what is not finite becomes null."""
    from markupsafe import Markup

    text = json.dumps(_finite(value), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029"))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
