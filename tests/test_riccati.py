"""Riccati sweeps against dense matrices, and the methods on top of them against each other, on random problems."""

import numpy as np
import pytest

from controller.qp import StageQP, active_set, interior_point, make_solver, riccati
from controller.qp import riccati_solver as structured
from controller.qp.compare import ComparingSolver, compare_solvers, exact_clarabel, refined
from controller.qp.residuals import residuals
from controller.qp.sparse import SparseSolver

N, R = 12, 3


def random_problem(rng, *, tight=1.0, conflict=False, n=N):
    """A stage problem with the structure and roughly the sizes of a walking one."""
    rows = rng.normal(0.0, 2.0, (n, R, 4))
    limits = rng.normal(30.0 * tight, 30.0 * tight, (n, R))
    centre = rng.normal(0.0, 60.0 if conflict else 10.0, (n, 4))
    if conflict:
        rows[:, 1] = -rows[:, 0] + 0.1 * rng.normal(size=(n, 4))
        limits[:, 0] = limits[:, 1] = -20.0  # the two rows contradict each other
    return StageQP(
        rate=1e-3 * rng.normal(0.0, 3.0, (n, 4, 4)),
        weight=np.arange(1, n + 1)[:, None] * np.array([1e4, 2e4, 2e4, 1e4]),
        linear=np.arange(1, n + 1)[:, None] * rng.normal(0.0, 2e3, (n, 4)),
        R=np.ones(4),
        lower=-60.0 * tight + centre,
        upper=60.0 * tight + centre,
        rows=rows,
        limits=limits,
        penalty=1e5,
    )


def dense(problem, weight_u, Omega):
    """Matrix and input-to-rate map of the Newton system, all stages stacked."""
    n = problem.N
    G = np.zeros((4 * n, 4 * n))
    for k in range(n):
        for j in range(k + 1):
            G[4 * k : 4 * k + 4, 4 * j : 4 * j + 4] = problem.rate[j]
    H = G.T @ np.diag(problem.weight.ravel()) @ G + np.diag(weight_u.ravel())
    for k in range(n):
        at = slice(4 * k, 4 * k + 4)
        H[at, at] += problem.rows[k].T @ np.diag(Omega[k]) @ problem.rows[k]
    return H, G


@pytest.mark.parametrize("seed", range(5))
def test_a_sweep_is_the_dense_newton_step(seed):
    rng = np.random.default_rng(seed)
    problem = random_problem(rng)
    p, factors = problem, riccati.new_factors(N)
    weight_u, Omega = rng.uniform(1.0, 50.0, (N, 4)), rng.uniform(0.0, 1e3, (N, R)) * (rng.random((N, R)) < 0.5)
    fixed = rng.choice(np.array([-1, 0, 0, 1], dtype=np.int8), (N, 4))
    given, a, b = rng.normal(size=(3, N, 4))
    du, again, dw = np.empty((3, N, 4))
    terms = riccati.Terms(fixed, given, weight_u, Omega, a, b)
    riccati.newton_step(p, terms, factors, du, dw, N - 1)
    riccati.step(p, terms, factors, again, dw)  # from the factors kept

    H, G = dense(problem, weight_u, Omega)
    gradient = G.T @ a.ravel() + b.ravel()
    free = fixed.ravel() == 0
    expected = given.ravel().copy()
    expected[free] = np.linalg.solve(H[np.ix_(free, free)], -(gradient + H[:, ~free] @ expected[~free])[free])
    np.testing.assert_allclose(du.ravel(), expected, rtol=1e-8, atol=1e-9)
    np.testing.assert_array_equal(again, du)
    np.testing.assert_allclose(dw.ravel(), G @ du.ravel(), rtol=1e-9, atol=1e-12)


def test_the_gradient_is_that_of_the_objective():
    rng = np.random.default_rng(3)
    problem = random_problem(rng)
    p, u = problem, rng.normal(0.0, 20.0, (N, 4))
    w, gradient = np.empty((2, N, 4))
    riccati.rates(p, u, w)
    riccati.smooth_gradient(p, u, w, gradient)
    guess = active_set.Guess(np.zeros((N, 4), np.int8), np.zeros((N, R), np.bool_))
    active_set.correct(p, guess, u, gradient)  # adds the share of the contact-force rows
    for k, i in [(0, 0), (5, 2), (N - 1, 3)]:
        step = np.zeros((N, 4))
        step[k, i] = 1e-4
        slope = (problem.objective(u + step) - problem.objective(u - step)) / 2e-4
        assert slope == pytest.approx(gradient[k, i], rel=1e-5, abs=1e-2)


@pytest.mark.parametrize("conflict", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_active_set_and_interior_point_find_the_same_answer(seed, conflict):
    rng = np.random.default_rng(100 + seed)
    problem = random_problem(rng, conflict=conflict)
    p = problem
    exact = make_solver("riccati", N, R).solve(problem)
    assert exact.found and exact.residuals[1] < 1e-6

    point, newton = interior_point.new_point(N, R), interior_point.new_newton(N, R)
    scale = interior_point.start(p, point, False, newton)
    tolerance = structured.INTERIOR_TOLERANCES[-1]
    assert interior_point.minimise(p, point, scale, newton, tolerance, 60) > 0
    np.testing.assert_allclose(point.u, exact.u, atol=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_the_answer_is_clarabels(seed):
    problem = random_problem(np.random.default_rng(200 + seed), conflict=seed % 2 == 1)
    own, other = make_solver("riccati", N, R).solve(problem), exact_clarabel(N).solve(problem)
    np.testing.assert_allclose(own.u, other.u, atol=1e-3)
    best = problem.objective(other.u)
    assert problem.objective(own.u) <= best + 1e-9 * abs(best)


@pytest.mark.parametrize("conflict", [False, True])
def test_a_refined_answer_of_clarabel_is_ours_to_rounding(conflict):
    problem = random_problem(np.random.default_rng(300), conflict=conflict)
    own = make_solver("riccati", N, R).solve(problem).u
    rough = SparseSolver("clarabel", N, tol_gap_abs=1e-7, tol_gap_rel=1e-7, tol_feas=1e-7).solve(problem).u
    assert np.abs(own - rough).max() > 1e-7
    np.testing.assert_allclose(refined(problem, rough), own, rtol=0.0, atol=1e-7)


def test_residuals_bound_the_distance_to_the_optimum():
    rng = np.random.default_rng(10)
    problem = random_problem(rng, tight=0.3)
    p = problem
    exact = make_solver("riccati", N, R).solve(problem).u
    near = np.clip(exact + 1e-3 * rng.normal(size=exact.shape), problem.lower, problem.upper)
    w, gradient = np.empty((2, N, 4))
    riccati.rates(p, near, w)
    riccati.smooth_gradient(p, near, w, gradient)
    guess = active_set.Guess(np.zeros((N, 4), np.int8), np.zeros((N, R), np.bool_))
    active_set.correct(p, guess, near, gradient)
    found = residuals(p, near, gradient, 1e-7)
    assert found.feasibility == 0.0
    assert np.sqrt(near.size) * found.stationarity >= np.linalg.norm(near - exact)


def test_comparing_walks_on_the_first_and_keeps_the_books():
    problems = [random_problem(np.random.default_rng(20 + k), tight=0.3) for k in range(4)]
    both = ComparingSolver(make_solver("riccati", N, R), exact_clarabel(N), keep_every=2)
    answers = [both.solve(problem).u for problem in problems]
    for problem, u in zip(problems, answers, strict=True):
        np.testing.assert_array_equal(u, make_solver("riccati", N, R).solve(problem).u)
    assert (both.problems, both.active, len(both.kept)) == (4, 4, 2)
    assert both.torque_gap < 1e-3 and both.objective_gap < 1e-6 and both.violation == 0.0
    table = compare_solvers(("riccati", "clarabel"), both.kept)
    assert table["riccati"]["gap_Nm"] == 0.0 and table["clarabel"]["gap_Nm"] < 1e-2
    assert all(row["failed"] == 0 and row["median_ms"] > 0 for row in table.values())
