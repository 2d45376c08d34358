"""Where lines and tables for people go."""

import sys
from typing import Any

from sim.terminal.pulse import PULSE


def note(line: str) -> None:
    """Print a line on stderr, at once: what is going on, apart from results."""
    PULSE.clear()
    print(line, file=sys.stderr, flush=True)


def next_step(command: str, what: str = "") -> None:
    """Print on stdout, after a result, the command that most likely comes next."""
    print(f"next: {command}" + (f"   {what}" if what else ""), flush=True)


def show(table: Any, width: int = 170) -> None:
    """Print a table of rich, or a text, on stdout.

    Args:
        table: What rich can print.
        width: Columns where stdout is no terminal.
    """
    from rich.console import Console

    class Plain(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # where output goes is not rich's to decide

    Plain(file=sys.stdout, highlight=False, width=None if sys.stdout.isatty() else width).print(table)


def table(*columns: str, title: str = "", right: tuple[str, ...] = ()) -> Any:
    """An empty table of rich.

    Args:
        columns: Headings.
        title: Above it.
        right: Headings of columns that are aligned to the right.
    """
    from rich.table import Table

    made = Table(title=title or None, title_justify="left")
    for column in columns:
        made.add_column(column, justify="right" if column in right else "left", overflow="fold")
    return made
