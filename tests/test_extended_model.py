"""What walkers may have beyond RABBIT: rotor inertia, centres of mass off their axes, springs, dry friction, stops."""

import dataclasses
import re

import numpy as np
import oracle
import pytest
import test_ltv_linearisation as ltv
from conftest import RABBIT

from controller.belief import Loop, WalkerModel, kernels
from controller.belief.closed_loop import zero_dynamics
from controller.belief.lumped import Joints, lump
from controller.common.errors import UserError
from controller.common.settings import Known
from controller.design import orbit_kernels
from controller.design.orbit import periodic_orbit
from controller.design.requirements import Requirements, margins

MOTOR = (
    "<transmission name='{0}'><joint name='{0}'/><actuator name='{0}'>"
    "<mechanicalReduction>50</mechanicalReduction><motorInertia>{1}</motorInertia></actuator></transmission>"
)
SPRING = "<gazebo reference='{}'><springStiffness>{}</springStiffness><springReference>{}</springReference></gazebo>"
SIDES = ("left", "right")


def extended(folder, *, across=(0.02, -0.03, 0.015), inertia=3.32e-4, spring=20.0, friction=2.0):
    """RABBIT's URDF with something of everything."""
    text = (RABBIT / "rabbit.urdf").read_text()
    for z, x in zip(("0.24", "0.11", "0.24"), across, strict=True):
        masses = {"0.02": "12", "-0.03": "6.8", "0.015": "3.2"}
        mass = masses.get(str(x), None)
        if mass:
            text = re.sub(rf'<origin xyz="0 0 {z}"/>(\s*<mass value="{mass}")', rf'<origin xyz="{x} 0 {z}"/>\1', text)
    text = text.replace('friction="0"', f'friction="{friction}"').replace('lower="-6.2832"', 'lower="-2.5"')
    more = "".join(MOTOR.format(f"{side}_{kind}", inertia) for side in SIDES for kind in ("hip", "knee"))
    more += "".join(SPRING.format(f"{side}_knee", spring, -0.3) for side in SIDES)
    path = folder / "extended.urdf"
    path.write_text(text.replace("</robot>", more + "</robot>"))
    return path


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return extended(tmp_path_factory.mktemp("walker"))


@pytest.fixture(scope="module")
def geared(file):
    """All of it known but the friction."""
    return WalkerModel(file)


@pytest.fixture(scope="module")
def aware(file):
    """All of it known."""
    return WalkerModel(file, known=Known(friction=True))


def test_what_the_file_says_is_read(geared):
    assert geared.joints.rotor == pytest.approx(0.83)  # 50^2 x 3.32e-4
    assert geared.joints.friction == pytest.approx(2.0)
    assert geared.joints.stiffness.tolist() == [0.0, 0.0, 20.0, 20.0]
    assert geared.joints.rest[2:] == pytest.approx(-0.3)
    assert (geared.low == -2.5).all() and np.isinf(geared.high).all()
    assert (geared.torso.com_across, geared.femur.com_across, geared.tibia.com_across) == (0.02, -0.03, 0.015)


def test_a_bound_a_full_turn_away_stops_nothing(model):
    assert np.isinf(model.low).all() and np.isinf(model.high).all()
    assert not model.lumped.extended and not model.lumped.resists


def test_mechanics_are_those_of_the_unpinned_walker(file, random_states):
    """Against the saddle-point equations on Pinocchio's unpinned walker, whose joints carry the rotors."""
    bare = WalkerModel(file, known=Known(springs=False))
    walker = oracle.Walker(bare.pinocchio)
    rng = np.random.default_rng(5)
    for q, dq in random_states(60, seed=11):
        u = rng.uniform(-75.0, 75.0, 4)
        found, (D, bias) = bare.dynamics(q, dq), walker.pinned(q, dq)
        assert np.abs(found.D - D).max() < 1e-11 * np.abs(D).max()
        assert np.abs(found.C @ dq + found.G - bias).max() < 1e-11 * np.abs(bias).max()
        ddq = walker.acceleration(q, dq, u)
        assert np.abs(bare.acceleration(q, dq, u) - ddq).max() < 1e-9 * np.abs(ddq).max()
        force, per_torque = walker.stance_force(q, dq, u)
        found_force, found_per_torque = bare.stance_force(q, dq, u)
        assert np.abs(found_force - force).max() < 1e-9 * np.abs(force).max()
        assert np.abs(found_per_torque - per_torque).max() < 1e-9 * np.abs(per_torque).max()
        for found_plus, plus in zip(bare.impact(q, dq), walker.impact(q, dq), strict=True):
            assert np.abs(found_plus - plus).max() < 1e-9 * np.abs(plus).max()


def test_impulse_is_the_change_of_momentum(geared, gait):
    """Of the whole walker, from the masses' own velocities by finite differences of the feet's and hip's places."""
    q, dq = gait.q_minus, gait.dq_minus
    _, dq_plus, impulse, _ = orbit_kernels.strike(geared.lumped, q, dq, kernels.new_stage())
    walker = oracle.Walker(geared.pinocchio)
    q_e, dq_e = walker.unpinned(q, dq)
    D_e, J = walker.inertia(q_e), walker.jacobian(q_e, oracle.SWING_FOOT)
    K = np.block([[D_e, -J.T], [J, np.zeros((2, 2))]])
    assert np.linalg.solve(K, np.r_[D_e @ dq_e, 0.0, 0.0])[7:] == pytest.approx(impulse, rel=1e-9)
    assert np.isfinite(dq_plus).all()


def test_springs_and_friction_are_torques(aware, file, random_states):
    bare = WalkerModel(file, known=Known(springs=False))
    for q, dq in random_states(20, seed=12):
        u = np.array([3.0, -2.0, 5.0, 1.0])
        spring = np.array([0.0, 0.0, 20.0, 20.0]) * (q[:4] + 0.3)
        against = spring + 2.0 * np.tanh(dq[:4] / kernels.STICK)
        expected = bare.acceleration(q, dq, u - against)
        assert np.abs(aware.acceleration(q, dq, u) - expected).max() < 1e-9 * np.abs(expected).max()


def test_zero_dynamics_feed_them_forward(aware, file, gait, gains, walking_states):
    """The motion asked for is the same; the torque is what springs and friction take more."""
    bare = WalkerModel(file, known=Known(springs=False))
    for q, dq in walking_states(10, seed=13):
        one, other = (zero_dynamics(Loop(walker.lumped, gait.table, gains), q, dq) for walker in (aware, bare))
        against = np.array([0.0, 0.0, 20.0, 20.0]) * (q[:4] + 0.3) + 2.0 * np.tanh(dq[:4] / kernels.STICK)
        assert np.array_equal(one.ddq, other.ddq) and np.array_equal(one.contact_force, other.contact_force)
        assert one.u - other.u == pytest.approx(against, abs=1e-10)
        assert np.abs(aware.acceleration(q, dq, one.u) - one.ddq).max() < 1e-8 * np.abs(one.ddq).max()


@pytest.mark.parametrize("u_mpc", [np.zeros(4), np.array([20.0, -10.0, 15.0, 5.0])], ids=["zd-pd", "with-mpc"])
def test_derivatives_of_the_closed_loop(aware, gait, gains, walking_states, u_mpc):
    closed_loop = ltv.closed_loop_of(aware, gait, gains)
    ltv.test_derivatives_of_the_closed_loop(aware, gait, gains, closed_loop, walking_states, u_mpc)


def test_derivative_of_the_impact(geared, gait):
    ltv.test_derivative_of_the_impact(geared, gait)


def test_what_is_not_known_is_left_out(file, model):
    blind = WalkerModel(file, known=Known(rotor_inertia=False, com_across=False, springs=False))
    for found, expected in zip(blind.lumped, model.lumped, strict=True):
        assert np.array_equal(found, expected) or found is blind.lumped.rest
    assert blind.fingerprint == WalkerModel(file).fingerprint != model.fingerprint


def test_zero_extensions_change_no_bit(model, gait, gains, walking_states):
    """The same walker with its extensions looked at, all zero, gives the same numbers."""
    plain = lump(model.torso, model.femur, model.tibia, Joints(damping=model.damping), 9.81)
    looked_at = plain._replace(extended=True, resists=True)
    for q, dq in walking_states(10, seed=14):
        one = zero_dynamics(Loop(plain, gait.table, gains), q, dq)
        other = zero_dynamics(Loop(looked_at, gait.table, gains), q, dq)
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("0.000332", "much", ["left_hip", "much", "finite"]),
        ('lower="-2.5"', 'lower="3" ', ["left_hip", "3", "2.9"]),
        ('friction="2.0"', 'friction="-2.0"', ["dry friction", "-2.0", "N.m"]),
    ],
)
def test_numbers_that_can_not_be(file, tmp_path, old, new, words):
    text = file.read_text().replace('upper="6.2832"', 'upper="2.9"')
    assert old in text
    path = tmp_path / "wrong.urdf"
    path.write_text(text.replace(old, new))
    with pytest.raises(UserError) as caught:
        WalkerModel(path)
    for word in words:
        assert word in str(caught.value)
    assert "\n" not in str(caught.value)


def test_design_keeps_joint_stops(file, gait):
    model = WalkerModel(file)
    model.low, model.high = np.array([2.0, 2.0, -1.0, -1.0]), np.array([np.inf, np.inf, 0.0, 0.0])
    orbit = periodic_orbit(model, gait)
    need = Requirements(step_length=0.4, speed=0.8)
    kept = {m.name: m for m in margins(model, gait, orbit, need)}["joint stops"]
    q = orbit.q[:, :4]
    assert kept.worst == pytest.approx(min((q[:, :2] - 2.0).min(), (q[:, 2:] + 1.0).min(), -q[:, 2:].max()))
    assert "2 to inf rad" in kept.legal and kept.values.size == 6 * orbit.s.size
    free = WalkerModel(RABBIT / "rabbit.urdf")
    assert "joint stops" not in {m.name for m in margins(free, gait, periodic_orbit(free, gait), need)}


def test_a_controller_knows_what_it_is_told(file):
    model = WalkerModel(file)
    assert model.knowing(Known()) is model
    blind = model.knowing(Known(rotor_inertia=False, friction=True))
    assert not blind.lumped.rotor.any() and blind.lumped.friction.all() and model.lumped.rotor.any()
    assert blind.fingerprint == model.fingerprint


def test_links_are_plain_records(model):
    assert dataclasses.replace(model.torso, com_across=0.01) != model.torso
