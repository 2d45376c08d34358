"""Films and pictures of a run or two, drawn by MuJoCo from the plant's own model; no display is needed."""

from sim.review.film.film import film
from sim.review.film.strobe import strobe

__all__ = ["film", "strobe"]
