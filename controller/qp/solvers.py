"""Solvers by name: `riccati`, or any that qpsolvers finds installed."""

import difflib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from controller.common.errors import UserError
from controller.qp.problem import Solver
from controller.qp.riccati_solver import RiccatiSolver

if TYPE_CHECKING:
    from controller.qp.sparse import SparseSolver

RICCATI = "riccati"
NEXT_IN_LINE = ("piqp", "clarabel")
"""Solvers that a problem goes to which `riccati` cannot settle."""


def available() -> tuple[str, ...]:
    """Names `make_solver` takes."""
    import qpsolvers  # a third of a second, and a run with `riccati` hardly ever needs it

    return (RICCATI, *sorted(qpsolvers.available_solvers))


class _NextInLine:
    """The solvers behind `riccati`, made when one is asked for the first time."""

    def __init__(self, N: int) -> None:
        self._N = N
        self._made: dict[str, SparseSolver] = {}

    def __iter__(self) -> Iterator[Solver]:
        for name in NEXT_IN_LINE:
            if name not in self._made:
                from controller.qp.sparse import SparseSolver

                self._made[name] = SparseSolver(name, self._N)
            yield self._made[name]


def make_solver(name: str, N: int, r: int) -> Solver:
    """The solver of that name.

    Args:
        name: One of `available()`.
        N: Stages of the problems to come.
        r: Contact-force rows a stage.

    Raises:
        UserError: unknown or not installed solver.
    """
    if name == RICCATI:
        return RiccatiSolver(N, r, _NextInLine(N))
    if name not in available():
        near = difflib.get_close_matches(name, available(), n=1)
        guess = f"did you mean {near[0]}? " if near else ""
        raise UserError(f"controller.solver = {name!r}; {guess}must be one of {', '.join(available())}")
    from controller.qp.sparse import SparseSolver

    return SparseSolver(name, N)
