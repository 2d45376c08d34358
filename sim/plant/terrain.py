"""The shape of the ground as straight facets, from the ground's settings and the scenario's seed."""

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.errors import UserError
from sim.scenario import GroundSettings
from sim.scenario.randomness import Purpose, stream

BACK = -10.0  # [m], where the ground begins
RUNWAY = 1000.0  # [m] of ground behind the last feature
MOST_FACETS = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Facet:
    """A flat stretch of ground: z = intercept + tan(angle) x from x0 to x1.

    Attributes:
        x0: Where it begins in [m].
        x1: Where it ends in [m].
        angle: Inclination in [rad], positive uphill.
        intercept: Height of its line at x = 0 in [m].
        friction: Coulomb friction coefficient.
    """

    x0: float
    x1: float
    angle: float
    intercept: float
    friction: float

    def height(self, x: float) -> float:
        """Height of its line in [m] at x in [m]."""
        return self.intercept + math.tan(self.angle) * x


class Terrain:
    """Height, slope and friction of the ground along x; heights count from level ground at x = 0."""

    def __init__(self, settings: GroundSettings, *, seed: int, length: float) -> None:
        """Lay the ground out.

        Args:
            settings: The ground; its overall slope is part of every facet.
            seed: The scenario's seed, for rough ground.
            length: How far the roughness has to reach in [m].

        Raises:
            UserError: the settings ask for more facets than fit, or a feature lies before the ground begins.
        """
        s = settings
        if s.rough.height and length / s.rough.spacing > MOST_FACETS:
            raise UserError(
                f"plant.ground.rough.spacing = {s.rough.spacing} m: must be above {length / MOST_FACETS:.3g} m "
                f"for {length:.4g} m of rough ground"
            )
        if s.is_plane:
            plane = Facet(x0=-math.inf, x1=math.inf, angle=s.slope, intercept=0.0, friction=s.friction)
            self.facets: tuple[Facet, ...] = (plane,)
        else:
            self.facets = tuple(_facets(s, _bends(s, seed, length)))
        self._starts = [facet.x0 for facet in self.facets]

    def under(self, x: float) -> Facet:
        """The facet under a point; on a border, the one that begins there.

        Args:
            x: Horizontal position in [m].
        """
        return self.facets[max(0, bisect_right(self._starts, x) - 1)]

    def table(self) -> NDArray[np.float64]:
        """The facets as compiled code takes them: start, cosine, sine, intercept, tangent, (n, 5)."""
        rows = [(f.x0, math.cos(f.angle), math.sin(f.angle), f.intercept, math.tan(f.angle)) for f in self.facets]
        return np.array(rows)

    def outline(self, start: float, end: float) -> tuple[tuple[float, float], ...]:
        """The ground as a line through (x, z) in [m] from `start` to `end`; where it jumps, two points share x."""
        points = []
        for facet in self.facets:
            x0, x1 = max(start, facet.x0), min(end, facet.x1)
            if x0 < x1:
                points += [(x0, facet.height(x0)), (x1, facet.height(x1))]
        return tuple(points)

    def height(self, x: float) -> float:
        """Height of the ground in [m] at x in [m]."""
        return self.under(x).height(x)


def _bends(s: GroundSettings, seed: int, length: float) -> list[tuple[float, float]]:
    """Where the inclination changes: (x in [m], change of dz/dx)."""
    bends = []
    for ramp in s.ramps:
        rise = math.tan(ramp.slope)
        bends += [(ramp.start, rise), (ramp.start + ramp.length, -rise)]
    if s.rough.height:
        count = max(2, math.ceil(length / s.rough.spacing))
        z = stream(seed, Purpose.TERRAIN).uniform(-s.rough.height, s.rough.height, count)
        rises = np.diff(z, prepend=0.0, append=0.0) / s.rough.spacing
        changes = np.diff(rises, prepend=0.0, append=0.0).tolist()
        bends += [(s.rough.start + i * s.rough.spacing, change) for i, change in enumerate(changes)]
    return bends


def _facets(s: GroundSettings, bends: list[tuple[float, float]]) -> Iterator[Facet]:
    """Walk along the ground from one border of a facet to the next."""
    jumps = [(ledge.position + i * ledge.spacing, ledge.height) for ledge in s.ledges for i in range(ledge.count)]
    bend_at, jump_at = _sums(bends), _sums(jumps)
    cuts = {*bend_at, *jump_at}
    cuts |= {x for patch in s.patches for x in (patch.start, patch.start + patch.length)}
    if cuts and min(cuts) <= BACK:
        raise UserError(f"plant.ground: a feature at x = {min(cuts):g} m: must lie beyond {BACK} m")
    rise = math.tan(s.slope)  # dz/dx of the facet
    x, z = BACK, rise * BACK
    for end in [*sorted(cuts), max(cuts, default=0.0) + RUNWAY]:
        z_end = z + rise * (end - x)
        friction = s.friction
        for patch in s.patches:
            if patch.start <= x < patch.start + patch.length:
                friction = patch.friction
        yield Facet(x0=x, x1=end, angle=math.atan(rise), intercept=z - rise * x, friction=friction)
        x, z = end, z_end + jump_at.get(end, 0.0)
        rise += bend_at.get(end, 0.0)


def _sums(changes: list[tuple[float, float]]) -> dict[float, float]:
    """Changes at the same place, added."""
    found: dict[float, float] = {}
    for x, change in changes:
        found[x] = found.get(x, 0.0) + change
    return found
