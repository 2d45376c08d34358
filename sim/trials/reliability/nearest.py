"""The nearest fall: points of the boundary as near to the nominal walk as a search by yes and no can find.

From a fall one goes straight towards the nominal walk until it walks (bisection); there the boundary's plane is fitted
to answers all around (`boundary.plane`); the nearest point of that plane is the next direction, if it falls nearer
than before. This is the Hasofer-Lind-Rackwitz-Fiessler iteration of structural reliability (Ditlevsen, Madsen,
Structural Reliability Methods, chapter 5) with a fitted plane in place of a gradient, which yes and no do not have.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.trials.reliability.asking import Array, Search, ask, together
from sim.trials.reliability.boundary import plane

ALIKE = 0.9  # cosine of the angle within which two directions are one mode
APART = 0.6  # cosine of the angle beyond which two falls are both worth a start
ROUNDS = 9  # of planes fitted at one start
PATIENCE = 3  # rounds in a row without a nearer fall that end it
COARSE, FINE = 0.02, 0.005  # relative width of a bracket while searching, and of the answer
WIDTHS = (0.6, 0.45, 0.35, 0.25, 0.2)  # distance of the points around a boundary point, in its radius
FURTHER = (1.0, 1.15, 1.4)  # of a start's radius, where it falls first under the search's own noise
STEPS = (1.0, 0.6, 0.3)  # parts of the way to the plane's nearest point
NEARER = 0.99  # of the radius at which a new direction must fall to be taken
LOOKS = 5  # times the sphere inside is looked at, and searched from where it falls
WITHIN = 0.98  # of the distance of the nearest fall: the sphere that is looked at
EXPLAINED = 0.85  # of a mode's distance along its direction, from where on a fall counts as its own
SHORT = 0.02  # of the distance, by which a nearest fall found has been seen to be too far (docs/reliability.md)
BEYOND = 1.0  # beyond it, where other modes that matter must show: one further out has an eighth of the probability


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mode:
    """A boundary point no nearer one was found beside.

    Attributes:
        inside: The nearest point in this direction that walks, (n,).
        outside: The furthest-in that falls, (n,); its distance from the origin is beta.
    """

    inside: Array
    outside: Array

    @property
    def beta(self) -> float:
        """Distance of the fall from the nominal walk, in standard deviations."""
        return float(np.linalg.norm(self.outside))

    @property
    def direction(self) -> Array:
        """Its unit direction, (n,)."""
        return self.outside / max(self.beta, 1e-12)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Nearest:
    """What a search for the nearest fall found.

    Attributes:
        modes: Distinct points, the nearest first; none if nothing fell.
        looked: Random directions tried on the sphere just inside the nearest fall, at `WITHIN` of its distance.
        fell: How many of them fell, after the last search from there.
        tried: Walks of the whole search.
    """

    modes: tuple[Mode, ...]
    looked: int
    fell: int
    tried: int


class Memory:
    """Every answer so far under one realisation of the noise, for planes to be fitted to."""

    def __init__(self, n: int) -> None:
        self.u: list[Array] = [np.zeros((0, n))]
        self.fell: list[Array] = [np.zeros(0)]

    def keep(self, u: Array, fell: Array) -> None:
        """Remember answers; those without a result are none."""
        known = ~np.isnan(fell)
        self.u.append(u[known])
        self.fell.append(fell[known])

    def all(self, but: "Sequence[Mode]" = ()) -> tuple[Array, Array]:
        """All points and answers, but for the falls that belong to some modes."""
        u, fell = np.concatenate(self.u), np.concatenate(self.fell)
        left = ~(explained(u, but) & (fell > 0.5))
        return u[left], fell[left]


def _try(memory: Memory, points: Array | list[Array]) -> Search[NDArray[np.bool_]]:
    """Whether points fall; without a result they do not."""
    batch = ask(points)
    fell = yield batch
    memory.keep(batch.u, fell)
    return np.nan_to_num(fell) > 0.5


def shrink(
    memory: Memory, direction: Array, falls_at: float, tolerance: float, walks_at: float = 0.0
) -> Search[tuple[float, float]]:
    """Radii of a walk and of a fall beyond it along a direction, no further apart than the tolerance.

    Args:
        memory: Keeps the answers.
        direction: Unit direction, (n,).
        falls_at: Radius of a fall.
        tolerance: Relative.
        walks_at: Radius of a walk further in; 0 is the nominal walk.
    """
    low, high = walks_at, falls_at
    parts = np.array([0.97, 0.92, 0.82, 0.6])
    while high - low > tolerance * high:
        wide = low < 0.6 * high and walks_at == 0.0
        radii = high * parts if wide else low + (high - low) * np.array([0.75, 0.5, 0.25])
        fell = yield from _try(memory, [r * direction for r in radii])
        walks = np.flatnonzero(~fell)
        if len(walks):
            first = int(walks[0])
            low, high = float(radii[first]), float(radii[first - 1]) if first else high
            walks_at = low
        else:
            high = float(radii[-1])
        if high < 1e-3:
            break
    return low, high


def refine(memory: Memory, start: Array, rng: np.random.Generator, known: Sequence[Mode]) -> Search[Mode | None]:
    """The nearest fall that can be reached from one; None if it does not fall under the search's own noise.

    Args:
        memory: Keeps the answers, and has those of others to fit planes to.
        start: A point that falls, (n,).
        rng: Draws the points around.
        known: Modes there are, whose falls must not draw the planes towards them.
    """
    n = len(start)
    radius = float(np.linalg.norm(start))
    d = start / radius
    fell = yield from _try(memory, [radius * further * d for further in FURTHER])
    if not fell.any():  # it fell under another realisation of the noise
        return None
    low, high = yield from shrink(memory, d, radius * FURTHER[int(np.flatnonzero(fell)[0])], COARSE)
    without = 0
    normal = d
    for number in range(ROUNDS if n > 1 else 0):
        width = WIDTHS[min(number, len(WIDTHS) - 1)] * high
        b = 0.5 * (low + high) * d
        t = rng.normal(size=(n + 2, n))
        t -= np.outer(t @ normal, normal)
        t *= width / np.maximum(np.linalg.norm(t, axis=1), 1e-12)[:, None]
        t += np.outer(rng.uniform(-0.3, 0.3, n + 2) * width * 0.7**number, normal)
        yield from _try(memory, b + t)
        normal, distance = plane(*memory.all(known), b, width)
        if normal @ d <= 0.05:
            normal, without = d, without + 1
        else:
            found = yield from _step(memory, d, high, normal, distance)
            if found is None:
                without += 1
            else:
                d, low, high = found
                without = 0
        if without >= PATIENCE:
            break
    low, high = yield from shrink(memory, d, high, FINE, low)
    return Mode(inside=np.round(low * d, 4), outside=np.round(high * d, 4))


def _step(
    memory: Memory, d: Array, radius: float, normal: Array, distance: float
) -> Search[tuple[Array, float, float] | None]:
    """The best direction on the way from a boundary point to the nearest point of a plane; None if none is nearer."""
    candidates: list[tuple[Array, float]] = []
    for step in STEPS:
        way = (1.0 - step) * d + step * normal
        way /= np.linalg.norm(way)
        candidates.append((way, NEARER * radius))
        meets = 1.03 * distance / max(float(way @ normal), 1e-6)
        if 0.3 * radius < meets < 0.95 * radius:
            candidates.append((way, meets))
    fell = yield from _try(memory, [r * way for way, r in candidates])
    nearer = [candidate for candidate, falls in zip(candidates, fell, strict=True) if falls]
    if not nearer:
        return None
    way, at = min(nearer, key=lambda one: one[1])
    low, high = yield from shrink(memory, way, at, COARSE)
    return way, low, high


def starts(u: Array, fell: Array, most: int) -> list[Array]:
    """Falls to search from: the nearest, then the nearest in other directions."""
    falls = u[np.nan_to_num(fell) > 0.5]
    radius = np.linalg.norm(falls, axis=1)
    chosen: list[Array] = []
    for i in np.argsort(radius, kind="stable"):
        way = falls[i] / max(radius[i], 1e-12)
        if all(way @ other / np.linalg.norm(other) < APART for other in chosen):
            chosen.append(falls[i])
        if len(chosen) == most:
            break
    return chosen


def distinct(modes: list[Mode], most: int) -> tuple[Mode, ...]:
    """The nearest of every group of modes in about the same direction, nearest first."""
    kept: list[Mode] = []
    for mode in sorted(modes, key=lambda mode: mode.beta):
        if all(mode.direction @ other.direction < ALIKE for other in kept):
            kept.append(mode)
    return tuple(kept[:most])


def explained(u: Array, modes: Sequence[Mode]) -> NDArray[np.bool_]:
    """Whether points lie beyond or nearly beyond the plane of a mode, as falls that belong to it do, (k,)."""
    reach = np.array([u @ mode.direction / mode.beta for mode in modes])
    found: NDArray[np.bool_] = reach.max(axis=0, initial=0.0) > EXPLAINED
    return found


def nearest(
    u: Array, fell: Array, rng: np.random.Generator, *, most: int = 4, look: int = 60, enough: int = 10**9
) -> Search[Nearest]:
    """Search for the nearest falls from what random walks found.

    Args:
        u: Points that were tried, (k, n).
        fell: How they ended, (k,).
        rng: Draws the search's own points.
        most: Starts, and modes that are reported.
        look: Random directions tried on the sphere just inside the nearest fall.
        enough: Walks from which on it begins nowhere anew.
    """
    n = u.shape[1]
    memory = Memory(n)
    at_nominal = yield from _try(memory, np.zeros((1, n)))
    memory.keep(u, fell)
    if at_nominal[0]:
        nowhere = Mode(inside=np.full(n, np.nan), outside=np.zeros(n))
        return Nearest(modes=(nowhere,), looked=0, fell=0, tried=1)
    before = len(memory.all()[1]) - 1
    modes: list[Mode] = []
    begin = starts(u, fell, max(1, most - 1))
    begun = (u[:, None] == np.array(begin).reshape(1, -1, n)).all(axis=2).any(axis=1)
    looked = inside = 0
    for _ in range(LOOKS):
        if not begin or len(memory.all()[1]) - before >= enough:
            break
        pairs = zip(begin, rng.spawn(len(begin)), strict=True)
        found = yield from together([refine(memory, *one, tuple(modes)) for one in pairs])
        modes = list(distinct([*modes, *filter(None, found)], most))
        if not modes:  # none of these falls under the search's own noise
            begin = starts(u, np.where(begun, 0.0, fell), most)
            begun |= (u[:, None] == np.array(begin).reshape(1, -1, n)).all(axis=2).any(axis=1)
            continue
        radius = WITHIN * modes[0].beta
        ways = rng.normal(size=(look, n))
        points = radius * ways / np.linalg.norm(ways, axis=1)[:, None]
        falls = yield from _try(memory, np.concatenate((points, points * (1.0 + BEYOND / radius))))
        looked, inside = look, int(falls[:look].sum())
        begin = starts(points[falls[:look]], np.ones(inside), 2)
        further = points[falls[look:]] * (1.0 + BEYOND / radius)
        apart = [way for way in further if all(way @ mode.direction < APART * np.linalg.norm(way) for mode in modes)]
        begin += starts(np.array(apart).reshape(-1, n), np.ones(len(apart)), most)
        begin += starts(u, np.where(explained(u, modes) | begun, 0.0, fell), 2)
        begun |= (u[:, None] == np.array(begin).reshape(1, -1, n)).all(axis=2).any(axis=1)
    return Nearest(modes=tuple(modes), looked=looked, fell=inside, tried=len(memory.all()[1]) - before)
