"""The course of a study for one controller: random walks, the nearest falls, the probability, planes of two axes.

Everything is asked for as in `asking`: the course is a function of the seed and the answers.
"""

import hashlib
import math
from dataclasses import dataclass

import numpy as np

from sim.trials.plan.reliability import AdaptiveStudy, CertificateStudy, ReliabilityStudy
from sim.trials.reliability.asking import Array, Search, ask, together
from sim.trials.reliability.certificate import Certificate, Verdict
from sim.trials.reliability.directional import directional
from sim.trials.reliability.draws import FURTHEST, Draws, draw, normal_draws
from sim.trials.reliability.nearest import COARSE, Memory, Nearest, nearest, shrink
from sim.trials.reliability.probability import Probability, Sample, estimate, further, importance, plain
from sim.trials.reliability.subset import subset

ENOUGH = 25  # falls among the draws from which on importance sampling is left out: they say the probability well enough
SPOKES = 16  # directions in the plane of two axes
RADII = (0.75, 1.5, 2.25, 3.0, 4.0, 5.0)  # tried along each


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """What a study found of one controller.

    Attributes:
        draws: The random walks.
        nearest: The nearest falls.
        sample: The walks the probability is from.
        probability: Of a fall.
        planes: Distance of the first fall along `SPOKES` directions of each pair of axes, infinite without one.
    """

    draws: Draws
    nearest: Nearest
    sample: Sample
    probability: Probability
    planes: tuple[tuple[float, ...], ...]

    @property
    def beta(self) -> float:
        """Distance of the nearest fall in standard deviations, infinite if nothing fell."""
        return self.nearest.modes[0].beta if self.nearest.modes else math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Certified:
    """What a certificate says of one controller.

    Attributes:
        verdict: What can be said.
        walks: Walks it took, those without a result aside.
        falls: How many fell.
    """

    verdict: Verdict
    walks: int
    falls: int


def seed_of(seed: int, study: str) -> np.random.SeedSequence:
    """Root of all that is random in a study."""
    words = np.frombuffer(hashlib.sha256(f"reliability\0{study}".encode()).digest(), dtype=np.uint32)[:4]
    return np.random.SeedSequence(seed, spawn_key=tuple(words.tolist()))


def noise_seed(seed: int, study: str, number: int) -> int:
    """Seed of a walk with a realisation of the noise: the same for every controller."""
    root = seed_of(seed, study)
    own = np.random.SeedSequence(root.entropy, spawn_key=(*root.spawn_key, 1, number))
    return int(own.generate_state(1, np.uint64)[0] >> np.uint64(1))


def course(study: AdaptiveStudy, seed: int) -> Search[Found | Certified]:
    """The course of a study.

    Args:
        study: The study.
        seed: The plan's.
    """
    root = seed_of(seed, study.name)
    points, search, sampling = (
        np.random.SeedSequence(root.entropy, spawn_key=(*root.spawn_key, 2, part)) for part in range(3)
    )
    if isinstance(study, CertificateStudy):
        return _certify(study, points)
    return _study(study, points, search, sampling)


def _study(
    study: ReliabilityStudy,
    points: np.random.SeedSequence,
    search: np.random.SeedSequence,
    sampling: np.random.SeedSequence,
) -> Search[Found]:
    n = len(study.axes)
    draws = yield from draw(n, points, study.draws, study.rays, study.scales)
    found = Nearest(modes=(), looked=0, fell=0, tried=0)
    if study.modes:
        found = yield from nearest(
            draws.u, draws.fell, np.random.default_rng(search), most=study.modes, look=study.look, enough=study.search
        )
    sample = yield from _sample(study, draws, found, points, np.random.default_rng(sampling))
    if found.modes and found.modes[0].beta == 0.0:
        planes = [(0.0,) * SPOKES for _ in study.planes]
    else:
        planes = []
        for one, other in study.planes:  # one after another, so that pairs can be added to a study that is over
            planes.append((yield from _plane(n, one, other)))
    return Found(draws=draws, nearest=found, sample=sample, probability=estimate(sample), planes=tuple(planes))


def _sample(
    study: ReliabilityStudy, draws: Draws, found: Nearest, points: np.random.SeedSequence, rng: np.random.Generator
) -> Search[Sample]:
    """The walks that the probability is from, by the study's method."""
    n = len(study.axes)
    own = plain(draws)
    if found.modes and found.modes[0].beta == 0.0:  # half of all walks fall, about
        return own
    if study.probability == "crude" and np.nansum(own.fell) < ENOUGH:
        return (yield from further(draws, n, points, variation=study.variation, most=study.most))
    if study.probability == "subset":
        return (yield from subset(n, rng, variation=study.variation, most=study.most))
    if study.probability == "directional":
        return (yield from directional(n, found.modes, rng, variation=study.variation, most=study.most))
    if found.modes and np.nansum(own.fell) < ENOUGH:
        return (yield from importance(n, found.modes, rng, variation=study.variation, most=study.most))
    return own


def _plane(n: int, one: int, other: int) -> Search[tuple[float, ...]]:
    """Distance of the first fall along directions of the plane of two axes."""
    ways = np.zeros((SPOKES, n))
    angles = 2.0 * np.pi * np.arange(SPOKES) / SPOKES
    ways[:, one], ways[:, other] = np.cos(angles), np.sin(angles)
    fell = yield ask(np.concatenate([[r * way for r in RADII] for way in ways]))
    first = [_first(row) for row in np.nan_to_num(fell).reshape(SPOKES, len(RADII))]
    radii = (0.0, *RADII)
    memory = Memory(n)
    found = yield from together(
        [
            shrink(memory, way, radii[k + 1], COARSE, max(radii[k], 1e-3))
            for way, k in zip(ways, first, strict=True)
            if k is not None
        ]
    )
    rest = iter(found)
    return tuple(math.inf if k is None else next(rest)[1] for k in first)


def _first(row: Array) -> int | None:
    falls = np.flatnonzero(row > 0.5)
    return int(falls[0]) if len(falls) else None


def _certify(study: CertificateStudy, points: np.random.SeedSequence) -> Search[Certified]:
    test = Certificate(probability=study.probability, confidence=study.confidence)
    falls = walks = number = 0
    verdict = Verdict.OPEN
    while verdict is Verdict.OPEN and number < study.most:
        count = min(study.batch, study.most - number)
        u = np.clip(normal_draws(len(study.axes), points, number, count), -FURTHEST, FURTHEST)
        fell = yield ask(u, np.arange(number, number + count) + 1)
        number += count
        falls += int(np.nansum(fell))
        walks += int((~np.isnan(fell)).sum())
        verdict = test.verdict(falls, walks - falls)
    return Certified(verdict=verdict, walks=walks, falls=falls)
