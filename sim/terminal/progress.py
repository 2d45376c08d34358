"""One progress bar for all: on a terminal a bar, elsewhere the words of a sign of life."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from sim.terminal.pulse import PULSE

Update = Callable[..., None]
"""Called with what is done, all there is, and words to show behind the time left."""


class TimeLeft:
    """Guesses the rate and the time left from the work done since the first call; what came before was compiling."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        """Args: clock: tells the time in [s]."""
        self._clock = clock
        self._first: tuple[float, float] | None = None

    def rate(self, done: float) -> float | None:
        """Work per second, None while there is nothing to guess from."""
        now = self._clock()
        if self._first is None:
            self._first = (now, done)
        began, before = self._first
        return (done - before) / max(now - began, 1e-9) if done > before else None

    def __call__(self, done: float, total: float) -> float | None:
        """Seconds left, None while there is nothing to guess from."""
        rate = self.rate(done)
        return (total - done) / rate if rate else None


def duration(seconds: float | None) -> str:
    """The words "h:mm:ss left", empty for None."""
    if seconds is None:
        return ""
    minutes, whole = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{whole:02} left" if hours else f"{minutes}:{whole:02} left"


@contextmanager
def progress_bar(label: str, unit: str = "", *, quiet: bool) -> Iterator[Update | None]:
    """Show progress on stderr while the context lasts.

    Args:
        label: What is going on, a word or two.
        unit: Of what is done, such as "steps"; empty for a cost, which is shown in percent.
        quiet: Whether to show nothing.

    Yields:
        What to call with (done, total, words), or None if nothing is shown; words may be left out.
    """
    if quiet:
        with PULSE.hushed():
            yield None
        return
    left = TimeLeft()

    def words_of(done: float, total: float, words: str) -> str:
        share = f"{done:g}/{total:g} {unit}" if unit else f"{100 * done / total:.0f} %" if total else ""
        return "  ".join(filter(None, (share, duration(left(done, total)), words)))

    if not sys.stderr.isatty():

        def line(done: float, total: float, words: str = "") -> None:
            PULSE.words = words_of(done, total, words)

        with PULSE.beating(label):
            PULSE.label = label
            yield line
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (TextColumn(label), BarColumn(), TextColumn("{task.fields[words]}"))
    with PULSE.hushed(), Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None, words="")

        def move(done: float, total: float, words: str = "") -> None:
            bar.update(task, completed=done, total=total, words=words_of(done, total, words))

        yield move


@contextmanager
def walking(steps: int, *, quiet: bool) -> Iterator[Callable[[int, float], None] | None]:
    """Progress of a run: steps done, simulated time, speed.

    Args:
        steps: Steps of the whole run.
        quiet: Whether to show nothing.

    Yields:
        What to call with (steps done, simulated time in [s]), or None if nothing is shown.
    """
    with progress_bar("walking", "steps", quiet=quiet) as update:
        if update is None:
            yield None
            return
        speed = TimeLeft()

        def show(done: int, sim_time: float) -> None:
            update(done, steps, f"{sim_time:.2f} s  {speed.rate(sim_time) or 0.0:.2f} x real time")

        yield show
