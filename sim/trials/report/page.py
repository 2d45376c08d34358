"""What every page of a campaign shares: the document around it, its style, numbers and keys."""

import html

from sim.trials.plan.axis import Value
from sim.trials.report.svg import COLOURS, INK, LIGHT

_PICTURES = f"""
svg [fill="{INK}"], svg text:not([fill]) {{ fill: #dfe3e8; }} svg [stroke="{INK}"] {{ stroke: #dfe3e8; }}
svg [fill="{LIGHT}"] {{ fill: #2c3239; }} svg [stroke="{LIGHT}"] {{ stroke: #2c3239; }}
"""

STYLE = f"""
:root {{ color-scheme: light dark;
  --ink: #22272d; --paper: #fff; --line: #dde1e5; --muted: #667079; --block: #f6f7f8; }}
@media (prefers-color-scheme: dark) {{
  :root {{ --ink: #dfe3e8; --paper: #16191d; --line: #363d45; --muted: #98a1ab; --block: #1f2429; }}
  {_PICTURES}
}}
body {{ font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 1240px; margin: 2rem auto; padding: 0 1rem; }}
h1 {{ font-size: 1.6rem; margin-bottom: 0; }}
h2 {{ margin-top: 2.5rem; border-bottom: 1px solid var(--line); }}
a {{ color: inherit; }}
.wide {{ overflow-x: auto; }}
table {{ border-collapse: collapse; font-size: 13px; margin: 1rem 0; }} .wide table {{ width: 100%; }}
th {{ text-align: left; border-bottom: 1px solid var(--muted); padding: 4px 8px; vertical-align: bottom; }}
td {{ border-bottom: 1px solid var(--line); padding: 3px 8px; vertical-align: middle; }}
td.number, th.number {{ text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }}
td.picture {{ min-width: 200px; }}
svg {{ vertical-align: middle; max-width: 100%; height: auto; margin: 2px 6px 2px 0; }}
.muted {{ color: var(--muted); }} code {{ font-size: 12px; }}
.key {{ display: inline-block; width: 12px; height: 12px; margin: 0 5px 0 0;
  border-radius: 2px; vertical-align: -1px; }}
.keys span {{ white-space: nowrap; margin-right: 14px; }}
.lead {{ font-size: 16px; }} details {{ margin: 1rem 0; }}
pre {{ font-size: 12px; overflow: auto; background: var(--block); padding: 1rem; }}
"""


def document(title: str, body: str) -> str:
    """A whole page."""
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>\n'
        f"<body>\n{body}\n</body></html>\n"
    )


def key(colour: str, text: str) -> str:
    """A patch of a colour and what it stands for."""
    return f'<span><span class=key style="background:{colour}"></span>{html.escape(text)}</span>'


def controller_colour(number: int) -> str:
    """Colour of a controller by its place in the plan."""
    return COLOURS[number % len(COLOURS)]


def number(value: Value) -> str:
    """A value of an axis in words."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
