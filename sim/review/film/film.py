"""A film of a run, or of two side by side."""

import contextlib
from collections.abc import Sequence
from itertools import count, takewhile
from pathlib import Path

import numpy as np

from sim.errors import UserError
from sim.log.read import Log
from sim.review.film.camera import camera
from sim.review.film.caption import Captions
from sim.review.film.story import Story, last_moment
from sim.review.film.writer import check, writer

AROUND = 0.3  # [s] to either side of the onset of a fall that are slowed down


def film(
    logs: Sequence[Log],
    target: Path,
    *,
    fps: float,
    size: tuple[int, int],
    speed: float,
    start: float,
    end: float | None,
    slow: float = 1.0,
    plain: bool = False,
) -> int:
    """Draw a run into a file, or two side by side by the same clock; one that ends first stays as it ended.

    Args:
        logs: One or two.
        target: An .mp4, .gif or .png (a picture of the moment `start`); must not exist.
        fps: Pictures in a second of film [1/s].
        size: Width and height in [pixel].
        speed: Speed of the film, 1 for real time.
        start: First moment in [s].
        end: Last moment in [s]; None for the end of the longer run.
        slow: Share of that speed around the moment at which a fall begins.
        plain: Whether to leave out words and bars.

    Returns:
        Pictures drawn.

    Raises:
        UserError: a log cannot be drawn, a package or OpenGL is missing, or the file cannot be written.
    """
    check(target, size)
    if not 1.0 <= fps <= 240.0:
        raise UserError(f"--fps {fps:g} 1/s: must be within 1 and 240")
    for name, value in (("--speed", speed), ("--slow", slow)):
        if not 0.01 <= value <= 100.0:
            raise UserError(f"{name} {value:g}: must be within 0.01 and 100")
    stories = [Story(log) for log in logs]
    last = last_moment(end, max(story.end for story in stories))
    if not 0.0 <= start <= last:
        raise UserError(f"--start {start:g} s: must be within 0 and {last:g} s")
    began = min((story.began for story in stories if story.began is not None), default=None)
    moments = [(start, speed)] if target.suffix == ".png" else _moments(start, last, fps, speed, began, slow)
    width, height = size[0] // len(stories), size[1]
    with contextlib.ExitStack() as stack:
        write = stack.enter_context(writer(target, fps))
        cameras = [stack.enter_context(camera(story.log, (width, height))) for story in stories]
        captions = [Captions(story.title, (width, height)) for story in stories]
        for t, its_speed in moments:
            parts = []
            for story, draw, words in zip(stories, cameras, captions, strict=True):
                pixels = draw.draw(story.signals, min(t, story.end))
                parts.append(pixels if plain else words.over(pixels, story.at(t), its_speed))
            write(np.concatenate(parts, axis=1))
    return len(moments)


def _moments(
    start: float, last: float, fps: float, speed: float, began: float | None, slow: float
) -> list[tuple[float, float]]:
    """Moments of a film in [s], and its speed at each."""
    if began is None or slow == 1.0:
        times = (start + k * speed / fps for k in count())
        return [(t, speed) for t in takewhile(lambda t: t <= last + 1e-9, times)]
    found, t = [], start
    while t <= last + 1e-9:
        now = speed * (slow if abs(t - began) <= AROUND else 1.0)
        found.append((t, now))
        t += now / fps
    return found
