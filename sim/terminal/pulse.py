"""A sign of life: what takes longer than a moment says what it does and for how long, on stderr.

On a terminal one line that is written over and vanishes; elsewhere a line after 2, 5, 10, 20 and 30 s, then every 30 s.
"""

import itertools
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

FIRST = 2.0  # [s] of silence before the first sign on a terminal
SILENCES = (2.0, 3.0, 5.0, 10.0, 10.0, 30.0)  # [s] before each line where stderr is no terminal; the last one again
BLINK = 1.0  # [s] between two states of the line on a terminal


class Pulse:
    """Beats while a command runs and nothing else is shown.

    Attributes:
        label: What is going on.
        words: How far it is, empty if unknown.
    """

    def __init__(self) -> None:
        """Start silent."""
        self.label, self.words = "", ""
        self._over: threading.Event | None = None
        self._began = self._spoke = 0.0
        self._hushed = 0
        self._standing = False  # whether the line stands on the terminal
        self._lock = threading.RLock()

    @contextmanager
    def beating(self, label: str) -> Iterator[None]:
        """Beat while the context lasts; a pulse that beats already goes on under its own label."""
        if self._over is not None:
            yield
            return
        self.label, self.words = label, ""
        self._began = self._spoke = time.perf_counter()
        over = self._over = threading.Event()
        thread = threading.Thread(target=self._beat, args=(over,), daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()
            self._over = None
            self.clear()

    @contextmanager
    def hushed(self) -> Iterator[None]:
        """Beat not: a bar is shown, or nothing is wanted."""
        self.clear()
        self._hushed += 1
        try:
            yield
        finally:
            self._hushed -= 1
            self._spoke = time.perf_counter()

    def clear(self) -> None:
        """Take the line off the terminal: something else is to be printed, which is a sign of life too."""
        if self._over is None and not self._standing:
            return
        with self._lock:
            self._spoke = time.perf_counter()
            if self._standing:
                self._standing = False
                print("\r\x1b[2K", end="", file=sys.stderr, flush=True)

    def _beat(self, over: threading.Event) -> None:
        silences = itertools.chain(SILENCES, itertools.repeat(SILENCES[-1]))
        wait = FIRST if sys.stderr.isatty() else next(silences)
        while not over.wait(min(wait, BLINK)):
            terminal = sys.stderr.isatty()
            with self._lock:
                if self._hushed or time.perf_counter() - self._spoke < wait:
                    continue
                self._say(terminal)
            wait = BLINK if terminal else next(silences)

    def _say(self, terminal: bool) -> None:
        took = f"{time.perf_counter() - self._began:.0f} s"
        line = f"{self.label}: {'  '.join(filter(None, (self.words, took)))}"
        if terminal:
            print(f"\r\x1b[2K{line[:78]}", end="", file=sys.stderr, flush=True)
            self._standing = True
        else:
            print(line, file=sys.stderr, flush=True)
            self._spoke = time.perf_counter()


PULSE = Pulse()
"""The one of this process."""
