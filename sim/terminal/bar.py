"""A progress bar for work of known cost, with the time left."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic


class TimeLeft:
    """Guesses the time left from the cost done since the first call."""

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        """Args: clock: tells the time in [s]."""
        self._clock = clock
        self._first: tuple[float, float] | None = None

    def __call__(self, done: float, total: float) -> float | None:
        """Seconds left, None while there is nothing to guess from."""
        now = self._clock()
        if self._first is None:
            self._first = (now, done)
        began, before = self._first
        if done <= before:
            return None
        return (now - began) / (done - before) * (total - done)


@contextmanager
def cost_bar(label: str, *, quiet: bool) -> Iterator[Callable[[float, float], None] | None]:
    """A bar on stderr while the context lasts.

    Args:
        label: One word for what is going on.
        quiet: Whether to show nothing; nothing is shown either when stderr is no terminal.

    Yields:
        What to call with (cost done, cost in all), or None if nothing is shown.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    left = TimeLeft()
    columns = (TextColumn(label), BarColumn(), TextColumn("{task.percentage:3.0f} %  {task.fields[left]}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0, left="")

        def show(done: float, total: float) -> None:
            seconds = left(done, total)
            words = "" if seconds is None else f"{int(seconds) // 60}:{int(seconds) % 60:02d} left"
            bar.update(task, completed=done, total=total, left=words)

        yield show
