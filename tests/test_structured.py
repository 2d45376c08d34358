"""The solver `riccati` over many ticks: its memory makes it fast, never different."""

import dataclasses

import numpy as np
import oracle
import pytest

from controller.belief import Friction
from controller.belief.friction import ROWS
from controller.cmpc import CascadedMpc, predict
from controller.cmpc.program import Weights, build_problem
from controller.common.records import Leg, StanceState
from controller.qp import make_solver
from controller.qp import riccati_solver as structured
from controller.qp.problem import failed
from sim.interface import Observation

N, T = 30, 1e-3
MU = 0.2  # slippery


class Keeping:
    """Hands every problem on and keeps it."""

    def __init__(self, inner):
        self.inner, self.kept = inner, []

    def reset(self):
        self.inner.reset()

    def solve(self, problem):
        self.kept.append((problem, self.inner.solve(problem)))
        return self.kept[-1][1]


@pytest.fixture(scope="module")
def walk(model, walker, gait, gains):
    """(problem, answer) of 700 ticks of a belief that walks on slippery ground after a kick, through an impact."""
    solver = Keeping(make_solver("riccati", N, ROWS))
    controller = CascadedMpc(
        model,
        gait,
        gains,
        N=N,
        T=T,
        weights=Weights.of_paper(gains, T),
        friction=Friction(mu=MU, normal_min=20.0),
        solver=solver,
    )
    controller.reset("left")
    q, dq = gait.post_impact(model)
    dq = dq + np.array([0.0, 0.0, 0.0, 0.0, -0.3])
    left = True
    for k in range(700):
        contact = (True, False) if left else (False, True)
        body = (q, dq) if left else (oracle.R @ q, oracle.R @ dq)
        step = controller.step(Observation(t=k * T, q=body[0], dq=body[1], contact=contact))
        u = step.u_total if left else oracle.R[:4, :4] @ step.u_total
        ddq = model.acceleration(q, dq, u)
        q, dq = q + T * dq + 0.5 * T**2 * ddq, dq + T * ddq
        ahead, height, rate = model.swing_foot(q, dq)
        if ahead > 0 and height <= 0 and rate < 0:
            q, dq = model.impact(q, dq)
            left = not left
            controller.stance.reset("left" if left else "right")  # the solver is to remember, so not controller.reset
    assert not left
    return solver.kept


def test_every_tick_is_solved_to_optimality(walk):
    limits = [(p.lower, p.upper) for p, _ in walk]
    assert all(s.found and s.status == "optimal" for _, s in walk)
    assert all((s.u >= a - 1e-6).all() and (s.u <= b + 1e-6).all() for (a, b), (_, s) in zip(limits, walk, strict=True))
    assert max(oracle.excess(p, s.u) for p, s in walk) < 1e-6
    # The walk was not a stroll: torques at their limits, rows that bind, and ticks with neither.
    assert sum(s.active > 0 for _, s in walk) > 300 and sum(s.slack > 0 for _, s in walk) > 100
    assert sum(s.active == 0 for _, s in walk) > 50
    assert any(s.iterations > 10 for _, s in walk)  # the interior-point method had its turn


def test_memory_changes_speed_and_nothing_else(walk):
    """The same problem from a cold start has the same answer, to what the torque sensors of no robot see."""
    for problem, warm in walk[::10]:
        cold = make_solver("riccati", N, ROWS).solve(problem)
        assert cold.u == pytest.approx(warm.u, abs=1e-3)
    iterations = [s.iterations for _, s in walk]
    cold = [make_solver("riccati", N, ROWS).solve(p).iterations for p, _ in walk[::10]]
    assert np.median(iterations) <= np.median(cold)


def test_another_solver_has_the_same_answers(walk):
    for problem, warm in walk[::20]:
        other = make_solver("piqp", N, ROWS).solve(problem)
        assert problem.objective(warm.u) <= problem.objective(other.u) + 1e-5 * abs(problem.objective(other.u)) + 1e-6
        assert other.u[0] == pytest.approx(warm.u[0], abs=0.05)


def test_reset_forgets(walk):
    solver = make_solver("riccati", N, ROWS)
    first = [solver.solve(problem).u.tobytes() for problem, _ in walk[:100]]
    solver.reset()
    assert [solver.solve(problem).u.tobytes() for problem, _ in walk[:100]] == first


def test_an_answer_is_not_changed_by_the_next(walk):
    solver = make_solver("riccati", N, ROWS)
    answer = solver.solve(walk[0][0])
    kept = answer.u.copy()
    solver.solve(walk[-1][0])
    assert np.array_equal(answer.u, kept)


def test_the_problem_is_left_as_it_was(walk):
    problem, _ = walk[50]
    before = {name: np.array(value) for name, value in problem._asdict().items()}
    make_solver("riccati", N, ROWS).solve(problem)
    assert all(np.array_equal(getattr(problem, name), value) for name, value in before.items())


def test_box_and_rows_that_contradict_each_other(walk):
    """Rows that no torque can meet: the box holds, the softening says by how much, and the answer is the least bad."""
    problem, _ = walk[0]
    impossible = problem._replace(limits=problem.limits - 5000.0)
    solution = make_solver("riccati", N, ROWS).solve(impossible)
    assert solution.found and solution.slack > 1000.0
    assert (solution.u >= impossible.lower - 1e-6).all() and (solution.u <= impossible.upper + 1e-6).all()
    assert oracle.excess(impossible, solution.u) < 1e-6
    other = make_solver("clarabel", N, ROWS).solve(impossible)
    assert impossible.objective(solution.u) == pytest.approx(impossible.objective(other.u), rel=1e-6)


@pytest.mark.parametrize("stages", [1, 2, 7])
def test_short_horizons(loop, model, gains, walking_states, stages):
    for q, dq in walking_states(10, spread=0.05):
        horizon = predict(loop, StanceState(q=q, dq=dq, leg=Leg.LEFT), stages, T)
        problem = build_problem(
            horizon, Weights.of_paper(gains, T), model.torque_limits, Friction(mu=MU, normal_min=20.0)
        )
        ours, theirs = (make_solver(name, stages, ROWS).solve(problem) for name in ("riccati", "clarabel"))
        assert ours.found and oracle.excess(problem, ours.u) < 1e-6
        assert problem.objective(ours.u) <= problem.objective(theirs.u) + 1e-5 * abs(problem.objective(theirs.u)) + 1e-6


class Other:
    """A next solver in line that finds something, or nothing."""

    def __init__(self, found):
        self.found, self.calls = found, 0

    def reset(self):
        pass

    def solve(self, problem):
        self.calls += 1
        nothing = failed(N, "no-solution")
        return dataclasses.replace(nothing, found=True, status="optimal") if self.found else nothing


def test_what_it_can_not_settle_goes_to_the_next_in_line_and_is_said(walk):
    problem, _ = walk[0]
    nan = problem._replace(linear=np.full_like(problem.linear, np.nan))
    first, second, third = Other(False), Other(True), Other(True)
    solver = structured.RiccatiSolver(N, ROWS, (first, second, third))
    solution = solver.solve(nan)
    assert solution.found and solution.status == "second-solver"
    assert (first.calls, second.calls, third.calls) == (1, 1, 0)
    assert structured.RiccatiSolver(N, ROWS, (Other(False),)).solve(nan).status == "no-solution"
    assert solver.solve(problem).status == "optimal"  # and goes on as if nothing had been
