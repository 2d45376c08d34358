"""Belief and plant agree while no scenario disturbs either; the only test with both engines."""

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from controller.belief import WalkerModel
from sim.plant import MujocoPlant, RigidPlant
from sim.scenario import PlantSettings

RABBIT = Path(__file__).parents[1] / "models" / "rabbit"
TOLERANCE = 1e-9  # relative to the largest entry of each quantity
STATES = 1000
FEET = ("left_foot", "right_foot")
PERIOD = 1e-3  # [s]


def belief() -> pin.Model:
    base = pin.JointModelComposite(3)
    base.addJoint(pin.JointModelPX())
    base.addJoint(pin.JointModelPZ())
    base.addJoint(pin.JointModelRevoluteUnaligned(0.0, -1.0, 0.0))
    return pin.buildModelFromUrdf(str(RABBIT / "rabbit.urdf"), base)


def random_states() -> list[tuple[NDArray, NDArray]]:
    rng = np.random.default_rng(0)
    return [(rng.uniform(-np.pi, np.pi, 7), rng.uniform(-10, 10, 7)) for _ in range(STATES)]


def worst(errors: list[tuple[NDArray, NDArray]]) -> float:
    return max(float(np.abs(ours - theirs).max() / np.abs(theirs).max()) for ours, theirs in errors)


@pytest.fixture(scope="module")
def plant() -> MujocoPlant:
    return MujocoPlant(PlantSettings(), RABBIT / "rabbit.xml", 1e-3)


def test_coordinates_have_the_same_order(plant: MujocoPlant) -> None:
    model = belief()
    joints = [plant.model.joint(i).name for i in range(plant.model.njnt)]
    assert joints == ["hip_x", "hip_z", "torso", *list(model.names)[2:]]


def test_inertia_matrix_and_bias_agree(plant: MujocoPlant) -> None:
    model = belief()
    data, m, d = model.createData(), plant.model, plant.data
    inertia, bias = [], []
    for q, dq in random_states():
        d.qpos[:], d.qvel[:] = q, dq
        mujoco.mj_forward(m, d)
        D = np.zeros((7, 7))
        mujoco.mj_fullM(m, d, D)
        upper = np.triu(pin.crba(model, data, q))  # Pinocchio promises the upper triangle only
        inertia.append((D, upper + np.triu(upper, 1).T))
        bias.append((d.qfrc_bias.copy(), pin.nonLinearEffects(model, data, q, dq).copy()))
    assert worst(inertia) < TOLERANCE
    assert worst(bias) < TOLERANCE


@pytest.mark.parametrize("foot", FEET)
def test_foot_position_and_jacobian_agree(plant: MujocoPlant, foot: str) -> None:
    model = belief()
    data, m, d = model.createData(), plant.model, plant.data
    frame, site = model.getFrameId(foot, pin.BODY), m.site(foot).id
    jacobian, position = [], []
    for q, _ in random_states():
        d.qpos[:] = q
        mujoco.mj_kinematics(m, d)
        mujoco.mj_comPos(m, d)
        J = np.zeros((3, 7))
        mujoco.mj_jacSite(m, d, J, None, site)
        theirs = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
        pin.framesForwardKinematics(model, data, q)
        jacobian.append((J, theirs))
        position.append((d.site_xpos[site].copy(), data.oMf[frame].translation.copy()))
    assert worst(jacobian) < TOLERANCE
    assert worst(position) < TOLERANCE


def test_damping_and_effort_limits_agree(plant: MujocoPlant) -> None:
    model = belief()
    assert np.array_equal(plant.model.dof_damping, model.damping)
    for name, limit in zip(("left_hip", "right_hip", "left_knee", "right_knee"), plant.torque_limits, strict=True):
        assert model.upperEffortLimit[model.joints[model.getJointId(name)].idx_v] == limit


@pytest.fixture(scope="module")
def rigid() -> RigidPlant:
    return RigidPlant(PlantSettings(timestep=PERIOD), RABBIT / "rabbit.xml", PERIOD)


def in_stance_order(vector: NDArray, leg: int) -> NDArray:
    return vector if leg == 0 else vector[[1, 0, 3, 2, 4][: len(vector)]]


@pytest.mark.parametrize("leg", [0, 1])
def test_accelerations_and_contact_force_of_the_pinned_walker_agree(rigid: RigidPlant, leg: int) -> None:
    model = WalkerModel(RABBIT / "rabbit.urdf")
    rng = np.random.default_rng(1)
    motion, force = [], []
    for _ in range(100):
        q, dq, u = rng.uniform(-np.pi, np.pi, 5), rng.uniform(-5, 5, 5), rng.uniform(-50, 50, 4)
        rigid.reset(q, dq, ("left", "right")[leg])
        rigid._walker.torque[:] = u
        rigid._walker.after(q, dq, PERIOD)
        found = rigid._walker.work["slopes"][0, 0].copy()  # of the first stage: at (q, dq)
        ours = [in_stance_order(v, leg) for v in (q, dq, u)]
        motion.append((in_stance_order(found[5:10], leg), model.acceleration(*ours)))
        force.append((found[10:], model.stance_force(*ours)[0]))
    assert worst(motion) < 1e-9
    assert worst(force) < 1e-9


def test_impacts_agree(rigid: RigidPlant) -> None:
    model = WalkerModel(RABBIT / "rabbit.urdf")
    rng = np.random.default_rng(2)
    rates = []
    for _ in range(100):
        q, dq = rng.uniform(-np.pi, np.pi, 5), rng.uniform(-5, 5, 5)
        rigid.reset(q, dq, "left")
        rigid._walker.land(0.0)
        assert rigid.impact is not None
        rates.append((in_stance_order(rigid.impact.dq_after, 1), model.impact(q, dq)[1]))
    assert worst(rates) < 1e-9
