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
    """

    u: Array
    noise: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.u)


Search = Generator[Batch, Array, T]
"""Yields batches; is sent 1.0 for each point that falls, 0.0 for one that walks, NaN where there is no result, (k,)."""


def ask(points: Sequence[Array] | Array, noise: int | NDArray[np.int64] = 0) -> Batch:
    """A batch of points, rounded, under one realisation of the noise or one each."""
    u = np.round(np.atleast_2d(np.asarray(points, dtype=float)), DECIMALS)
    return Batch(u=u + 0.0, noise=np.broadcast_to(np.asarray(noise, dtype=np.int64), len(u)).copy())


def together(searches: Sequence[Search[T]]) -> Search[list[T]]:
    """Run several searches in step: each batch holds the next of every one that is not over."""
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


def answer(search: Search[T], falls: Callable[[Array], NDArray[np.bool_]]) -> tuple[T, int]:
    """Run a search on a limit state that can be computed at once; its end, and how many points it asked for.

    Args:
        search: The search.
        falls: Whether each point falls, (k, n) -> (k,).
    """
    asked = 0
    try:
        batch = next(search)
        while True:
            asked += len(batch)
            batch = search.send(falls(batch.u).astype(float))
    except StopIteration as end:
        found: T = end.value
        return found, asked
