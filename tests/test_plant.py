"""The MuJoCo plant obeys mechanics, its settings and its own promises."""

import dataclasses
import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sim.errors import PlantDiverged, UserError
from sim.interface import LINKS, AppliedForce
from sim.plant import MujocoPlant
from sim.plant.build import INTEGRATORS
from sim.scenario import GroundSettings, PlantSettings
from sim.scenario.per_link import BodyFactors, JointFactors

RABBIT = Path(__file__).parents[1] / "models" / "rabbit" / "rabbit.xml"
PERIOD = 1e-3  # [s]
G = 9.81  # [m/s^2]
MASS = 32.0  # [kg]
REST = np.zeros(4)  # [N.m]
Q = np.array([3.54, 2.92, -0.36, -0.15, 0.015])  # [rad] a posture with the feet 0.4 m apart
DQ = np.array([1.40, 0.21, -2.73, -0.32, -1.01])  # [rad/s]
X, Z = 0, 1
TANGENTIAL, NORMAL = 0, 1
LEFT, RIGHT = 0, 1
HIP_Z = 1
NO_DAMPING = JointFactors(left_hip=0, right_hip=0, left_knee=0, right_knee=0)


def make(**changes: object) -> MujocoPlant:
    return MujocoPlant(dataclasses.replace(PlantSettings(), **changes), RABBIT, PERIOD)


def in_flight(plant: MujocoPlant, q: NDArray = Q, dq: NDArray = DQ) -> None:
    plant.reset(q, dq, "left")
    plant.data.qpos[HIP_Z] += 3.0
    mujoco.mj_forward(plant.model, plant.data)


def momentum(plant: MujocoPlant) -> tuple[NDArray, float]:
    """Linear momentum (x, z) in [N.s], (2,), and angular momentum about the centre of mass (y) in [N.m.s]."""
    mujoco.mj_forward(plant.model, plant.data)
    mujoco.mj_subtreeVel(plant.model, plant.data)
    torso = plant.model.body("torso").id
    mass = plant.model.body_subtreemass[torso]
    return mass * plant.data.subtree_linvel[torso][[0, 2]], float(plant.data.subtree_angmom[torso][1])


def energy(plant: MujocoPlant) -> float:
    """Kinetic and potential energy in [J]."""
    mujoco.mj_energyPos(plant.model, plant.data)
    mujoco.mj_energyVel(plant.model, plant.data)
    return float(plant.data.energy.sum())


def stand(plant: MujocoPlant, slope: float, ticks: int, *, again: bool = True) -> None:
    """Hold the posture `Q`, turned with the slope, stiffly on two feet: a rigid stool in the plane."""
    target = Q + np.array([0, 0, 0, 0, slope])
    if again:
        plant.reset(target, np.zeros(5), "left")
    for _ in range(ticks):
        now = plant.observe()
        plant.hold(2000.0 * (target - now.q)[:4] - 60.0 * now.dq[:4])


# Reset


@settings(max_examples=40, deadline=None)
@given(
    q=st.tuples(*[st.floats(-0.6, 0.6)] * 5),
    dq=st.tuples(*[st.floats(-4, 4)] * 5),
    stance=st.sampled_from(["left", "right"]),
    slope=st.sampled_from([-0.2, 0.0, 0.15]),
)
def test_reset_puts_the_stance_foot_at_rest_on_the_ground(q, dq, stance: str, slope: float) -> None:
    plant = make(ground=GroundSettings(slope=slope))
    plant.reset(Q + q, np.array(dq), stance)
    state, leg = plant.state(), ("left", "right").index(stance)
    J = np.zeros((3, 7))
    mujoco.mj_jacSite(plant.model, plant.data, J, None, plant.model.site(f"{stance}_foot").id)
    assert state.t == 0
    assert state.foot[leg, X] == pytest.approx(0, abs=1e-12)
    assert state.clearance[leg] == pytest.approx(0, abs=2e-6)
    assert J @ plant.data.qvel == pytest.approx(np.zeros(3), abs=1e-12)
    assert state.contact[leg]
    assert plant.observe().contact[leg]
    assert not state.contact_force.any()


@settings(max_examples=40, deadline=None)
@given(q=st.tuples(*[st.floats(-3, 3)] * 5), dq=st.tuples(*[st.floats(-4, 4)] * 5))
def test_state_gives_the_positions_mujoco_computes(q, dq) -> None:
    plant = make()
    plant.reset(np.array(q), np.array(dq), "right")
    state, data = plant.state(), plant.data
    sites = [data.site(name).xpos[[0, 2]] for name in ("left_foot", "right_foot")]
    assert state.foot == pytest.approx(np.array(sites), abs=1e-12)
    assert state.hip == pytest.approx(data.body("torso").xpos[[0, 2]], abs=1e-12)
    assert np.array_equal(state.q, q)
    assert np.array_equal(state.dq, dq)
    assert np.array_equal(plant.observe().q, q)


@pytest.mark.parametrize("slope", [-0.2, 0.1])
def test_clearance_is_measured_from_the_slope(slope: float) -> None:
    plant = make(ground=GroundSettings(slope=slope))
    plant.reset(Q, DQ, "left")
    plant.data.qpos[:2] += [1.0, math.tan(slope)]  # along the ground
    assert plant.state().clearance[LEFT] == pytest.approx(0, abs=2e-6)
    plant.data.qpos[HIP_Z] += 0.3
    assert plant.state().clearance[LEFT] == pytest.approx(0.3, abs=2e-6)


# Mechanics


def test_free_fall_is_parabolic_and_keeps_momentum() -> None:
    plant = make(integrator="RK4")
    in_flight(plant)
    (linear, angular), ticks = momentum(plant), 300
    for _ in range(ticks):
        plant.hold(np.array([20.0, -10.0, 5.0, 3.0]))
    after, spin = momentum(plant)
    assert after - linear == pytest.approx([0, -MASS * G * ticks * PERIOD], abs=1e-6)
    assert spin == pytest.approx(angular, rel=1e-6)


@pytest.mark.parametrize(("integrator", "tolerance"), [("RK4", 1e-8), ("implicitfast", 1e-2), ("Euler", 1e-2)])
def test_free_fall_without_damping_keeps_energy(integrator: str, tolerance: float) -> None:
    plant = make(integrator=integrator, damping_factor=NO_DAMPING)
    in_flight(plant)
    kinetic = 0.5 * MASS  # [J] scale
    before = energy(plant)
    for _ in range(300):
        plant.hold(REST)
    mujoco.mj_forward(plant.model, plant.data)
    assert abs(energy(plant) - before) < tolerance * kinetic


def test_damping_takes_energy_and_opposes_the_rates() -> None:
    half = JointFactors(left_hip=0.5)
    plant = make(damping_factor=half)
    in_flight(plant)
    before = energy(plant)
    expected = {"left_hip": 5.0, "right_hip": 10.0, "left_knee": 5.0, "right_knee": 5.0}  # [N.m.s/rad]
    for name, damping in expected.items():
        joint = plant.data.joint(name)
        assert joint.qfrc_passive == pytest.approx(-damping * joint.qvel)
    assert not plant.data.qfrc_passive[:3].any()
    plant.hold(REST)
    mujoco.mj_forward(plant.model, plant.data)
    assert energy(plant) < before


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("slope", [0.0, 0.1])
def test_standing_carries_the_weight_without_sinking_or_creeping(integrator: str, slope: float) -> None:
    plant = make(integrator=integrator, saturation=False, ground=GroundSettings(slope=slope))
    stand(plant, slope, 1500)
    before, ticks = plant.state(), 200
    stand(plant, slope, ticks, again=False)
    after = plant.state()
    assert after.contact == (True, True)
    total = after.contact_force.sum(axis=0)
    assert total[NORMAL] == pytest.approx(MASS * G * math.cos(slope), rel=2e-3)
    assert total[TANGENTIAL] == pytest.approx(MASS * G * math.sin(slope), abs=0.5)
    assert np.all(after.clearance < 0) and np.all(after.clearance > -2e-5)
    assert np.abs(after.foot - before.foot).max() / (ticks * PERIOD) < 1e-3  # [m/s]


def test_ice_lets_the_walker_slide_down() -> None:
    plant = make(saturation=False, ground=GroundSettings(friction=0.01, slope=0.1))
    stand(plant, 0.1, 300)
    assert plant.state().foot[LEFT, X] < -0.01


def test_friction_cone_holds_for_the_mean_force() -> None:
    plant = make(ground=GroundSettings(friction=0.3))
    plant.reset(Q, DQ, "left")
    for _ in range(150):
        plant.hold(np.array([60.0, -60.0, 30.0, 0.0]))
        tangential, normal = plant.state().contact_force.T
        assert np.all(np.abs(tangential) <= 0.3 * normal + 1e-6)


def test_contact_impulse_accounts_for_the_change_of_momentum() -> None:
    plant = make()
    plant.reset(Q, np.zeros(5), "left")
    plant.data.qpos[HIP_Z] += 0.02
    before, _ = momentum(plant)
    impulse, ticks = np.zeros(2), 120
    for _ in range(ticks):
        plant.hold(REST)
        impulse += plant.state().contact_force.sum(axis=0) * PERIOD
    after, _ = momentum(plant)
    expected = after - before + [0, MASS * G * ticks * PERIOD]
    assert impulse[NORMAL] > 10.0  # [N.s] it has landed
    assert impulse == pytest.approx(expected, abs=0.01 * impulse[NORMAL])


# Actuators and modelling errors


@pytest.mark.parametrize("sign", [1, -1])
def test_motors_saturate_at_their_limits(sign: int) -> None:
    plant = make(torque_limit_factor=JointFactors(right_knee=0.5))
    plant.reset(Q, DQ, "left")
    plant.hold(sign * np.full(4, 200.0))
    assert np.array_equal(plant.torque_limits, [75, 75, 50, 25])
    assert np.array_equal(plant.state().torque, sign * plant.torque_limits)


def test_without_saturation_any_torque_is_applied() -> None:
    plant = make(saturation=False)
    plant.reset(Q, DQ, "left")
    u = np.array([200.0, -300.0, 400.0, -500.0])
    plant.hold(u)
    assert np.all(np.isinf(plant.torque_limits))
    assert np.array_equal(plant.state().torque, u)


@pytest.mark.parametrize("body", LINKS)
def test_mass_factor_scales_mass_and_inertia_of_its_link_alone(body: str) -> None:
    plain, heavy = make().model, make(mass_factor=BodyFactors(**{body: 2.0})).model
    for name in LINKS:
        factor = 2.0 if name == body else 1.0
        assert heavy.body(name).mass == factor * plain.body(name).mass
        assert heavy.body(name).inertia == pytest.approx(factor * plain.body(name).inertia)
        assert np.array_equal(heavy.body(name).ipos, plain.body(name).ipos)


def test_textures_are_for_viewers_alone_and_change_no_motion() -> None:
    plain, shown = make(), MujocoPlant(PlantSettings(), RABBIT, PERIOD, pictures=True)
    assert plain.model.ntex == 0 and shown.model.ntex > 0
    assert all(np.array_equal(a, b) for a, b in zip(walk_about(plain), walk_about(shown), strict=True))


# External forces


@pytest.mark.parametrize("body", LINKS)
def test_a_force_is_felt_at_its_point(body: str) -> None:
    force = AppliedForce(body=body, point=(0.03, 0.31), force=(25.0, -8.0))
    plant, still = make(), make()
    in_flight(plant)
    in_flight(still)
    plant.hold(REST, [force])
    link = still.data.body(body)
    point = link.xpos + link.xmat.reshape(3, 3) @ [0.03, 0, 0.31]
    expected, found = np.zeros(7), np.zeros(7)
    m, d = still.model, still.data
    mujoco.mj_applyFT(m, d, np.array([25.0, 0, -8.0]), np.zeros(3), point, m.body(body).id, expected)
    applied = plant.data.body(body).xfrc_applied
    mujoco.mj_applyFT(m, d, applied[:3], applied[3:], link.xipos, m.body(body).id, found)
    assert found == pytest.approx(expected, abs=1e-12)
    assert np.array_equal(plant.state().push, [25.0, -8.0])


def test_a_push_changes_momentum_by_force_times_time() -> None:
    plant = make()
    in_flight(plant)
    force = AppliedForce(body="torso", point=plant.com["torso"], force=(25.0, 40.0))
    before, _ = momentum(plant)
    for _ in range(100):
        plant.hold(REST, (force,))
    after, _ = momentum(plant)
    assert after - before == pytest.approx([25.0 * 0.1, (40.0 - MASS * G) * 0.1], rel=1e-3)


def test_a_push_ends_with_its_hold() -> None:
    plant = make()
    in_flight(plant)
    there = AppliedForce(body="torso", point=(0.0, 0.6), force=(25.0, 0.0))
    back = AppliedForce(body="torso", point=(0.0, 0.0), force=(-25.0, 0.0))
    for forces in ([there], [there, back]):  # the pair adds up to no force, but to a torque
        plant.hold(REST, forces)
        assert plant.data.xfrc_applied.any()
        plant.hold(REST)
        assert not plant.data.xfrc_applied.any()
        assert not plant.state().push.any()


def test_a_force_on_an_unknown_link_is_refused() -> None:
    plant = make()
    with pytest.raises(UserError, match=r"head.*torso"):
        plant.hold(REST, [AppliedForce(body="head", point=(0, 0), force=(1, 0))])


# Determinism and records


def walk_about(plant: MujocoPlant) -> list[NDArray]:
    rng = np.random.default_rng(7)
    push = AppliedForce(body="left_femur", point=(0.0, 0.2), force=(30.0, 5.0))
    plant.reset(Q, DQ, "left")
    states = []
    for tick in range(200):
        plant.hold(rng.uniform(-60, 60, 4), [push] if 50 <= tick < 80 else ())
        states.append(plant.integration_state())
    return states


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_the_same_sequence_gives_the_same_bits(integrator: str) -> None:
    plant = make(integrator=integrator)
    first, again, other = walk_about(plant), walk_about(plant), walk_about(make(integrator=integrator))
    assert np.array_equal(first, again)
    assert np.array_equal(first, other)


def test_records_are_copies() -> None:
    plant = make()
    plant.reset(Q, DQ, "left")
    plant.hold(REST)
    live = (
        plant.data.qpos,
        plant.data.qvel,
        plant.data.sensordata,
        plant.data.actuator_force,
        plant.data.ctrl,
    )
    for record in (plant.observe(), plant.state()):
        arrays = {
            field.name: value
            for field in dataclasses.fields(record)
            if isinstance(value := getattr(record, field.name), np.ndarray)
        }
        kept = {name: array.copy() for name, array in arrays.items()}
        assert not any(np.shares_memory(array, view) for array in arrays.values() for view in live)
        plant.hold(np.full(4, 30.0), [AppliedForce(body="torso", point=(0, 0), force=(9, 9))])
        assert all(np.array_equal(array, kept[name]) for name, array in arrays.items())


def test_time_counts_holds_and_a_hold_is_a_whole_number_of_steps() -> None:
    plant = make(timestep=0.1e-3)
    plant.reset(Q, DQ, "left")
    for _ in range(57):
        plant.hold(REST)
    assert plant.observe().t == plant.state().t == 57 * PERIOD
    assert plant.data.time == pytest.approx(0.057)


@pytest.mark.parametrize(
    ("link", "qpos"),
    [
        ("torso", [0, 0.62, np.pi, np.pi, 0, np.pi, 0]),  # on its head, legs up
        ("left_femur", [0, 0.42, 0, np.pi, np.pi, np.pi / 2, 0]),  # on its left knee
        ("right_femur", [0, 0.42, 0, np.pi / 2, 0, np.pi, np.pi]),
    ],
)
def test_a_link_on_the_floor_is_named(link: str, qpos: list[float]) -> None:
    plant = make()
    plant.reset(Q, DQ, "left")
    assert plant.state().penetrating == ()
    plant.data.qpos[:] = qpos
    mujoco.mj_forward(plant.model, plant.data)
    assert plant.state().penetrating == (link,)


def test_a_walker_left_alone_falls() -> None:
    plant = make()
    plant.reset(Q, DQ, "left")
    for _ in range(2000):
        plant.hold(REST)
    assert plant.state().penetrating


# Failures


@pytest.mark.parametrize("victim", ["qpos", "qvel"])
@pytest.mark.parametrize("value", [math.nan, math.inf, 1e11])
def test_a_diverged_plant_says_so_and_stays_diverged(victim, value, tmp_path, monkeypatch, capfd) -> None:
    monkeypatch.chdir(tmp_path)
    plant = make()
    plant.reset(Q, DQ, "left")
    getattr(plant.data, victim)[3] = value
    for _ in range(2):
        with pytest.raises(PlantDiverged, match="diverged in the hold up to t = "):
            plant.hold(REST)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")
    plant.reset(Q, DQ, "left")
    plant.hold(REST)


@pytest.mark.parametrize("u", [np.array([0, np.nan, 0, 0]), np.array([np.inf, 0, 0, 0]), np.zeros(3)])
def test_a_torque_that_is_none_is_a_defect(u: NDArray) -> None:
    plant = make()
    with pytest.raises(ValueError, match=r"u = .* \[N.m\]: must be 4 finite torques"):
        plant.hold(u)


@pytest.mark.parametrize("timestep", [0.3e-3, 2e-3, 0.0, -1e-3, math.nan])
def test_a_timestep_that_does_not_divide_the_period_is_refused(timestep: float) -> None:
    with pytest.raises(UserError, match=r"plant.timestep = .* s: must"):
        make(timestep=timestep)


def test_the_refusal_of_a_timestep_names_a_legal_one() -> None:
    with pytest.raises(UserError, match=r"0\.00025 s"):
        make(timestep=0.3e-3)


def test_an_unknown_integrator_is_refused() -> None:
    with pytest.raises(UserError, match="implicitfast"):
        make(integrator="RK5")


@pytest.mark.parametrize(
    ("q", "dq", "stance", "words"),
    [
        (Q, DQ, "middle", "left"),
        (np.full(5, np.nan), DQ, "left", r"q = .*\[rad\]"),
        (Q, np.zeros(4), "left", r"dq = .*\[rad/s\]"),
    ],
)
def test_an_impossible_start_is_refused(q, dq, stance, words) -> None:
    with pytest.raises(UserError, match=words):
        make().reset(q, dq, stance)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "does not exist"),
        ("no xml", "XML"),
        ("<mujoco><worldbody/></mujoco>", "has no geom named"),
    ],
)
def test_a_model_file_that_is_no_walker_is_refused(text, words, tmp_path, capfd) -> None:
    path = tmp_path / "walker.xml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(UserError, match=words) as caught:
        MujocoPlant(PlantSettings(), path, PERIOD)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)
    assert capfd.readouterr().err == ""
