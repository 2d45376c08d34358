"""The stage-structured quadratic program of Eq. (22) and its solvers."""

from controller.qp.problem import Solution, Solver, StageQP
from controller.qp.solvers import make_solver

__all__ = [
    "Solution",
    "Solver",
    "StageQP",
    "make_solver",
]
