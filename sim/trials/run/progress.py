"""Progress of a campaign on stderr: trials done, trials/s, time left, survived so far."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from sim.trials.run.campaign import Progress, Report

LINE_EVERY = 10.0  # [s] between lines where stderr is no terminal


class Rate:
    """Trials/s and time left, from the first result of this call on."""

    def __init__(self) -> None:
        self._first: tuple[float, int] | None = None

    def __call__(self, progress: Progress) -> str:
        """Words for a progress."""
        now = time.perf_counter()
        if self._first is None:
            self._first = (now, progress.new)
        began, before = self._first
        rate = (progress.new - before) / max(now - began, 1e-9)
        left = (progress.known - progress.done) / rate if rate else None
        survived = ", ".join(f"{name} {ok}/{done}" for name, (ok, done) in sorted(progress.survived.items()))
        return f"{rate:.1f} trials/s, {_duration(left)} left, survived: {survived}"


def _duration(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    minutes, whole = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{whole:02}" if hours else f"{minutes}:{whole:02}"


@contextmanager
def show_progress(name: str, *, quiet: bool) -> Iterator[Report | None]:
    """Show progress while the context lasts: a bar on a terminal, a line now and then elsewhere.

    Args:
        name: What runs.
        quiet: Whether to show nothing.

    Yields:
        What to call with each `Progress`, None if nothing is shown.
    """
    rate = Rate()
    if quiet:
        yield None
        return
    if not sys.stderr.isatty():
        shown = [0.0]

        def line(progress: Progress) -> None:
            words = rate(progress)
            if progress.done >= progress.known or time.perf_counter() - shown[0] > LINE_EVERY:
                shown[0] = time.perf_counter()
                print(f"{name}: {progress.done}/{progress.known} trials, {words}", file=sys.stderr, flush=True)

        yield line
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn(name), BarColumn(), MofNCompleteColumn(), TextColumn("trials  {task.fields[words]}"))
    with Bar(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("", total=None, words="starting workers")

        def move(progress: Progress) -> None:
            bar.update(task, completed=progress.done, total=progress.known, words=rate(progress))

        yield move
