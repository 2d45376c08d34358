"""How a search asks: it yields points of standard normal space and is told which of them fall.

A search is a generator, so that whoever runs the walks decides where and when: batch after batch, on any number of
workers, today or after a kill. Points are rounded on their way out, so that the same search asks the same on machines
whose linear algebra differs in the last digit.
"""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
T = TypeVar("T")

DECIMALS = 4
"""Of a coordinate in standard normal space."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batch:
    """Points to try, all of which can be tried at once.

    Attributes:
        u: Points in standard normal space, (k, n).
        noise: Number of the realisation of everything that is random within a walk, (k,).
        guided: Whether the answers are to hold the walks' least margins too, in a second column.
    """

    u: Array
    noise: NDArray[np.int64]
    guided: bool = False

    def __len__(self) -> int:
        return len(self.u)


Search = Generator[Batch, Array, T]
"""Yields batches; is sent 1.0 for each point that falls, 0.0 for one that walks, NaN where there is no result, (k,);
for a guided batch (k, 2), with a walk's least margin in the second column, NaN where there is none."""


def ask(points: Sequence[Array] | Array, noise: int | NDArray[np.int64] = 0, *, guided: bool = False) -> Batch:
    """A batch of points, rounded, under one realisation of the noise or one each."""
    u = np.round(np.atleast_2d(np.asarray(points, dtype=float)), DECIMALS)
    return Batch(u=u + 0.0, noise=np.broadcast_to(np.asarray(noise, dtype=np.int64), len(u)).copy(), guided=guided)


def together(searches: Sequence[Search[T]]) -> Search[list[T]]:
    """Run several searches in step, none of them guided: each batch holds the next of every one that is not over."""
    found: dict[int, T] = {}
    waiting: dict[int, Batch] = {}

    def go_on(number: int, answers: Array | None) -> None:
        waiting.pop(number, None)
        try:
            batch = next(searches[number]) if answers is None else searches[number].send(answers)
        except StopIteration as end:
            found[number] = end.value
        else:
            waiting[number] = batch

    for number in range(len(searches)):
        go_on(number, None)
    while waiting:
        parts = dict(waiting)
        answers = yield Batch(
            u=np.concatenate([part.u for part in parts.values()]),
            noise=np.concatenate([part.noise for part in parts.values()]),
        )
        start = 0
        for number, part in parts.items():
            go_on(number, answers[start : start + len(part)])
            start += len(part)
    return [found[number] for number in range(len(searches))]


def answer(
    search: Search[T], falls: Callable[[Array], NDArray[np.bool_]], margin: Callable[[Array], Array] | None = None
) -> tuple[T, int]:
    """Run a search on a limit state that can be computed at once; its end, and how many points it asked for.

    Args:
        search: The search.
        falls: Whether each point falls, (k, n) -> (k,).
        margin: Least margin of each walk, (k, n) -> (k,), for guided searches; NaN without.
    """
    asked = 0
    try:
        batch = next(search)
        while True:
            asked += len(batch)
            fell = falls(batch.u).astype(float)
            margins = np.full(len(fell), np.nan) if margin is None else margin(batch.u)
            batch = search.send(np.column_stack((fell, margins)) if batch.guided else fell)
    except StopIteration as end:
        found: T = end.value
        return found, asked
