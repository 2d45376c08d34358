"""The files under models/rabbit say what their README says, and the gait closes on the plant's numbers."""

import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest

RABBIT = Path(__file__).parents[1] / "models" / "rabbit"
LINKS = {  # mass [kg], length [m], inertia about the COM [kg m^2], COM [m]: parameter set B
    "torso": (12.0, None, 1.33, 0.24),
    "left_femur": (6.8, 0.4, 0.47, 0.11),
    "right_femur": (6.8, 0.4, 0.47, 0.11),
    "left_tibia": (3.2, 0.4, 0.20, 0.24),
    "right_tibia": (3.2, 0.4, 0.20, 0.24),
}
EXCHANGE = [1, 0, 3, 2, 4]  # the legs swap names at impact
STANCE, SWING = "left", "right"  # before the impact the right foot stands, after it the left
# From (stance hip, swing hip, stance knee, swing knee, torso) after impact to the order of qpos[2:].
TO_QPOS = [4, 0, 2, 1, 3]
HIP = slice(0, 2)


@pytest.fixture
def plant() -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_path(str(RABBIT / "rabbit.xml"))
    return model, mujoco.MjData(model)


@pytest.fixture
def gait() -> dict:
    return tomllib.loads((RABBIT / "gaits" / "paper.toml").read_text())


@pytest.mark.parametrize("link", LINKS)
def test_plant_has_parameter_set_b(plant, link: str) -> None:
    model, _ = plant
    mass, _, inertia, com = LINKS[link]
    body = model.body(link)
    assert (body.mass[0], body.ipos[2]) == (mass, com)
    assert body.inertia[:2] == pytest.approx([inertia, inertia])
    assert body.iquat == pytest.approx([1, 0, 0, 0])


@pytest.mark.parametrize("link", LINKS)
def test_belief_has_parameter_set_b(link: str) -> None:
    mass, _, inertia, com = LINKS[link]
    found = ET.parse(RABBIT / "rabbit.urdf").getroot().find(f"link[@name='{link}']/inertial")
    assert found is not None
    assert float(found.find("mass").get("value")) == mass
    assert float(found.find("inertia").get("iyy")) == inertia
    assert found.find("origin").get("xyz") == f"0 0 {com}"


def test_rotor_inertia_is_not_counted(plant) -> None:
    assert not plant[0].dof_armature.any()


def test_zero_pose_points_up(plant) -> None:
    model, data = plant
    mujoco.mj_forward(model, data)
    for side in ("left", "right"):
        assert data.body(f"{side}_femur").xpos == pytest.approx([0, 0, 0])
        assert data.body(f"{side}_tibia").xpos == pytest.approx([0, 0, 0.4])
        assert data.site(f"{side}_foot").xpos == pytest.approx([0, 0, 0.8])


def test_angles_are_counter_clockwise_from_up(plant) -> None:
    model, data = plant
    data.joint("left_hip").qpos[:] = 0.3
    mujoco.mj_forward(model, data)
    assert data.body("left_tibia").xpos == pytest.approx([-0.4 * np.sin(0.3), 0, 0.4 * np.cos(0.3)])


def test_motors_push_their_own_joint(plant) -> None:
    model, data = plant
    for name in ("left_hip", "right_hip", "left_knee", "right_knee"):
        data.ctrl[:] = 0
        data.actuator(name).ctrl[:] = 7.0
        mujoco.mj_forward(model, data)
        assert data.joint(name).qfrc_actuator == pytest.approx(7.0)
        assert np.count_nonzero(data.qfrc_actuator) == 1


def test_only_floor_contacts_exist(plant) -> None:
    model, data = plant
    rng, floor, contacts = np.random.default_rng(1), model.geom("floor").id, 0
    for _ in range(200):
        data.qpos[:] = np.r_[0, rng.uniform(0, 0.8), rng.uniform(-np.pi, np.pi, 5)]
        mujoco.mj_forward(model, data)
        contacts += data.ncon
        assert all(floor in pair for pair in data.contact.geom)
    data.qpos[:] = [0, 2, 0, np.pi, 0, np.pi, 0]  # both feet at one point
    mujoco.mj_forward(model, data)
    assert contacts > 0 and data.ncon == 0


def test_a_state_that_is_not_finite_stays_so(plant) -> None:
    assert plant[0].opt.disableflags & mujoco.mjtDisableBit.mjDSBL_AUTORESET


def test_contact_is_as_the_readme_says(plant) -> None:
    model, _ = plant
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert model.opt.impratio == 100
    for foot in ("left_foot", "right_foot"):
        geom = model.geom(foot)
        assert (geom.priority[0], geom.condim[0], geom.size[0]) == (1, 3, 0.002)
        assert geom.solref == pytest.approx([0.002, 1])
        assert geom.solimp[:3] == pytest.approx([0.8, 0.9, 0.001])


def test_gait_has_the_documented_shape(gait: dict) -> None:
    assert (gait["name"], gait["walker"], gait["degree"]) == ("paper", "rabbit", 6)
    assert np.shape(gait["alpha"]) == (4, gait["degree"] + 1)
    assert np.shape(gait["clock"]) == np.shape(gait["q_minus"]) == np.shape(gait["dq_minus"]) == (5,)


def test_gait_ends_where_it_begins(gait: dict) -> None:
    q_minus, alpha = np.array(gait["q_minus"]), np.array(gait["alpha"])
    assert np.array_equal(alpha[:, -1], q_minus[:4])
    assert np.array_equal(alpha[:, 0], q_minus[EXCHANGE][:4])


def post_impact(plant, gait: dict) -> tuple[np.ndarray, np.ndarray]:
    """Rigid impact of the plant's own model: (qpos with the hip above the left foot, qvel), each (7,)."""
    model, data = plant
    q, dq = (np.array(gait[name])[EXCHANGE][TO_QPOS] for name in ("q_minus", "dq_minus"))
    data.qpos[2:] = q
    mujoco.mj_forward(model, data)
    J = {}
    for side in (STANCE, SWING):
        full = np.zeros((3, 7))
        mujoco.mj_jacSite(model, data, full, None, model.site(f"{side}_foot").id)
        J[side] = full[[0, 2]]
    before = np.r_[0, 0, dq]
    before[HIP] = -J[SWING] @ before  # the old stance foot is at rest
    D = np.zeros((7, 7))
    mujoco.mj_fullM(model, data, D)
    stop = J[STANCE] @ np.linalg.solve(D, J[STANCE].T)
    impulse = np.linalg.solve(stop, -J[STANCE] @ before)
    after = before + np.linalg.solve(D, J[STANCE].T @ impulse)
    hip = -data.site(f"{STANCE}_foot").xpos[[0, 2]]
    return np.r_[hip, q], after


def test_gait_is_invariant_under_the_impact_of_this_parameter_set(plant, gait: dict) -> None:
    _, after = post_impact(plant, gait)
    rates = np.empty(5)
    rates[TO_QPOS] = after[2:]
    clock, alpha = np.array(gait["clock"]), np.array(gait["alpha"])
    span = clock @ np.array(gait["q_minus"]) - clock @ np.array(gait["q_minus"])[EXCHANGE]
    asked = gait["degree"] * (alpha[:, 1] - alpha[:, 0]) * (clock @ rates) / span
    assert rates[:4] == pytest.approx([1.40, 0.21, -2.73, -0.32], abs=0.005)
    assert rates[:4] == pytest.approx(asked, abs=0.05)


def test_keyframe_is_the_state_after_impact(plant, gait: dict) -> None:
    model, _ = plant
    qpos, qvel = post_impact(plant, gait)
    key = model.key("post_impact")
    sphere = np.array([0, 0.002 - 1e-6])  # [m] the tip stands on the foot's sphere, which is in the floor by 1 um
    assert key.qpos == pytest.approx(qpos + np.r_[sphere, np.zeros(5)], abs=1e-8)
    assert key.qvel == pytest.approx(qvel, abs=1e-8)
