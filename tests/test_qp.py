"""The solver boundary: answers meet the optimality conditions, solvers agree, and no answer is said to be none."""

import numpy as np
import oracle
import pytest

from controller.belief import Friction
from controller.cmpc import predict
from controller.cmpc.program import Weights, build_problem
from controller.common.errors import UserError
from controller.common.records import Leg, StanceState
from controller.qp import StageQP, make_solver
from controller.qp.problem import failed
from sim.scenario import ControllerSettings

N, T = 20, 1e-3
DEFAULT = ControllerSettings().solver
SOLVERS = sorted({DEFAULT, "clarabel", "piqp"})


def problem_at(loop, model, q, dq, mu=0.6):
    horizon = predict(loop, StanceState(q=q, dq=dq, leg=Leg.LEFT), N, T)
    rows = Friction(mu=mu, normal_min=20.0) if mu else None
    return build_problem(horizon, Weights.of_paper(loop.gains, T), model.torque_limits, rows)


@pytest.fixture(scope="module")
def problems(loop, model, gait, walking_states) -> list[StageQP]:
    """From the undisturbed gait to states where torques saturate and, on slippery ground, rows bind."""
    start = gait.post_impact(model)
    states = [start, (start[0], 1.35 * start[1]), *walking_states(3, spread=0.02), *walking_states(3, spread=0.1)]
    found = [problem_at(loop, model, q, dq) for q, dq in states]
    slippery = [problem_at(loop, model, q, dq, mu=0.25) for q, dq in walking_states(8, spread=0.05)]
    return found + slippery


def solver_for(name, problem):
    N, r = problem.limits.shape
    return make_solver(name, N, r)


def test_gradient_is_that_of_the_objective(problems):
    rng = np.random.default_rng(0)
    for problem in problems:
        u, d = rng.uniform(-30, 30, (N, 4)), rng.normal(size=(N, 4))
        h = 1e-5
        slope = (problem.objective(u + h * d) - problem.objective(u - h * d)) / (2 * h)
        assert np.sum(oracle.gradient(problem, u) * d) == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize("name", SOLVERS)
def test_answers_are_optimal_to_a_bound(problems, name):
    """F is convex, so no point v of the box is better than u by more than max over v of grad f(u) (u - v)."""
    solver = solver_for(name, problems[0])
    at_bound = rows_bind = 0
    for problem in problems:
        solution = solver.solve(problem)
        assert solution.found and solution.status == "optimal"
        u = solution.u
        assert (u >= problem.lower).all() and (u <= problem.upper).all()
        assert 0.0 <= oracle.excess(problem, u) < 2e-5
        at_bound += int((np.minimum(u - problem.lower, problem.upper - u) < 1e-4).sum())
        rows_bind += solution.slack > 1e-6
    assert at_bound > 100 and rows_bind > 2  # these constraints were really met


@pytest.mark.parametrize("name", SOLVERS)
def test_no_neighbour_is_better(problems, name):
    rng = np.random.default_rng(1)
    for problem in problems:
        u = solver_for(name, problem).solve(problem).u
        for size in (1e-2, 1.0):
            other = np.clip(u + size * rng.normal(size=(N, 4)), problem.lower, problem.upper)
            assert problem.objective(other) > problem.objective(u) - 1e-6 * oracle.gain(problem, u)


def test_solvers_agree(problems):
    for problem in problems:
        answers = [solver_for(name, problem).solve(problem).u for name in SOLVERS]
        costs = [problem.objective(u) for u in answers]
        assert max(costs) - min(costs) <= 1e-5 * oracle.gain(problem, answers[0])
        for u in answers[1:]:
            assert u[0] == pytest.approx(answers[0][0], abs=0.1)  # [N.m]


def test_an_active_set_solver_agrees_where_it_manages(loop, model, gait):
    problem = problem_at(loop, model, *gait.post_impact(model), mu=None)
    theirs = solver_for("daqp", problem).solve(problem)
    ours = solver_for(DEFAULT, problem).solve(problem)
    assert theirs.found
    assert ours.u == pytest.approx(theirs.u, abs=1e-2)


@pytest.mark.parametrize("name", SOLVERS)
def test_softening_and_active_constraints_are_reported(problems, name):
    for problem in problems:
        solution = solver_for(name, problem).solve(problem)
        assert solution.slack == pytest.approx(problem.softening(solution.u).max(), abs=1e-6)
        bound = np.minimum(solution.u - problem.lower, problem.upper - solution.u) < 1e-4
        assert solution.active >= bound.sum()
        assert solution.solve_s > 0.0
        assert solution.residuals.shape == (3,) and np.isfinite(solution.residuals).all()


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.filterwarnings("error")
def test_no_answer_is_said_to_be_none(problems, name):
    """A box without inside, and numbers that are none: found is False, torques are zeros, nothing is raised."""
    solver, good = solver_for(name, problems[0]), problems[0]
    empty = good._replace(lower=good.upper + 1.0)
    nan = good._replace(linear=np.full_like(good.linear, np.nan))
    for problem in (empty, nan):
        solution = solver.solve(problem)
        assert not solution.found and solution.status != "optimal"
        assert not solution.u.any() and solution.u.shape == (N, 4)
    assert solver.solve(good).found  # and the solver is none the worse


def test_failed_must_not_be_used():
    solution = failed(3, "why")
    assert not solution.found and solution.status == "why"
    assert not solution.u.any() and np.isinf(solution.residuals).all()


def test_an_unknown_solver_is_refused_with_the_known_ones():
    with pytest.raises(UserError, match=r"controller\.solver = 'cplexx'.*riccati.*clarabel.*piqp"):
        make_solver("cplexx", N, 3)


@pytest.mark.parametrize("name", SOLVERS)
def test_same_problem_same_bytes(problems, name):
    for problem in problems[:3]:
        first, second = (solver_for(name, problem).solve(problem).u for _ in range(2))
        assert first.tobytes() == second.tobytes()
