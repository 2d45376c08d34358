"""Modelling errors change the mechanism as they say, and nothing else."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from sim.errors import UserError
from sim.interface import LINKS
from sim.plant import MujocoPlant
from sim.scenario import GroundSettings, PlantSettings
from sim.scenario.per_link import (
    BodyFactors,
    BodyLengths,
    BodyMasses,
    JointInertias,
    JointTorques,
    LimbFactors,
)

MJCF = Path(__file__).parent.parent / "models/rabbit/rabbit.xml"
Q = np.array([3.54, 2.92, -0.36, -0.15, 0.015])  # [rad]


def plant(**values: object) -> MujocoPlant:
    return MujocoPlant(PlantSettings(**values), MJCF, 1e-3)


def inertia(model: mujoco.MjModel, body: str) -> float:
    return float(model.body_inertia[model.body(body).id][1])


@pytest.mark.parametrize("body", LINKS)
def test_mass_factor_and_offset_add_up_and_inertia_follows_or_not(body: str) -> None:
    nominal = plant().model
    mass = float(nominal.body(body).mass[0])
    settings = {
        "mass_factor": BodyFactors(**{body: 1.5}),
        "mass_offset": BodyMasses(**{body: 1.0}),
        "inertia_factor": BodyFactors(**{body: 3.0}),
    }
    follows, stays = plant(**settings).model, plant(**settings, inertia_follows_mass=False).model
    for model in (follows, stays):
        assert model.body(body).mass[0] == pytest.approx(1.5 * mass + 1.0)
        others = [name for name in LINKS if name != body]
        assert [model.body(name).mass[0] for name in others] == [nominal.body(name).mass[0] for name in others]
    assert inertia(follows, body) == pytest.approx(3 * (1.5 + 1.0 / mass) * inertia(nominal, body))
    assert inertia(stays, body) == pytest.approx(3 * inertia(nominal, body))


def test_a_mass_must_stay_above_zero() -> None:
    with pytest.raises(UserError, match=r"plant\.mass_offset\.torso = -13 kg: .* has 12 kg"):
        plant(mass_offset=BodyMasses(torso=-13.0))


def test_centres_of_mass_move_in_the_link_frame_and_pushes_follow() -> None:
    before = plant().com["left_tibia"]
    after = plant(com_offset_along=BodyLengths(left_tibia=0.02), com_offset_across=BodyLengths(left_tibia=-0.01)).com[
        "left_tibia"
    ]
    assert np.subtract(after, before) == pytest.approx([-0.01, 0.02])


def test_a_longer_leg_stands_on_its_own_foot_where_mujoco_has_it() -> None:
    walker = plant(length_factor=LimbFactors(left_femur=1.1, left_tibia=0.95, right_tibia=1.2))
    walker.reset(Q, np.zeros(5), "left")
    state = walker.state()
    for row, side in enumerate(("left", "right")):
        site = walker.data.site(f"{side}_foot").xpos
        assert state.foot[row] == pytest.approx([site[0], site[2]], abs=1e-12)
    assert state.foot[0, 0] == pytest.approx(0, abs=1e-12)


def test_friction_and_armature_reach_their_joints() -> None:
    model = plant(joint_friction=JointTorques(left_knee=1.5), armature=JointInertias(right_hip=0.2)).model

    def dof(name: str) -> int:
        return int(model.joint(name).dofadr[0])

    assert model.dof_frictionloss[dof("left_knee")] == 1.5 and np.count_nonzero(model.dof_frictionloss) == 1
    assert model.dof_armature[dof("right_hip")] == 0.2 and np.count_nonzero(model.dof_armature) == 1


def test_softer_ground_is_entered_deeper_in_proportion() -> None:
    """At rest the depth is the weight over the stiffness."""

    def depth(factor: float) -> float:
        walker = plant(ground=GroundSettings(stiffness_factor=factor))
        model = walker.model
        ref = model.geom("left_foot").solref
        return float((ref[0] * ref[1]) ** 2)  # MuJoCo's compliance, up to a constant

    assert depth(0.25) == pytest.approx(4 * depth(1.0))


def test_contact_damping_changes_damping_alone_and_has_a_limit() -> None:
    soft, nominal = (plant(ground=GroundSettings(damping_factor=f)).model.geom("left_foot").solref for f in (2.0, 1.0))
    assert soft[0] == pytest.approx(nominal[0] / 2)
    assert soft[0] * soft[1] == pytest.approx(nominal[0] * nominal[1])
    with pytest.raises(UserError, match=r"damping_factor = 5: must be at most 4"):
        plant(ground=GroundSettings(damping_factor=5.0))
