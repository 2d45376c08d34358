"""The page of a log that is still being written: made anew as it grows, until its end."""

import time
from collections.abc import Callable
from pathlib import Path

from sim import pages
from sim.errors import UserError
from sim.log.read import salvage
from sim.review.page import page

RENEW = 2  # [s] between two looks of the browser
IDLE = 30.0  # [s] without a new byte, after which nobody seems to write any more
_POLL = 0.2  # [s]


def follow_page(log: Path, target: Path, tell: Callable[[str], None]) -> bool:
    """Make the page of a growing log again and again.

    Args:
        log: The log; it may not be there yet.
        target: The page; each new one takes the place of the last at once.
        tell: Told a line for the user whenever there is a new page.

    Returns:
        Whether the log has its end; if not, it has not grown for `IDLE`.

    Raises:
        UserError: the page cannot be written.
    """
    seen, grown = -1, time.monotonic()
    while True:
        size = log.stat().st_size if log.exists() else 0
        if size == seen or size == 0:
            if time.monotonic() - grown > IDLE:
                return False
            time.sleep(_POLL)
            continue
        seen, grown, started = size, time.monotonic(), time.monotonic()
        found = salvage(log)
        last = found.complete
        try:
            text = page([found], 0 if last else RENEW)
        except UserError:  # no tick yet
            if last:
                raise
            time.sleep(_POLL)
            continue
        pages.write(target, text)
        tell(f"{target}: {'whole' if last else 'so far'}, {size / 1e6:.1f} MB of log")
        if last:
            return True
        time.sleep(max(_POLL, time.monotonic() - started))  # half of the time is the run's
