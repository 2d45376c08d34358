"""C-MPC is the paper's problem: its cost, its rows, its box and its one policy when there is no answer."""

import numpy as np
import oracle
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.belief import Friction
from controller.belief.friction import ROWS
from controller.cmpc import CascadedMpc, predict
from controller.cmpc.program import Weights, build_problem
from controller.common.records import Leg, StanceState
from controller.qp import make_solver
from controller.qp.problem import failed
from sim.interface import Observation
from sim.scenario import ControllerSettings

T = 1e-3  # [s]
MU, NORMAL_MIN = 0.6, 20.0
FRICTION = Friction(mu=MU, normal_min=NORMAL_MIN)
SOLVER = ControllerSettings().solver
ROUNDING = 1e-6  # [N.m] at a bound


@pytest.fixture(scope="module")
def weights(gains):
    return Weights.of_paper(gains, T)


def horizon_at(loop, q, dq, N):
    return predict(loop, StanceState(q=q, dq=dq, leg=Leg.LEFT), N, T)


def solve(problem):
    N, r = problem.limits.shape
    return make_solver(SOLVER, N, r).solve(problem)


def seen(q, dq, contact=(True, False)):
    return Observation(t=0.0, q=q, dq=dq, contact=contact)


def cascade(model, gait, gains, *, solver=None, N=20, friction=FRICTION):
    found = CascadedMpc(
        model,
        gait,
        gains,
        N=N,
        T=T,
        weights=Weights.of_paper(gains, T),
        friction=friction,
        solver=solver or make_solver(SOLVER, N, ROWS if friction else 0),
    )
    found.reset("left")
    return found


def condensed(walker, horizon, weights):
    N = horizon.u.shape[0]
    DinvB = [np.linalg.solve(walker.pinned(x[:5], x[5:])[0], oracle.B) for x in horizon.x[:N]]
    return oracle.condensed(
        T=T,
        DinvB=np.array(DinvB),
        e=np.hstack([horizon.y, horizon.dy]),
        Q_position=weights.Q_position,
        Q_velocity=weights.Q_velocity,
        R_input=weights.R,
    )


# Cost, Eqs. (14)-(17)


def test_weights_are_those_of_section_iii_e(weights, gains):
    assert weights.Q_position == pytest.approx(2 * gains.kp / T**2)
    assert weights.Q_velocity == pytest.approx(gains.kd / T)
    assert np.array_equal(weights.R, np.ones(4))
    assert weights.Q_position[0] == pytest.approx(1.2e8)


def test_cost_is_that_of_the_full_stack(loop, model, walker, weights, walking_states):
    """J(U) of Eq. (17) from the dense 10-state stack of Eq. (15), up to the constant beta and a factor of 2."""
    rng = np.random.default_rng(0)
    for N in (1, 2, 20):
        for q, dq in walking_states(5, seed=N):
            horizon = horizon_at(loop, q, dq, N)
            M, alpha, beta = condensed(walker, horizon, weights)
            problem = build_problem(horizon, weights, model.torque_limits, None)
            for scale in (0.0, 1.0, 100.0):
                U = scale * rng.normal(size=4 * N)
                J = U @ M @ U + 2 * alpha @ U
                ours = 2 * problem.objective(U.reshape(N, 4))
                assert ours == pytest.approx(J, rel=1e-8, abs=1e-8 * (1 + abs(alpha @ U)))
            assert beta >= 0.0


def test_cost_holds_through_predicted_impacts(loop, model, walker, gait, weights):
    """Where the horizon crosses an impact, Eq. (15) is taken literally: the roles keep their columns."""
    q, dq = gait.q_minus - 0.01 * gait.dq_minus, gait.dq_minus
    horizon = horizon_at(loop, q, dq, 30)
    assert 0 < horizon.impact_in < 30
    M, alpha, _ = condensed(walker, horizon, weights)
    problem = build_problem(horizon, weights, model.torque_limits, None)
    U = np.random.default_rng(1).normal(size=120)
    assert 2 * problem.objective(U.reshape(30, 4)) == pytest.approx(U @ M @ U + 2 * alpha @ U, rel=1e-8)


def test_where_nothing_binds_the_answer_is_that_of_the_normal_equations(loop, model, walker, gait, weights):
    q, dq = gait.post_impact(model)
    for N in (5, 40):
        horizon = horizon_at(loop, q, dq, N)
        M, alpha, _ = condensed(walker, horizon, weights)
        free = np.linalg.solve(M, -alpha).reshape(N, 4)
        problem = build_problem(horizon, weights, np.full(4, 1e4), None)
        solution = solve(problem)
        assert solution.found and np.abs(free).max() < 9e3
        assert solution.u == pytest.approx(free, rel=1e-4, abs=1e-4 * np.abs(free).max())


def test_without_errors_the_mpc_stays_silent(loop, model, gait, weights):
    """Errors of zero cost nothing, so zero torque is the answer (a horizon with its errors taken out)."""
    horizon = horizon_at(loop, *gait.post_impact(model), 20)
    horizon = horizon._replace(y=0 * horizon.y, dy=0 * horizon.dy)
    problem = build_problem(horizon, weights, model.torque_limits, FRICTION)
    assert not problem.softening(np.zeros((20, 4))).any()
    assert np.abs(solve(problem).u).max() < 1e-4


# Rows and box, Eqs. (18)-(22)


def test_box_holds_the_total_torque(loop, model, weights, walking_states):
    for q, dq in walking_states(10):
        horizon = horizon_at(loop, q, dq, 20)
        problem = build_problem(horizon, weights, model.torque_limits, FRICTION)
        assert problem.lower + horizon.u == pytest.approx(np.tile(-model.torque_limits, (20, 1)), abs=1e-9)
        assert problem.upper + horizon.u == pytest.approx(np.tile(model.torque_limits, (20, 1)), abs=1e-9)
    assert np.array_equal(model.torque_limits, [75.0, 75.0, 50.0, 50.0])


def test_rows_are_equation_21(loop, model, walker, weights, walking_states):
    """For any torque the rows hold exactly where |F_T/F_N| <= mu and F_N >= its bound, F_c by Eq. (18)."""
    rng = np.random.default_rng(2)
    N, held, broken = 5, 0, 0
    for q, dq in walking_states(60, spread=0.03):
        horizon = horizon_at(loop, q, dq, N)
        problem = build_problem(horizon, weights, model.torque_limits, FRICTION)
        U = rng.uniform(-60, 60, (N, 4))
        softening = problem.softening(U)
        for k in range(N):
            x = horizon.x[k]
            (tangential, normal), _ = walker.stance_force(x[:5], x[5:], horizon.u[k] + U[k])
            excess = max(abs(tangential) - MU * normal, NORMAL_MIN - normal)
            assert softening[k].max() == pytest.approx(max(excess, 0.0), abs=1e-6 * (1 + abs(normal)))
            if abs(excess) < 1e-6:
                continue
            allowed = normal >= NORMAL_MIN and abs(tangential / normal) <= MU
            assert (softening[k].max() == 0.0) == allowed
            held, broken = held + allowed, broken + (not allowed)
    assert held > 30 and broken > 30  # both sides of every claim were seen


def test_rows_keep_the_planned_force_in_the_cone(loop, model, walker, weights, walking_states):
    """On slippery ground: without rows the plan slips, with them it does not, if Eq. (18) is asked."""
    N, mu = 20, 0.25
    slips = 0
    for q, dq in walking_states(8, spread=0.05):
        horizon = horizon_at(loop, q, dq, N)

        def excess(friction, horizon=horizon):
            """[N] of the worst stage."""
            problem = build_problem(horizon, weights, model.torque_limits, friction)
            U = horizon.u + solve(problem).u
            forces = [walker.stance_force(x[:5], x[5:], u)[0] for x, u in zip(horizon.x[:-1], U, strict=True)]
            return max(abs(tangential) - mu * normal for tangential, normal in forces)

        slips += excess(None) > 1.0
        assert excess(Friction(mu=mu, normal_min=NORMAL_MIN)) < 0.05
    assert slips >= 2


def test_rows_can_be_left_out(loop, model, gait, weights):
    horizon = horizon_at(loop, *gait.post_impact(model), 3)
    assert build_problem(horizon, weights, model.torque_limits, None).rows.shape == (3, 0, 4)


# The whole tick


@settings(max_examples=40)
@given(
    s=st.floats(0, 1),
    offset=st.tuples(*[st.floats(-0.4, 0.4)] * 5),
    kick=st.tuples(*[st.floats(-3, 3)] * 5),
)
def test_total_torque_is_always_within_the_motors(model, gait, gains, s, offset, kick):
    q0, dq0 = gait.post_impact(model)
    q = (1 - s) * q0 + s * gait.q_minus + np.array(offset)
    dq = (1 - s) * dq0 + s * gait.dq_minus + np.array(kick)
    controller = cascade(model, gait, gains, N=10)
    step = controller.step(seen(q, dq))
    assert np.isfinite(step.u_total).all()
    assert (np.abs(step.u_total) <= model.torque_limits + ROUNDING).all()
    assert step.u_total == pytest.approx(step.u_zd + step.u_mpc, abs=1e-9)  # Eq. (23)


def test_tick_is_the_sum_of_its_parts(loop, model, walker, gait, gains, weights, walking_states):
    """What the controller commands is ZD+PD plus the first stage of the solved problem, its force Eq. (20)'s."""
    N = 20
    controller = cascade(model, gait, gains, N=N)
    for q, dq in walking_states(5, spread=0.02):
        step = controller.step(seen(q, dq))
        horizon = horizon_at(loop, q, dq, N)
        solution = solve(build_problem(horizon, weights, model.torque_limits, FRICTION))
        assert step.status == "optimal" and not step.fallback
        assert step.u_zd == pytest.approx(horizon.u[0])
        assert step.u_mpc == pytest.approx(solution.u[0], abs=1e-3)
        force, _ = walker.stance_force(q, dq, step.u_total)
        assert step.contact_force == pytest.approx(force, rel=1e-7, abs=1e-5)
        assert step.impact_in == horizon.impact_in
        assert (step.y, step.dy) == (pytest.approx(horizon.y[0]), pytest.approx(horizon.dy[0]))


def test_mirrored_walker_gets_mirrored_torque(model, gait, gains, walking_states):
    left, right = cascade(model, gait, gains), cascade(model, gait, gains)
    right.reset("right")
    for q, dq in walking_states(5, spread=0.05):
        a = left.step(seen(q, dq))
        b = right.step(seen(oracle.R @ q, oracle.R @ dq, (False, True)))
        assert (a.stance, b.stance) == ("left", "right")
        assert Leg.RIGHT.from_body(b.u_total) == pytest.approx(a.u_total, abs=1e-6)


class NoAnswer:
    """A solver that finds nothing and counts its calls."""

    def __init__(self, N):
        self.N, self.calls = N, 0

    def reset(self):
        self.calls = 0

    def solve(self, problem):
        self.calls += 1
        return failed(self.N, "no-solution")


def test_without_an_answer_the_tick_is_saturated_zd_pd(model, gait, gains, walking_states):
    solver = NoAnswer(20)
    controller = cascade(model, gait, gains, solver=solver)
    saturated = 0
    for q, dq in walking_states(30):
        step = controller.step(seen(q, dq))
        clipped = np.clip(step.u_zd, -model.torque_limits, model.torque_limits)
        assert step.u_total == pytest.approx(clipped, abs=1e-9)
        assert step.fallback and step.status == "no-solution"
        saturated += bool((clipped != step.u_zd).any())
    assert solver.calls == 30 and saturated > 5


def test_a_diverged_prediction_asks_no_solver(model, gait, gains):
    solver = NoAnswer(20)
    controller = cascade(model, gait, gains, solver=solver)
    q, dq = gait.post_impact(model)
    step = controller.step(seen(q, 1e4 * dq))
    assert step.fallback and step.status != "optimal" and solver.calls == 0
    assert (np.abs(step.u_total) <= model.torque_limits + ROUNDING).all()
