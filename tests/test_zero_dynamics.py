"""ZD+PD does to the outputs what Eqs. (6)-(9) promise, seen from outside the formula."""

import numpy as np
import oracle
import pytest
from scipy.linalg import expm

from controller.cmpc import ZeroDynamicsController
from controller.cmpc.zero_dynamics import zero_dynamics_pd
from controller.common.records import Leg
from sim.interface import Observation


def y_of(gait, q):
    return oracle.outputs(gait.alpha, gait.clock, gait.theta_plus, gait.theta_minus, q)


def test_torque_makes_the_outputs_accelerate_by_v(loop, walker, gait, gains, walking_states):
    """Second differences of y along q + h dq + h^2/2 ddq, with ddq from Pinocchio, are v of Eq. (9)."""
    h = 1e-4  # [s]
    for q, dq in walking_states(100, spread=0.05):
        step = zero_dynamics_pd(loop, q, dq)
        ddq = walker.acceleration(q, dq, step.u)
        before, now, after = (y_of(gait, q + t * dq + 0.5 * t * t * ddq) for t in (-h, 0.0, h))
        dy, ddy = (after - before) / (2 * h), (after - 2 * now + before) / h**2
        assert step.y == pytest.approx(now, abs=1e-11)
        scale = 1.0 + np.abs(dq).max() ** 3
        assert step.dy == pytest.approx(dy, abs=1e-5 * scale)
        v = -gains.kd * dy - gains.kp * now
        assert ddy == pytest.approx(v, abs=1e-4 * scale)


def test_torque_is_exactly_that_of_the_model(loop, walker, gait, gains, walking_states):
    """L_g L_f h u = v - L_f^2 h with both sides assembled in NumPy from Pinocchio's acceleration."""
    for q, dq in walking_states(100):
        step = zero_dynamics_pd(loop, q, dq)
        _, slope, curvature = gait.desired(gait.clock @ q)
        dh_dq = np.eye(4, 5) - np.outer(slope, gait.clock)
        ddy = dh_dq @ walker.acceleration(q, dq, step.u) - curvature * (gait.clock @ dq) ** 2
        v = -gains.kd * step.dy - gains.kp * step.y
        assert ddy == pytest.approx(v, rel=1e-7, abs=1e-7 * (1 + np.abs(step.u).max()))
        assert step.ddq == pytest.approx(walker.acceleration(q, dq, step.u), rel=1e-7, abs=1e-6)


def test_outputs_decay_as_the_gains_say(loop, model, gait, gains):
    """Along the continuous closed loop every output is that of ddy + K_D dy + K_P y = 0."""
    q, dq = gait.post_impact(model)
    q = q + np.array([0.03, -0.05, 0.04, 0.06, 0.0])
    start = zero_dynamics_pd(loop, q, dq)

    def flow(x):
        return np.concatenate([x[5:], zero_dynamics_pd(loop, x[:5], x[5:]).ddq])

    duration = 0.25  # [s]
    x = oracle.runge_kutta(flow, np.concatenate([q, dq]), duration, 500)
    end = zero_dynamics_pd(loop, x[:5], x[5:])
    for i in range(4):
        A = np.array([[0.0, 1.0], [-gains.kp[i], -gains.kd[i]]])
        assert (end.y[i], end.dy[i]) == pytest.approx(expm(A * duration) @ (start.y[i], start.dy[i]), abs=1e-7)


def test_on_the_gait_the_outputs_are_zero_at_any_speed(loop, gait, walking_states):
    """Posture and rates that follow from the clock and its rate alone, the zero dynamics, have no error."""
    for q, _ in walking_states(50, spread=0.0):
        theta = gait.clock @ q
        desired, slope, _ = gait.desired(theta)
        # On the zero dynamics: q_5 follows from theta = c q, the rates from the slope.
        on = np.append(desired, (theta - gait.clock[:4] @ desired) / gait.clock[4])
        rate = np.append(slope, (1.0 - gait.clock[:4] @ slope) / gait.clock[4])
        step = zero_dynamics_pd(loop, on, rate * 1.2)
        assert step.y == pytest.approx(np.zeros(4), abs=1e-11)
        assert step.dy == pytest.approx(np.zeros(4), abs=1e-10)
        assert (step.theta, step.dtheta) == pytest.approx((theta, 1.2))


def test_controller_speaks_body_order(model, gait, gains, walking_states):
    """Mirroring what is seen mirrors what is done."""
    left, right = (ZeroDynamicsController(model, gait, gains) for _ in range(2))
    left.reset("left")
    right.reset("right")
    for q, dq in walking_states(20):
        seen = Observation(t=0.0, q=q, dq=dq, contact=(True, False))
        mirrored = Observation(t=0.0, q=oracle.R @ q, dq=oracle.R @ dq, contact=(False, True))
        a, b = left.step(seen), right.step(mirrored)
        assert (a.stance, b.stance) == ("left", "right")
        assert np.array_equal(Leg.RIGHT.from_body(b.u_total), a.u_total)
        assert np.array_equal(b.y, a.y)
        assert np.array_equal(b.contact_force, a.contact_force)


def test_controller_reports_its_law(loop, model, walker, gait, gains, walking_states):
    controller = ZeroDynamicsController(model, gait, gains)
    controller.reset("left")
    for q, dq in walking_states(20):
        step = controller.step(Observation(t=0.0, q=q, dq=dq, contact=(True, False)))
        law = zero_dynamics_pd(loop, q, dq)
        assert np.array_equal(step.u_zd, law.u) and np.array_equal(step.u_total, law.u)
        assert not step.u_mpc.any() and not step.fallback and step.status == "zd-pd"
        force, _ = walker.stance_force(q, dq, law.u)
        assert step.contact_force == pytest.approx(force, rel=1e-9, abs=1e-7)
        assert step.s == pytest.approx(gait.normalised(step.theta))
