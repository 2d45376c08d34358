"""Solvers by name: `riccati`, or any that qpsolvers finds installed."""

import difflib

import qpsolvers

from controller.errors import UserError
from controller.qp.problem import Solver
from controller.qp.riccati_solver import RiccatiSolver
from controller.qp.sparse import SparseSolver

RICCATI = "riccati"
NEXT_IN_LINE = ("piqp", "clarabel")
"""Solvers that a problem goes to which `riccati` cannot settle."""


def available() -> tuple[str, ...]:
    """Names `make_solver` takes."""
    return (RICCATI, *sorted(qpsolvers.available_solvers))


def make_solver(name: str, N: int, r: int) -> Solver:
    """The solver of that name.

    Args:
        name: One of `available()`.
        N: Stages of the problems to come.
        r: Contact-force rows a stage.

    Raises:
        UserError: unknown or not installed solver.
    """
    if name not in available():
        near = difflib.get_close_matches(name, available(), n=1)
        guess = f"did you mean {near[0]}? " if near else ""
        raise UserError(f"controller.solver = {name!r}; {guess}must be one of {', '.join(available())}")
    if name == RICCATI:
        return RiccatiSolver(N, r, tuple(SparseSolver(other, N) for other in NEXT_IN_LINE))
    return SparseSolver(name, N)
