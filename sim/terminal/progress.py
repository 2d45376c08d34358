"""A progress bar on the terminal: steps done, simulated time, speed."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(steps: int, *, quiet: bool) -> Iterator[Callable[[int, float], None] | None]:
    """A bar on stderr while the context lasts.

    Args:
        steps: Number of steps that make the bar full.
        quiet: Whether to show nothing; nothing is shown either when stderr is no terminal.

    Yields:
        What to call with (steps done, simulated time in [s]), or None if nothing is shown.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (
        TextColumn("walking"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("steps  {task.fields[time]:.2f} s  {task.fields[speed]:.2f} x real time"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=steps, time=0.0, speed=0.0)
        first: list[float] = []  # simulated and wall time of the first call; what came before was compiling

        def show(steps_done: int, sim_time: float) -> None:
            now = time.perf_counter()
            if not first:
                first.extend((sim_time, now))
            speed = (sim_time - first[0]) / max(now - first[1], 1e-9)
            bar.update(task, completed=steps_done, time=sim_time, speed=speed)

        yield show
