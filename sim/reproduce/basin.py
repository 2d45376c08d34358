"""Basin of attraction: which torso offsets and first-step forces a walker comes back from.

A constant horizontal force pushes the torso throughout the first step, and the first state is offset in one of two
ways the paper's "we disturb q5" can be read. "q5": that coordinate alone; the joint angles stay, so the whole
walker tilts about its stance foot, and for offsets above 0 the swing foot starts in the ground, which only a plant
without contact can do. "torso": the torso tilts about the hip and the legs stay where they are.

A run ends as converged when the state just before an impact comes within epsilon of the periodic one, as fallen
when it falls, and as undecided after a limit of steps.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.errors import UserError
from sim.interface import Vector
from sim.loop import Outcome, Patient
from sim.reproduce.measure import TRIP_DEPTH
from sim.scenario import Push, from_toml
from sim.stability.rig import Rig
from sim.stability.step_map import Fell, distance

AXES = {"q5": np.array([0.0, 0.0, 0.0, 0.0, 1.0]), "torso": np.array([-1.0, -1.0, 0.0, 0.0, 1.0])}
"""Offset of the five angles per offset of the torso, body order."""

EPSILON = 0.05  # [rad], rates in units of `sim.stability.step_map.RATE_SCALE`
STEPS = 25
COARSE = 4  # points of the grid along a side of the cells that `followed` starts from
SETTLING, KEPT = 25, 10  # steps of the undisturbed walk, and of those whose mean is the periodic state


class Fate(IntEnum):
    """How a run of the grid ended."""

    FELL = 0
    CONVERGED = 1
    UNDECIDED = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """Points of the plane.

    Attributes:
        torso: Offsets of the torso angle in [rad], ascending, (m,).
        force: Forces throughout the first step in [N], ascending, positive forward, (n,).
    """

    torso: Vector
    force: Vector

    @classmethod
    def of(cls, torso: tuple[float, float, int], force: tuple[float, float, int]) -> "Grid":
        """An even grid from (first, last, number) of each axis."""
        return cls(torso=np.linspace(*torso), force=np.linspace(*force))

    @property
    def cell(self) -> float:
        """Area that one point stands for in [rad N]."""
        return float((self.torso[1] - self.torso[0]) * (self.force[1] - self.force[0]))


def column(
    scenario: str, axis: str, torso: float, force: list[float], epsilon: float = EPSILON, steps: int = STEPS
) -> dict[str, NDArray[np.int64]]:
    """One column of the map: every force at one torso offset.

    Args:
        scenario: The scenario as TOML: walker, controller, plant; its own pushes and offsets play no part.
        axis: A name in `AXES`.
        torso: Offset of the torso angle in [rad].
        force: Forces in [N], (n,).
        epsilon: Distance from the periodic state that counts as converged in [rad].
        steps: Limit of steps.

    Returns:
        "fate" (n,) as values of `Fate`, "steps" (n,), the steps taken, and "scuff" (n,), how deep the swing foot was
        below the ground in [m].
    """
    rig, periodic = _prepared(scenario)
    fates, taken, depths = zip(
        *(_try(rig, periodic, torso * AXES[axis], f, epsilon, steps) for f in force), strict=True
    )
    return {"fate": np.array(fates), "steps": np.array(taken), "scuff": np.array(depths)}


def followed(
    scenario: str, axis: str, torso: list[float], force: list[float], epsilon: float = EPSILON, steps: int = STEPS
) -> dict[str, NDArray[Any]]:
    """A whole map, run along its boundaries: a cell with one fate at its corners and its middle is taken to have it.

    Args:
        scenario: As for `column`.
        axis: A name in `AXES`.
        torso: Offsets of the torso angle in [rad], (m,).
        force: Forces in [N], (n,).
        epsilon: As for `column`.
        steps: As for `column`.

    Returns:
        "fate" as values of `Fate`, "trips", whether the swing foot was deeper in the ground than `TRIP_DEPTH`, "run",
        whether the point was run, "steps", -1 where it was not, and "scuff", the depth in [m], NaN where it was not;
        (n, m) each.
    """
    rig, periodic = _prepared(scenario)
    known: dict[tuple[int, int], tuple[Fate, int, float]] = {}

    def kind(row: int, column: int) -> tuple[Fate, bool]:
        if (row, column) not in known:
            known[row, column] = _try(rig, periodic, torso[column] * AXES[axis], force[row], epsilon, steps)
        fate, _, depth = known[row, column]
        return fate, depth > TRIP_DEPTH

    kinds = filled((len(force), len(torso)), kind)
    run = np.zeros(kinds.shape, dtype=bool)
    taken, depths = np.full(kinds.shape, -1), np.full(kinds.shape, np.nan)
    for point, (_, number, depth) in known.items():
        run[point], taken[point], depths[point] = True, number, depth
    fates, trips = (np.vectorize(lambda one, i=i: int(one[i]))(kinds) for i in range(2))
    return {"fate": fates, "trips": trips.astype(bool), "run": run, "steps": taken, "scuff": depths}


def filled(shape: tuple[int, int], at: Callable[[int, int], Any]) -> NDArray[Any]:
    """A map by as few of its points as tell its boundaries, (rows, columns) of objects.

    Cells of `COARSE` points a side are asked at their corners and in the middle, and where these differ, or a point of
    the border that a neighbour asked for does, cut in halves down to single points.

    Args:
        shape: Numbers of rows and columns, 2 or more each.
        at: What a point is; hashable. Asked again for points it was asked for before.
    """
    asked: dict[tuple[int, int], Any] = {}

    def known(row: int, column: int) -> Any:
        if (row, column) not in asked:
            asked[row, column] = at(row, column)
        return asked[row, column]

    found = np.empty(shape, dtype=object)
    edges = [[*range(0, n - 1, COARSE), n - 1] for n in shape]
    cells = [(*rows, *columns) for rows, columns in product(*map(pairwise, edges))]
    for r0, r1, c0, c1 in cells:
        known((r0 + r1) // 2, (c0 + c1) // 2)
    whole: list[tuple[int, int, int, int]] = []
    while cells:
        while cells:
            r0, r1, c0, c1 = cell = cells.pop()
            for corner in product((r0, r1), (c0, c1)):
                known(*corner)
            if len(_kinds(cell, asked)) == 1:
                whole.append(cell)
            elif r1 - r0 > 1 or c1 - c0 > 1:
                rows, columns = (sorted({a, (a + b) // 2, b}) for a, b in ((r0, r1), (c0, c1)))
                cells += [(*r, *c) for r, c in product(pairwise(rows), pairwise(columns))]
        # What a neighbour found on a common border may tell that a cell is not whole after all.
        cells = [cell for cell in whole if len(_kinds(cell, asked)) > 1]
        whole = [cell for cell in whole if cell not in cells]
    for r0, r1, c0, c1 in whole:
        value = asked[r0, c0]
        for point in product(range(r0, r1 + 1), range(c0, c1 + 1)):
            found[point] = value
    for point, value in asked.items():
        found[point] = value
    return found


def _kinds(cell: tuple[int, int, int, int], asked: dict[tuple[int, int], Any]) -> set[Any]:
    r0, r1, c0, c1 = cell
    points = product(range(r0, r1 + 1), range(c0, c1 + 1))
    return {asked[point] for point in points if point in asked}


@functools.lru_cache(maxsize=4)
def _prepared(scenario: str) -> tuple[Rig, Vector]:
    from sim.bridge.run import build_rig

    rig = build_rig(from_toml(scenario))
    try:
        return rig, rig.settled(SETTLING, KEPT).mean(axis=0)
    except Fell as fall:
        raise UserError(f"no basin: the undisturbed walk {fall}") from fall


def _try(
    rig: Rig, periodic: Vector, offset: Vector, force: float, epsilon: float, steps: int
) -> tuple[Fate, int, float]:
    tape = rig.sections()
    seen = 0

    @Patient
    def converged() -> str | None:
        nonlocal seen
        if len(tape.states) == seen:
            return None
        seen = len(tape.states)
        return "converged" if distance(tape.states[-1], periodic) < epsilon else None

    push = Push(force=force, body="torso", step=1)
    summary = rig.run(tape, q=rig.q_start + offset, pushes=(push,), steps=steps, stop=converged)
    fate = {
        Outcome.INTERRUPTED.value: Fate.CONVERGED,
        Outcome.COMPLETED.value: Fate.UNDECIDED,
    }.get(summary.outcome, Fate.FELL)
    return fate, summary.steps, summary.scuff_depth_m
