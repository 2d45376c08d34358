"""A stroboscopic still: the walker at several moments of a run in one picture."""

from pathlib import Path

import numpy as np

from sim.errors import UserError
from sim.log.read import Log
from sim.review.film.camera import camera
from sim.review.film.caption import Captions
from sim.review.film.story import Story, last_moment
from sim.review.film.writer import check, writer

MOST = 40


def strobe(
    log: Log, target: Path, *, count: int, size: tuple[int, int], start: float, end: float | None, plain: bool = False
) -> int:
    """Draw several moments of a run into one picture.

    Args:
        log: The log.
        target: A .png; must not exist.
        count: How many moments, evenly spaced in time.
        size: Width and height in [pixel].
        start: First moment in [s].
        end: Last moment in [s]; None for the end of the run.
        plain: Whether to leave out words.

    Returns:
        Walkers drawn.

    Raises:
        UserError: the log cannot be drawn, a package or OpenGL is missing, or the file cannot be written.
    """
    if target.suffix != ".png":
        raise UserError(f"{target}: a stroboscopic still must end in .png")
    if not 2 <= count <= MOST:
        raise UserError(f"--strobe {count}: must be within 2 and {MOST}")
    check(target, size)
    story = Story(log)
    last = last_moment(end, story.end)
    if not 0.0 <= start < last:
        raise UserError(f"--start {start:g} s: must be within 0 and {last:g} s")
    times = np.linspace(start, last, count).tolist()
    with writer(target, 1.0) as write, camera(log, size, count) as its:
        pixels, places = its.draw_all(story.signals, times)
        write(pixels if plain else Captions(story.title, size).under(pixels, places, times))
    return count
