"""Derivatives of the second cascade against finite differences: closed loop, impact map, horizon, and its sweep."""

import dataclasses

import numpy as np
import pytest

from controller.belief import Loop, kernels
from controller.belief.closed_loop import closed_loop, outputs
from controller.belief.ground import Ground
from controller.ltv.coordinates import N_Z, from_output, to_output
from controller.ltv.horizon import Outlook, look_ahead, new_horizon
from controller.ltv.landing import impact_jacobian
from controller.ltv.linearisation import derive, new_derivatives
from controller.ltv.motion import accelerate

STEP = 1e-6
LEVEL = Ground(0.0, 0.0)
ANY = np.full(4, np.inf)  # [N.m] torque limits
Z = np.eye(N_Z)


@pytest.fixture(params=[np.inf, 0.5], ids=["endless", "tangents"])
def bent(gait, request):
    """The gait as it is, and with outputs that go on along their tangents from the middle of the step."""
    return dataclasses.replace(gait, table=gait.table._replace(s_last=request.param))


def relative(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


def z_of(gait, q, dq):
    z = np.empty(N_Z)
    to_output(gait.table, q, dq, kernels.new_stage(), z)
    return z


def state_of(gait, z):
    q, dq = np.empty(5), np.empty(5)
    from_output(gait.table, z, q, dq)
    return q, dq


def closed_loop_of(model, bent, gains):
    """z, u_mpc -> dz/dt, ZD+PD torque and contact force, stacked; with the stage it was evaluated in."""
    loop = Loop(model.lumped, bent.table, gains)

    def at(z, u_mpc):
        stage, f, force, per_torque = kernels.new_stage(), np.empty(N_Z), np.empty(2), np.empty((2, 4))
        q, dq = state_of(bent, z)
        kernels.place(q, dq, stage)
        _, dtheta = closed_loop(loop, q, dq, stage)
        kernels.stance_force(model.lumped, stage, force)
        accelerate(loop, dtheta, u_mpc, stage, f)
        kernels.responses(stage)
        kernels.stance_force_per_torque(model.lumped, stage, per_torque)
        return np.r_[f, stage.u, force + per_torque @ u_mpc], stage

    return at


@pytest.fixture
def acceleration(model, bent, gains):
    return closed_loop_of(model, bent, gains)


def test_output_coordinates_are_a_bijection(bent, walking_states):
    for q, dq in walking_states(20, spread=0.3):
        again = state_of(bent, z_of(bent, q, dq))
        np.testing.assert_allclose(again[0], q, atol=1e-12)
        np.testing.assert_allclose(again[1], dq, atol=1e-11)


def test_the_vector_field_is_the_models(model, bent, gains, acceleration, walking_states):
    """dz/dt in output coordinates is what the model's acceleration says."""
    for q, dq in walking_states(10, seed=1):
        z, u_mpc = z_of(bent, q, dq), np.array([5.0, -3.0, 2.0, 1.0])
        values, stage = acceleration(z, u_mpc)
        h = 1e-6
        ddq = model.acceleration(q, dq, stage.u + u_mpc)
        forth = z_of(bent, q + h * dq + h * h / 2 * ddq, dq + h * ddq)
        back = z_of(bent, q - h * dq + h * h / 2 * ddq, dq - h * ddq)
        np.testing.assert_allclose(values[:N_Z], (forth - back) / (2 * h), rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(values[N_Z + 4 :], model.stance_force(q, dq, stage.u + u_mpc)[0], rtol=1e-9)


@pytest.mark.parametrize("u_mpc", [np.zeros(4), np.array([20.0, -10.0, 15.0, 5.0])], ids=["zd-pd", "with-mpc"])
def test_derivatives_of_the_closed_loop(model, bent, gains, acceleration, walking_states, u_mpc):
    for q, dq in walking_states(5, seed=2):
        z = z_of(bent, q, dq)
        by_z = np.array([(acceleration(z + STEP * e, u_mpc)[0] - acceleration(z - STEP * e, u_mpc)[0]) for e in Z]).T
        by_z /= 2 * STEP
        by_u = np.array([acceleration(z, u_mpc + e)[0] - acceleration(z, u_mpc)[0] for e in np.eye(4)]).T
        _, stage = acceleration(z, u_mpc)
        d = new_derivatives()
        derive(Loop(model.lumped, bent.table, gains), z[8], z[9], u_mpc, stage, d)
        ddy_z = np.hstack([-np.diag(gains.kp), -np.diag(gains.kd), np.zeros((4, 2))])
        ddy_z[:, [0, 1, 2, 3, 8]] += d.output_z
        assert relative(ddy_z, by_z[4:8]) < 1e-7
        assert relative(d.clock, by_z[9]) < 1e-7
        assert relative(d.torque, by_z[10:14]) < 1e-7
        assert relative(d.force, by_z[14:]) < 1e-7
        assert relative(d.output_u, by_u[4:8]) < 1e-9
        assert relative(d.clock_u, by_u[9]) < 1e-9
        assert relative(d.force_u, by_u[14:]) < 1e-9


def test_derivative_of_the_impact(model, gait):
    rng = np.random.default_rng(3)
    stage = kernels.new_stage()

    def impact(z):
        q, dq = model.impact(*state_of(gait, z))
        return z_of(gait, q, dq)

    for _ in range(5):
        z = z_of(gait, gait.q_minus, gait.dq_minus) + rng.normal(0.0, 0.05, N_Z)
        expected = np.array([impact(z + STEP * e) - impact(z - STEP * e) for e in Z]).T / (2 * STEP)
        q, dq = state_of(gait, z)
        kernels.place(q, dq, stage)
        outputs(gait.table, q, dq, stage)
        found = np.empty((N_Z, N_Z))
        impact_jacobian(model.lumped, gait.table, q, dq, stage, found)
        assert relative(found, expected) < 1e-7


@pytest.fixture
def rollout(loop, gait):
    """z, plan, ground -> horizon."""

    def roll(z, plan, ground=LEVEL, linearise=False, h=2.5e-3, substeps=2, limit=ANY):
        out = new_horizon(len(plan))
        q, dq = state_of(gait, z)
        look_ahead(Outlook(loop, limit, ground, h, substeps, q, dq), plan, linearise, out)
        return out

    return roll


def test_the_plain_rollout_is_the_linearised_ones(gait, model, rollout):
    z = z_of(gait, *gait.post_impact(model)) + 0.02
    plan = np.random.default_rng(4).normal(0.0, 5.0, (120, 4))
    plain, full = rollout(z, plan), rollout(z, plan, linearise=True)
    assert plain.exchange.any()
    for name in ("z", "u", "force", "exchange"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(full, name))


def before_impact(gait, rollout, plan, ground=LEVEL):
    """A disturbed state 12 stages before an impact."""
    z = z_of(gait, gait.q_minus, gait.dq_minus)
    z[8] -= 0.06
    z[9] = 1.1
    z[:4] += [0.02, -0.01, 0.03, -0.04]
    assert rollout(z, plan, ground).exchange.sum() == 1
    return z


@pytest.mark.parametrize("tangent", [0.0, 0.02, -0.05], ids=["level", "uphill", "downhill"])
def test_the_horizon_predicts_what_a_change_does_through_an_impact(gait, rollout, tangent):
    """End of the horizon by its beginning and by every stage's torque; the error falls with the integration step."""
    rng = np.random.default_rng(5)
    ground = Ground(tangent, 0.0)
    plan = rng.normal(0.0, 3.0, (24, 4))
    errors = []
    for substeps in (2, 8):
        h = 5e-3 / substeps
        z = before_impact(gait, rollout, plan, ground)
        full = rollout(z, plan, ground, True, h, substeps)
        A, B = full.AB[:, :, :N_Z], full.AB[:, :, N_Z:]
        dz, du = rng.normal(0.0, 1.0, N_Z), rng.normal(0.0, 30.0, plan.shape)
        predicted = dz.copy()
        for k in range(len(plan)):
            predicted = A[k] @ predicted + B[k] @ du[k]
        step = 1e-6
        forth = rollout(z + step * dz, plan + step * du, ground, False, h, substeps).z[-1]
        back = rollout(z - step * dz, plan - step * du, ground, False, h, substeps).z[-1]
        errors.append(relative(predicted, (forth - back) / (2 * step)))
    assert errors[0] < 0.04 and errors[1] < 0.01


def test_the_plan_is_clipped_to_what_the_motors_can_do(gait, model, rollout):
    limit = np.array([30.0, 20.0, 10.0, 5.0])
    plan = np.random.default_rng(6).normal(0.0, 50.0, (40, 4))
    wished = plan.copy()
    out = rollout(z_of(gait, *gait.post_impact(model)), plan, limit=limit)
    np.testing.assert_allclose(out.u + plan, np.clip(out.u + wished, -limit, limit), atol=1e-12)
    assert (np.abs(out.u + wished) > limit).any() and (np.abs(out.u + wished) < limit).any()
