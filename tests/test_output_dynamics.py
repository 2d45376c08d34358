"""Eq. (6) as the rivals use it, against the cascade's own law and Pinocchio's contact force."""

import numpy as np
import pytest

from controller.cmpc.zero_dynamics import zero_dynamics_pd
from controller.rivals.output_dynamics import output_dynamics


def test_the_torque_for_the_pd_law_is_that_of_zd_pd(loop, model, gait, gains, walking_states):
    """Two ways to Eq. (7): a 4 x 4 system here, a scalar one in the kernel of ZD+PD."""
    for q, dq in walking_states(100):
        dynamics, zd = output_dynamics(model.lumped, gait.table, q, dq), zero_dynamics_pd(loop, q, dq)
        assert (dynamics.theta, dynamics.dtheta) == (zd.theta, zd.dtheta)
        assert np.array_equal(dynamics.y, zd.y) and np.array_equal(dynamics.dy, zd.dy)
        u = dynamics.torque(-gains.kd * dynamics.dy - gains.kp * dynamics.y)
        assert u == pytest.approx(zd.u, rel=1e-8, abs=1e-7)
        force = dynamics.force + dynamics.force_per_torque @ u
        assert force == pytest.approx(zd.contact_force, rel=1e-7, abs=1e-6)


def test_acceleration_of_the_outputs_is_affine_in_the_torque(model, walker, gait, walking_states):
    """L_f^2 h + L_g L_f h u against second differences of y under Pinocchio's acceleration."""
    rng = np.random.default_rng(3)
    h = 1e-4  # [s]
    for q, dq in walking_states(50, seed=1, spread=0.05):
        u = rng.uniform(-50, 50, 4)
        dynamics, ddq = output_dynamics(model.lumped, gait.table, q, dq), walker.acceleration(q, dq, u)
        y = [output_dynamics(model.lumped, gait.table, q + t * dq + 0.5 * t * t * ddq, dq).y for t in (-h, 0.0, h)]
        ddy = (y[2] - 2 * y[1] + y[0]) / h**2
        scale = 1.0 + np.abs(dq).max() ** 3
        assert dynamics.drift + dynamics.decoupling @ u == pytest.approx(ddy, rel=1e-5, abs=1e-4 * scale)


def test_overflow_is_seen(model, gait):
    q, dq = gait.post_impact(model)
    assert output_dynamics(model.lumped, gait.table, q, dq).is_finite
    assert not output_dynamics(model.lumped, gait.table, q, dq * 1e200).is_finite
