"""A tree of settings as a TOML file to start from: every setting with its help, unit and legal values.

A line that begins with `#key` holds the default and can be switched on; one that begins with `# ` is for reading.
"""

import textwrap
from collections.abc import Callable, Iterator
from dataclasses import MISSING
from typing import Any

from sim.settings.spec import Spec, specs
from sim.settings.tree import Setting, join, toml_line

WIDTH = 110


def commented(tree: Any, live: Callable[[str], bool], *, without: Callable[[str], bool] = lambda path: False) -> str:
    """The file; it reads back as the tree, and so it does with every default switched on.

    Args:
        tree: Settings.
        live: Whether a setting that has its default is switched on, by its dotted path.
        without: Whether a table is left out, which must hold defaults alone.
    """
    return "\n".join(_table(tree, "", live, without)).strip() + "\n"


def about(spec: Spec) -> str:
    """What a setting is and what it may be, in a sentence or two."""
    legal = "" if spec.type is bool else f" Must be {spec.legal}."
    return f"{spec.help.rstrip('. ')}.{legal}" if spec.help else legal.strip()


def _table(tree: Any, path: str, live: Any, without: Any) -> Iterator[str]:
    rows = specs(type(tree))
    leaves = {name: spec for name, spec in rows.items() if not spec.is_table}
    alike = len({(spec.legal, str(spec.default)) for spec in leaves.values()}) == 1 < len(leaves)
    for name, spec in leaves.items():
        value, here = getattr(tree, name), join(path, name)
        if not alike:
            yield from _words(about(spec))
        off = value is not None and value == spec.default and not live(here)
        yield "#" * off + _line(name, value, spec)
    if alike:
        yield from _words(f"Each must be {next(iter(leaves.values())).legal}.")
    for name, spec in rows.items():
        here, value = join(path, name), getattr(tree, name)
        if not spec.is_table or without(here):
            continue
        yield ""
        yield from _words(spec.help)
        if not spec.repeated:
            yield f"[{here}]"
            yield from _table(value, here, live, without)
            continue
        for item in value:
            yield f"[[{here}]]"
            yield from _given(item, here, live, without)
        if not value:
            yield f"#[[{here}]]"
            yield from _example(spec.type)


def _given(item: Any, path: str, live: Any, without: Any) -> Iterator[str]:
    """A table of an array: what it has, then what it might have."""
    for name, spec in specs(type(item)).items():
        value = getattr(item, name)
        if spec.is_table:
            for inner in value if spec.repeated else (value,):
                yield ""
                yield f"[[{join(path, name)}]]" if spec.repeated else f"[{join(path, name)}]"
                yield from _given(inner, join(path, name), live, without)
            continue
        yield from _words(about(spec))
        yield "#" * (value is not None and value == spec.default) + _line(name, value, spec)


def _example(table: Any) -> Iterator[str]:
    """A table of an array that is empty, for reading alone."""
    for name, spec in specs(table).items():
        if not spec.is_table:
            yield from _words(f"  {name}{f' [{spec.unit}]' if spec.unit else ''}: {about(spec)}")


def _line(name: str, value: Any, spec: Spec) -> str:
    if value is None or value is MISSING:
        return f"# {name} = (not given)" + (f"  # [{spec.unit}]" if spec.unit else "")
    return toml_line(Setting(path=name, value=value, spec=spec))


def _words(text: str) -> Iterator[str]:
    indent = text[: len(text) - len(text.lstrip())]
    for line in textwrap.wrap(text, WIDTH, subsequent_indent=indent + "  " * bool(indent)):
        yield f"# {line}"
