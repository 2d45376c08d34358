"""The page settings.md of the site: every setting of a scenario and of a plan, from the settings themselves."""

from collections.abc import Iterator
from dataclasses import MISSING
from typing import Any

from sim.scenario import Scenario
from sim.settings.spec import Spec, specs
from sim.trials.plan import Plan

HEAD = """\
# Every setting

A key of a scenario file, a flag by the same dotted path (`--plant.ground.slope 0.05`), and an axis of trials: three
ways to say one thing. This page is made from the settings themselves; [scenarios.md](scenarios.md) says how files are
put together.
"""
PLAN = """
## Plans

Beside these a plan has a table `[scenario]` with all of the above.
"""


def page() -> str:
    """The page."""
    return "\n".join([HEAD, "## Scenarios", *_table(Scenario, ""), PLAN, *_table(Plan, "", ("scenario",))]) + "\n"


def _table(cls: Any, path: str, without: tuple[str, ...] = ()) -> Iterator[str]:
    rows = {name: spec for name, spec in specs(cls).items() if name not in without}
    leaves = {name: spec for name, spec in rows.items() if not spec.is_table}
    if leaves:
        yield from ("", "| key | unit | default | must be | what |", "|---|---|---|---|---|")
    for name, spec in leaves.items():
        yield "| " + " | ".join([f"`{name}`", *map(_cell, (spec.unit, _default(spec), _legal(spec), spec.help))]) + " |"
    for name, spec in rows.items():
        if spec.is_table:
            here = f"{path}.{name}" if path else name
            yield f"\n### `{f'[[{here}]]' if spec.repeated else f'[{here}]'}`\n"
            yield spec.help
            yield from _table(spec.type, here)


def _default(spec: Spec) -> str:
    value = spec.default
    if value is MISSING:
        return "must be given"
    if isinstance(value, tuple):
        return ", ".join(f"{item:g}" if isinstance(item, float) else str(item) for item in value) or "none"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else "none" if value is None else str(value) or '""'


def _legal(spec: Spec) -> str:
    return spec.legal.replace(f" [{spec.unit}]", "") if spec.unit else spec.legal


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
