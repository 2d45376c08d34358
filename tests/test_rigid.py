"""The rigid plant obeys mechanics, the paper's assumptions and its own promises."""

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
from sim.interface import AppliedForce
from sim.plant import RigidPlant
from sim.scenario import GroundSettings, PlantSettings
from sim.scenario.per_link import BodyFactors, JointFactors
from sim.scenario.plant import Ramp

RABBIT = Path(__file__).parents[1] / "models" / "rabbit" / "rabbit.xml"
PERIOD = 1e-3  # [s]
G = 9.81  # [m/s^2]
MASS = 32.0  # [kg]
REST = np.zeros(4)  # [N.m]
BEFORE = np.array([2.92, 3.54, -0.15, -0.36, 0.015]), np.array([-0.21, -0.16, -0.25, 0.23, -0.85])
AFTER = np.array([3.54, 2.92, -0.36, -0.15, 0.015]), np.array([1.40, 0.21, -2.73, -0.32, -1.01])
NO_DAMPING = JointFactors(left_hip=0, right_hip=0, left_knee=0, right_knee=0)
NORMAL, Z = 1, 1


def make(**changes: object) -> RigidPlant:
    return RigidPlant(dataclasses.replace(PlantSettings(timestep=1e-3), **changes), RABBIT, PERIOD)


class Unpinned:
    """The walker as MuJoCo sees it, for momentum and energy; none of the plant's own arithmetic."""

    def __init__(self, **changes: object) -> None:
        from sim.plant.build import build_spec

        self.model = build_spec(dataclasses.replace(PlantSettings(), **changes), RABBIT).compile()
        self.data = mujoco.MjData(self.model)
        self.order = [
            self.model.joint(n).qposadr[0] for n in ("left_hip", "right_hip", "left_knee", "right_knee", "torso")
        ]

    def set(self, plant: RigidPlant) -> None:
        state = plant.state()
        self.data.qpos[:2], self.data.qvel[:2] = state.hip, state.dhip
        self.data.qpos[self.order], self.data.qvel[self.order] = state.q, state.dq
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_energyPos(self.model, self.data)
        mujoco.mj_energyVel(self.model, self.data)

    def energy(self, plant: RigidPlant) -> tuple[float, float]:
        """Potential and kinetic energy in [J]."""
        self.set(plant)
        return tuple(self.data.energy.tolist())

    def momentum(self, plant: RigidPlant) -> NDArray:
        """Linear momentum (x, z) in [N.s]."""
        self.set(plant)
        mujoco.mj_subtreeVel(self.model, self.data)
        return MASS * self.data.subtree_linvel[self.model.body("torso").id][[0, 2]]

    def foot_velocity(self, plant: RigidPlant, leg: str) -> NDArray:
        self.set(plant)
        J = np.zeros((3, 7))
        mujoco.mj_jacSite(self.model, self.data, J, None, self.model.site(f"{leg}_foot").id)
        return J @ self.data.qvel


states = st.tuples(st.tuples(*[st.floats(-0.4, 0.4)] * 5), st.tuples(*[st.floats(-3, 3)] * 5))
torques = st.tuples(*[st.floats(-60, 60)] * 4)


@settings(max_examples=20, deadline=None)
@given(state=states, u=torques, stance=st.sampled_from(["left", "right"]))
def test_the_stance_foot_stays_where_it_is(state, u, stance: str) -> None:
    plant, world = make(), Unpinned()
    plant.reset(AFTER[0] + state[0], np.array(state[1]), stance)
    leg = ("left", "right").index(stance)
    assert plant.state().foot[leg] == pytest.approx([0, 0], abs=1e-15)
    for _ in range(5):
        plant.hold(np.array(u))
        if plant.impact is None:
            assert np.abs(plant.state().foot[leg]).max() < 1e-15
            assert np.abs(world.foot_velocity(plant, stance)).max() < 1e-12


@settings(max_examples=20, deadline=None)
@given(state=states, u=torques)
def test_momentum_changes_by_ground_push_and_weight(state, u) -> None:
    plant, world = make(), Unpinned()
    plant.reset(AFTER[0] + state[0], np.array(state[1]), "left")
    push = AppliedForce(body="torso", point=(0.03, 0.2), force=(31.0, -7.0))
    before = world.momentum(plant)
    plant.hold(np.array(u), [push])
    if plant.impact is not None:
        return
    outside = plant.state().contact_force[0] + push.force - np.array([0.0, MASS * G])
    assert world.momentum(plant) - before == pytest.approx(outside * PERIOD, abs=1e-6)


def test_energy_is_kept_without_damping_and_torque() -> None:
    plant, world = make(damping_factor=NO_DAMPING), Unpinned()
    plant.reset(*AFTER, "left")
    first = sum(world.energy(plant))
    for _ in range(200):
        plant.hold(REST)
    assert plant.impact is None
    assert sum(world.energy(plant)) == pytest.approx(first, abs=1e-7)


def test_damping_takes_its_power_and_a_torque_gives_it() -> None:
    plant, world = make(), Unpinned()
    plant.reset(*AFTER, "left")
    u, damping = np.array([20.0, -10.0, 5.0, 8.0]), np.array([10.0, 10.0, 5.0, 5.0])
    first, work = sum(world.energy(plant)), 0.0
    for _ in range(100):
        start = plant.state().dq[:4]
        plant.hold(u)
        rate = 0.5 * (start + plant.state().dq[:4])
        work += float(u @ rate - damping @ rate**2) * PERIOD
    assert sum(world.energy(plant)) - first == pytest.approx(work, abs=2e-3)


def test_the_integrator_is_of_fourth_order() -> None:
    u = np.array([-30.0, 40.0, 5.0, -2.0])

    def end(substeps: int) -> NDArray:
        plant = make(timestep=PERIOD / substeps)
        plant.reset(*AFTER, "left")
        for _ in range(100):
            plant.hold(u)
        return np.concatenate((plant.state().q, plant.state().dq))

    reference = end(8)
    coarse, fine = (np.abs(end(n) - reference).max() for n in (1, 2))
    assert coarse < 1e-7
    assert math.log2(coarse / fine) == pytest.approx(4.0, abs=0.4)


def walk_to_impact(plant: RigidPlant) -> None:
    """A fall forward that ends on the swing foot."""
    q, dq = AFTER
    plant.reset(q, dq, "left")
    for _ in range(1500):
        state = plant.state()
        target = np.array([2.92, 3.54, -0.15, -0.36])
        plant.hold(400.0 * (target - state.q[:4]) - 30.0 * state.dq[:4])
        if plant.impact is not None:
            return
    raise AssertionError("no impact")


def test_an_impact_is_located_exchanges_the_legs_and_adds_no_energy() -> None:
    plant, world = make(), Unpinned()
    walk_to_impact(plant)
    impact = plant.impact
    assert impact is not None and impact.stance == "left"
    ahead, height = plant.legs.swing_foot(impact.q, 0)
    assert ahead > 0.1
    assert abs(height) < 1e-14
    assert plant.observe().contact == (False, True)

    def energy(dq: NDArray, stance: str) -> float:
        other = make()
        other._walker.q[:], other._walker.dq[:] = impact.q, dq
        other._walker.leg = ("left", "right").index(stance)
        return world.energy(other)[1]

    assert energy(impact.dq_after, "right") < energy(impact.dq, "left")
    assert impact.impulse[Z] > 0.0


def test_the_foot_that_lands_is_at_rest_and_the_impulse_is_the_change_of_momentum() -> None:
    plant, world = make(), Unpinned()
    walk_to_impact(plant)
    impact = plant.impact
    assert impact is not None
    before, after = make(), make()
    before._walker.q[:], before._walker.dq[:], before._walker.leg = impact.q, impact.dq, 0
    after._walker.q[:], after._walker.dq[:], after._walker.leg = impact.q, impact.dq_after, 1
    assert np.abs(world.foot_velocity(after, "right")).max() < 1e-12
    assert world.foot_velocity(after, "left")[[0, 2]] == pytest.approx(impact.old_foot, abs=1e-12)
    change = world.momentum(after) - world.momentum(before)
    assert change == pytest.approx(impact.impulse, abs=1e-9)


def test_a_state_on_the_switching_surface_is_taken_through_the_impact_at_reset() -> None:
    from sim.stability.sections import Surface

    plant = make()
    x = Surface(plant.legs).project(np.concatenate(BEFORE))
    plant.reset(x[:5], x[5:], "left")
    assert plant.observe().contact == (False, True)
    assert plant.state().foot[1] == pytest.approx([0.404, 0.0], abs=1e-3)
    assert plant.observe().dq == pytest.approx(plant.impact.dq_after)
    plant.reset(*AFTER, "left")
    assert plant.impact is None


def test_pulling_ground_shows_as_a_negative_normal_force() -> None:
    plant = make()
    plant.reset(*AFTER, "left")
    plant.hold(REST, [AppliedForce(body="torso", point=(0.0, 0.24), force=(0.0, 800.0))])
    assert plant.state().contact_force[0, NORMAL] < 0.0
    assert plant.state().contact == (True, False)


def test_motors_saturate_unless_told_otherwise() -> None:
    u = np.array([90.0, -90.0, 60.0, -60.0])
    for plant, expected in ((make(), [75, -75, 50, -50]), (make(saturation=False), u)):
        plant.reset(*AFTER, "left")
        plant.hold(u)
        assert plant.state().torque == pytest.approx(expected)
    half = JointFactors(left_hip=0.5)
    plant = make(torque_limit_factor=half)
    plant.reset(*AFTER, "left")
    plant.hold(u)
    assert plant.state().torque[0] == pytest.approx(37.5)


def test_a_heavier_torso_weighs_on_the_foot() -> None:
    def normal(factor: float) -> float:
        plant = make(mass_factor=BodyFactors(torso=factor), saturation=False)
        plant.reset(AFTER[0], np.zeros(5), "left")
        plant.hold(REST)
        return float(plant.state().contact_force[0, NORMAL])

    assert normal(2.0) > normal(1.0) + 20.0


@pytest.mark.parametrize("slope", [-0.1, 0.0, 0.08])
def test_on_a_slope_heights_and_forces_are_those_of_the_slope(slope: float) -> None:
    plant = make(ground=GroundSettings(slope=slope), saturation=False)
    q = AFTER[0] + np.array([0, 0, 0, 0, slope])  # the posture turned with the ground: both feet on it
    plant.reset(q, np.zeros(5), "left")
    level = make()
    level.reset(AFTER[0], np.zeros(5), "left")
    assert plant.state().clearance == pytest.approx(level.state().clearance, abs=1e-12)
    plant.hold(REST)
    fx, fz = plant._work["force_time"][0, 0] / PERIOD
    tangential, normal = plant.state().contact_force[0]
    assert (tangential, normal) == pytest.approx(
        (fx * math.cos(slope) + fz * math.sin(slope), fz * math.cos(slope) - fx * math.sin(slope))
    )


def test_an_impact_on_a_ramp_happens_on_the_ramp() -> None:
    ramp = Ramp(start=0.1, length=2.0, slope=0.05)
    plant = make(ground=GroundSettings(ramps=(ramp,)))
    walk_to_impact(plant)
    x, z = plant.state().foot[1]
    assert x > 0.1
    assert z == pytest.approx(math.tan(0.05) * (x - 0.1), abs=1e-12)


def test_a_knee_in_the_ground_is_seen() -> None:
    plant = make()
    plant.reset(np.array([1.2, 3.0, 1.5, -0.2, 0.3]), np.zeros(5), "left")
    assert plant.state().hip[Z] + 0.4 * math.cos(0.3 + 3.0) < 0.0  # the right knee
    assert plant.state().penetrating == ("right_femur",)
    plant.reset(*AFTER, "left")
    assert plant.state().penetrating == ()


def test_equal_runs_are_equal_bit_for_bit() -> None:
    def run() -> NDArray:
        plant = make()
        walk_to_impact(plant)
        return np.concatenate((plant.state().q, plant.state().dq, plant.impact.impulse))

    assert run().tobytes() == run().tobytes()


def test_bad_input_is_named() -> None:
    plant = make()
    with pytest.raises(UserError, match=r'stance = "?\'?middle'):
        plant.reset(*AFTER, "middle")
    with pytest.raises(UserError, match=r"q = .*\[rad\]"):
        plant.reset(np.full(5, np.nan), AFTER[1], "left")
    plant.reset(*AFTER, "left")
    with pytest.raises(ValueError, match=r"u = .*N\.m"):
        plant.hold(np.array([np.nan, 0, 0, 0]))
    with pytest.raises(UserError, match='body = "head"'):
        plant.hold(REST, [AppliedForce(body="head", point=(0, 0), force=(1, 0))])
    with pytest.raises(UserError, match="timestep"):
        make(timestep=0.3e-3)


def test_a_state_that_explodes_is_reported() -> None:
    plant = make(saturation=False)
    plant.reset(*AFTER, "left")
    with np.errstate(all="ignore"), pytest.raises(PlantDiverged, match="diverged"):
        for _ in range(200):
            plant.hold(np.array([1e9, -1e9, 1e9, -1e9]))


@pytest.mark.parametrize(
    ("force", "depth", "ticks"), [(20.0, 0.0, 0), (22.5, 0.9e-3, 39), (25.0, 9.6e-3, 114), (35.0, 22.1e-3, 286)]
)
def test_zd_pd_walks_through_the_ground_from_22_newtons_on(force: float, depth: float, ticks: int) -> None:
    from sim.bridge.run import run_scenario
    from sim.scenario import Scenario, with_values

    changes = {"plant.kind": "rigid", "plant.timestep": 1e-3, "controller.kind": "zd-pd", "steps": 4}
    changes |= {"controller.impact_time": 0.0}  # the paper's literal law
    pushed = with_values(Scenario(), {**changes, "pushes.0.force": force, "pushes.0.step": 1})
    found = run_scenario(pushed)
    assert found.outcome == "completed"
    assert found.scuff_depth_m == pytest.approx(depth, abs=1e-4)
    assert found.scuff_time_s == pytest.approx(ticks * PERIOD, abs=3 * PERIOD)
    tripped = run_scenario(with_values(pushed, {"plant.scuff": "trip"}))
    assert (tripped.outcome == "fell") == (depth > 1e-3)
