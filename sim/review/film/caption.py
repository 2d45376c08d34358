"""Words and bars over a picture of a film."""

from typing import Any

import numpy as np

from sim.pages.palette import BLACK, BLUE, GREY, ORANGE, RED
from sim.review.film.camera import Pixels
from sim.review.film.story import Moment

NEAR, REACHED = 0.9, 0.999  # of a limit, from where on a bar warns
_PAPER = (255, 255, 255, 200)


class Captions:
    """Draws over pictures of one size."""

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        """Args: title: whose picture it is; size: width and height in [pixel]."""
        from PIL import ImageFont

        self._title, self._width, self._height = title, *size
        self._unit = max(1.0, min(size[1] / 360.0, size[0] / 420.0))  # [pixel]
        self._font, self._bold = (ImageFont.load_default(round(part * self._unit)) for part in (12, 15))

    def over(self, pixels: Pixels, moment: Moment, speed: float) -> Pixels:
        """A picture with what there is to tell.

        Args:
            pixels: The picture.
            moment: What it shows.
            speed: Of the film there, 1 for real time.
        """
        from PIL import Image, ImageDraw

        image = Image.fromarray(pixels)
        pen = ImageDraw.Draw(image, "RGBA")
        u = self._unit
        pen.text((8 * u, 6 * u), self._title, BLACK, self._bold)
        slow = "" if speed == 1.0 else f"   {speed:.3g} × speed"
        pen.text((8 * u, 25 * u), f"{moment.t:.3f} s   step {moment.step}{slow}", BLACK, self._font)
        line = 42 * u
        if moment.fall:
            pen.text((8 * u, line), moment.fall, RED, self._font)
            line += 17 * u
        if moment.end:
            pen.text((8 * u, line), f"{moment.end} at {moment.t:.2f} s", RED if moment.fall else BLACK, self._bold)
        if moment.push > 0.5:
            pen.text((self._width - 8 * u, 6 * u), f"push {moment.push:.0f} N", RED, self._bold, anchor="ra")
        self._bars(pen, moment.shares)
        return np.asarray(image)

    def _bars(self, pen: Any, shares: dict[str, float]) -> None:
        u, long, thick, row = self._unit, 70 * self._unit, 7 * self._unit, 15 * self._unit
        top = self._height - 8 * u - row * len(shares)
        left = 8 * u
        if shares:
            corners = (left - 4 * u, top - 3 * u, left + 72 * u + long, self._height - 5 * u)
            pen.rounded_rectangle(corners, 4 * u, _PAPER)
        for at, (name, share) in enumerate(shares.items()):
            y = top + at * row
            pen.text((left, y), name, BLACK, self._font)
            x = left + 66 * u
            colour = RED if share >= REACHED else ORANGE if share >= NEAR else BLUE
            pen.rectangle((x, y + 4 * u, x + long, y + 4 * u + thick), (0, 0, 0, 28))
            pen.rectangle((x, y + 4 * u, x + long * min(1.0, share), y + 4 * u + thick), colour)
            pen.line((x + long, y + 2 * u, x + long, y + 6 * u + thick), BLACK, max(1, round(u)))

    def under(self, pixels: Pixels, places: list[float], times: list[float]) -> Pixels:
        """A still of several moments, each with its time.

        Args:
            pixels: The picture.
            places: Where each walker is, from the left in [pixel].
            times: Their times in [s].
        """
        from PIL import Image, ImageDraw

        image = Image.fromarray(pixels)
        pen = ImageDraw.Draw(image, "RGBA")
        pen.text((8 * self._unit, 6 * self._unit), self._title, BLACK, self._bold)
        y = self._height - 8 * self._unit
        for place, t in zip(places, times, strict=True):
            pen.text((place, y), f"{t:.2f} s", GREY, self._font, anchor="ms")
        return np.asarray(image)
