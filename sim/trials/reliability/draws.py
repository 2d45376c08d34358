"""Random walks at several scales of all spreads: the crude answer, the fragility curve, and where searches start.

A draw has one direction and one quantile of the radius at every scale, so that scales compare the same disturbances.
"""

from dataclasses import dataclass

import numpy as np

from sim.trials.reliability.asking import Array, Search, ask

WIDER = (3.0, 4.0, 6.0)
"""Scales tried one after the other while too few walks fall to search from."""

ALONE = (2.0, 3.0, 4.0, 6.0)
"""Where every axis is tried alone while too few walks fall, in standard deviations to either side."""

BETWEEN = (1.5, 2.2)
"""Scales at which more draws are tried while nothing falls at all."""

MORE, ROUNDS = 150, 3  # draws a time, and times
FEW = 8  # falls below which wider scales are tried
FURTHEST = 9.0  # of a coordinate in standard normal space; nothing beyond it is tried


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Draws:
    """Random walks and how they ended.

    Attributes:
        u: Points, (k, n).
        fell: 1.0, 0.0, or NaN without a result, (k,).
        scale: Of each point's spreads, 1 for the plan's, 0 for points on a single axis, which are no draws, (k,).
    """

    u: Array
    fell: Array
    scale: Array

    def at(self, scale: float) -> "Draws":
        """Those of one scale."""
        here = self.scale == scale
        return Draws(u=self.u[here], fell=self.fell[here], scale=self.scale[here])


def normal_draws(n: int, seed: np.random.SeedSequence, first: int, count: int) -> Array:
    """Independent standard normal points by number, (count, n): each from a generator of its own."""
    words = tuple(seed.spawn_key)
    return np.array(
        [
            np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=(*words, number))).normal(size=n)
            for number in range(first, first + count)
        ]
    ).reshape(count, n)


def draw(n: int, seed: np.random.SeedSequence, count: int, rays: int, scales: tuple[float, ...]) -> Search[Draws]:
    """Try random points at the plan's spreads, the first of them at other scales too, wider if hardly one falls.

    Args:
        n: Number of axes.
        seed: Of the points; draw k is the same whatever `count` is.
        count: Draws at the plan's own spreads.
        rays: How many of them are tried at the other scales too.
        scales: These scales.
    """
    z = normal_draws(n, seed, 0, max(count, rays, MORE * ROUNDS if rays else 0))
    found: list[tuple[Array, Array, Array]] = []

    def go(parts: list[tuple[float, Array, int]]) -> Search[float]:
        """Try points of some scales, each from a number on; how many fell in all."""
        u = np.clip(np.concatenate([(scale or 1.0) * points for scale, points, _ in parts]), -FURTHEST, FURTHEST)
        scale = np.concatenate([np.full(len(points), one) for one, points, _ in parts])
        noise = np.concatenate([np.arange(first, first + len(points)) for _, points, first in parts])
        batch = ask(u, np.where(scale > 0.0, noise + 1, 0))
        found.append((batch.u, (yield batch), scale))
        return float(sum(np.nansum(one[1]) for one in found))

    falls = yield from go([(1.0, z[:count], 0), *((scale, z[:rays], 0) for scale in scales)])
    for number, scale in enumerate(WIDER):
        if falls < FEW and rays:
            alone = [(0.0, np.concatenate([r * np.eye(n) for r in ALONE for r in (r, -r)]), 0)] if not number else []
            falls = yield from go([(scale, z[:rays], 0), *alone])
    for number in range(ROUNDS):
        if not falls and rays:
            part = z[number * MORE : (number + 1) * MORE]
            falls = yield from go([(scale, part, number * MORE) for scale in BETWEEN])
    u, fell, scales_of = (np.concatenate(columns) for columns in zip(*found, strict=True))
    return Draws(u=u, fell=fell, scale=scales_of)
