"""The closed forms of the rigid plant are MuJoCo's equations of motion of the same MJCF, whatever is wrong with it."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from sim.errors import UserError
from sim.interface import COORDINATES, LEGS, LINKS, AppliedForce
from sim.plant import Energy, RigidPlant
from sim.plant import rigid_equations as equations
from sim.plant.five_links import TURN, FiveLinks
from sim.plant.kinematics import absolute_angles
from sim.scenario import PlantSettings
from sim.scenario.per_link import (
    BodyFactors,
    BodyLengths,
    BodyMasses,
    JointFactors,
    JointInertias,
    JointTorques,
    LimbFactors,
)

RABBIT = Path(__file__).parents[1] / "models" / "rabbit" / "rabbit.xml"
PERIOD = 1e-3  # [s]
STATES = 25
HIP = slice(0, 2)
NO_DAMPING = JointFactors(left_hip=0, right_hip=0, left_knee=0, right_knee=0)


def random_errors(rng: np.random.Generator) -> dict[str, object]:
    """Errors of every number of the links and joints."""

    def of(kind, low, high):
        return kind(**{field.name: rng.uniform(low, high) for field in dataclasses.fields(kind)})

    return {
        "mass_factor": of(BodyFactors, 0.6, 1.5),
        "mass_offset": of(BodyMasses, 0.0, 3.0),
        "inertia_factor": of(BodyFactors, 0.6, 1.5),
        "com_offset_across": of(BodyLengths, -0.05, 0.05),
        "com_offset_along": of(BodyLengths, -0.05, 0.05),
        "length_factor": of(LimbFactors, 0.8, 1.2),
        "damping_factor": of(JointFactors, 0.0, 2.0),
        "armature": of(JointInertias, 0.0, 0.8),
    }


class Unpinned:
    """MuJoCo's walker at one state of ours, its foot where it is pinned; (7,) vectors: hip x and z, `COORDINATES`."""

    def __init__(self, plant, leg, q, dq):
        self.model, self.data = plant.model, mujoco.MjData(plant.model)
        self.order = [self.model.joint(n).dofadr[0] for n in ("hip_x", "hip_z", *COORDINATES)]
        self.leg, self.legs = leg, plant.legs
        self.data.qpos[self.order[2:]], self.data.qvel[self.order[2:]] = q, dq
        mujoco.mj_forward(self.model, self.data)
        foot, rate = self.foot(leg), self.jacobian(leg)[:, 2:] @ dq
        self.data.qpos[self.order[HIP]], self.data.qvel[self.order[HIP]] = -foot, -rate
        mujoco.mj_forward(self.model, self.data)

    def foot(self, leg):
        return self.data.site(f"{LEGS[leg]}_foot").xpos[[0, 2]].copy()

    def jacobian(self, leg):
        J = np.zeros((3, 7))
        mujoco.mj_jacSite(self.model, self.data, J, None, self.model.site(f"{LEGS[leg]}_foot").id)
        return J[[0, 2]][:, self.order]

    def velocity(self, leg):
        return self.jacobian(leg) @ self.data.qvel[self.order]

    def inertia(self):
        full = np.zeros((7, 7))
        mujoco.mj_fullM(self.model, self.data, full)
        return full[np.ix_(self.order, self.order)]

    def bias(self):
        return self.data.qfrc_bias[self.order]

    def pin(self):
        """T of v = T dq and s of a = T ddq + s."""
        T = np.vstack((-self.jacobian(self.leg)[:, 2:], np.eye(5)))
        q, dq = self.data.qpos[self.order[2:]], self.data.qvel[self.order[2:]]
        shift = np.zeros(7)
        links = (1 + 2 * self.leg, 2 + 2 * self.leg)
        for link, length in zip(links, self.legs.lengths[self.leg], strict=True):
            angle, rate = absolute_angles(q)[link], absolute_angles(dq)[link]
            shift[HIP] += length * rate**2 * np.array([-np.sin(angle), np.cos(angle)])
        return T, shift


def each(count=STATES):
    """Plants with random errors, each at a random state pinned at either foot: plant, leg, q, dq, MuJoCo's walker."""
    rng = np.random.default_rng(13)
    for n in range(count):
        plant = RigidPlant(PlantSettings(timestep=PERIOD, saturation=False, **random_errors(rng)), RABBIT, PERIOD)
        q, dq, leg = rng.uniform(-np.pi, np.pi, 5), rng.uniform(-5, 5, 5), n % 2
        plant.reset(q, dq, LEGS[leg])
        walker = plant._walker
        walker.q[:], walker.dq[:], walker.leg = q, dq, leg
        yield plant, leg, q, dq, Unpinned(plant, leg, q, dq)


def worst(found, expected):
    return np.abs(np.asarray(found) - expected).max() / max(1.0, np.abs(expected).max())


def at(plant, q, dq, leg):
    """M in joint coordinates and what turning and weight do, as the equations have them."""
    row = plant._work[0]
    equations.turn(plant._work[0], q, dq)
    x = np.zeros(5)
    equations.weigh(row, leg, x)
    M = np.array(row["M"])
    links = np.linalg.inv(TURN)  # of the links from the joints
    return links.T @ M @ links, links.T @ -x


def test_inertia_matrix_is_mujocos():
    for plant, leg, q, dq, world in each():
        T, _ = world.pin()
        M, _ = at(plant, q, dq, leg)
        assert worst(M, T.T @ world.inertia() @ T) < 1e-10


def test_bias_is_mujocos():
    for plant, leg, q, dq, world in each():
        T, shift = world.pin()
        _, bias = at(plant, q, dq, leg)
        assert worst(bias, T.T @ (world.inertia() @ shift + world.bias())) < 1e-10


def test_feet_their_velocities_and_the_hip_are_mujocos():
    for plant, leg, _q, _dq, world in each():
        state = plant.state()
        for foot in range(2):
            assert worst(state.foot[foot], world.foot(foot)) < 1e-10
        equations.turn(plant._work[0], state.q, state.dq)
        x, z, dx, dz = equations.swing_foot(plant._work[0])
        assert worst([x, z], world.foot(1 - leg) - world.foot(leg)) < 1e-10
        assert worst([dx, dz], world.velocity(1 - leg) - world.velocity(leg)) < 1e-10
        assert worst(state.hip, world.data.qpos[world.order[HIP]]) < 1e-10
        assert worst(state.dhip, world.data.qvel[world.order[HIP]]) < 1e-10
        joints = plant.legs.foot_jacobian(state.q, 1 - leg) - plant.legs.foot_jacobian(state.q, leg)
        assert worst(joints, (world.jacobian(1 - leg) - world.jacobian(leg))[:, 2:]) < 1e-10


def test_acceleration_and_ground_force_satisfy_mujocos_equations_under_torque_and_pushes():
    rng, compared = np.random.default_rng(5), 0
    for plant, leg, _q, _dq, world in each():
        u = rng.uniform(-50, 50, 4)
        pushes = [AppliedForce(body=n, point=tuple(rng.uniform(-0.2, 0.2, 2)), force=(31.0, -7.0)) for n in LINKS]
        plant.hold(u, pushes)
        ddq, ground = plant._work["slopes"][0, 0, 5:10], plant._work["slopes"][0, 0, 10:]
        if plant.impacts:  # the slopes are those after it
            continue
        compared += 1
        total = np.zeros(7)
        for push in pushes:
            body = world.model.body(push.body).id
            frame = world.data.xmat[body].reshape(3, 3)
            point = world.data.xpos[body] + frame @ [push.point[0], 0.0, push.point[1]]
            force = np.array([push.force[0], 0.0, push.force[1]])
            mujoco.mj_applyFT(world.model, world.data, force, np.zeros(3), point, body, total)
        T, shift = world.pin()
        outside = total[world.order] + world.jacobian(leg).T @ ground
        outside[2:6] += u
        outside -= world.model.dof_damping[world.order] * world.data.qvel[world.order]
        assert worst(world.inertia() @ (T @ ddq + shift) + world.bias(), outside) < 1e-9
    assert compared > STATES // 2


def test_an_impact_keeps_what_mujoco_says_it_keeps():
    for plant, leg, q, _dq, world in each():
        row = plant._walker.land(0.0)[0]
        after = Unpinned(plant, 1 - leg, q, row["dq_after"])
        gained = after.inertia() @ after.data.qvel[after.order] - world.inertia() @ world.data.qvel[world.order]
        assert worst(gained, world.jacobian(1 - leg).T @ row["impulse"]) < 1e-10
        assert worst(after.velocity(leg), row["old_foot"]) < 1e-10
        assert worst(after.velocity(1 - leg), np.zeros(2)) < 1e-10


def test_angles_of_links_and_joints():
    q = np.array([0.1, 0.2, 0.4, 0.7, 1.3])
    assert TURN @ np.array(absolute_angles(q.tolist())) == pytest.approx(q)


def test_a_body_welded_to_a_link_counts_as_a_part_of_it(tmp_path):
    text = RABBIT.read_text()
    marker = '<body name="left_femur">'
    assert marker in text
    load = '<body pos="0.05 0.1 0.3"><inertial pos="0.01 0 0.02" mass="4" diaginertia="0.1 0.2 0.3"/></body>'
    path = tmp_path / "loaded.xml"
    path.write_text(text.replace(marker, load + marker, 1))
    plant = RigidPlant(PlantSettings(timestep=PERIOD), path, PERIOD)
    rng = np.random.default_rng(3)
    q, dq = rng.uniform(-np.pi, np.pi, 5), rng.uniform(-5, 5, 5)
    world = Unpinned(plant, 0, q, dq)
    T, _ = world.pin()
    assert FiveLinks.of(plant.model).mass[0] == pytest.approx(16.0)
    assert worst(at(plant, q, dq, 0)[0], T.T @ world.inertia() @ T) < 1e-10


@pytest.mark.parametrize(
    ("there", "here", "words"),
    [
        ('<body name="left_tibia" pos="0 0 0.4">', '<body name="left_tibia" pos="0.01 0 0.4">', "tibias' pos"),
        ('<body name="left_femur">', '<body name="left_femur" pos="0 0 0.1">', "femurs' pos"),
        ('<joint name="hip_x" ', '<joint name="hip_x" armature="1" ', "armature of hip_x"),
    ],
)
def test_links_that_do_not_hang_on_one_anothers_axes_are_refused(tmp_path, there, here, words):
    text = RABBIT.read_text()
    assert there in text
    path = tmp_path / "other.xml"
    path.write_text(text.replace(there, here, 1))
    with pytest.raises(UserError, match=words):
        RigidPlant(PlantSettings(timestep=PERIOD), path, PERIOD)


def test_dry_friction_takes_its_power():
    friction = np.array([4.0, 4.0, 2.0, 2.0])
    torques = JointTorques(left_hip=4.0, right_hip=4.0, left_knee=2.0, right_knee=2.0)
    settings = PlantSettings(timestep=PERIOD, damping_factor=NO_DAMPING, joint_friction=torques)
    plant = RigidPlant(settings, RABBIT, PERIOD)
    plant.reset(np.array([3.54, 2.92, -0.36, -0.15, 0.015]), np.array([1.4, 0.2, -2.7, -0.3, -1.0]), "left")
    energies, energy, rates = Energy(plant.model), [], []
    for _ in range(100):
        state = plant.state()
        energy.append(energies.about(state.q, state.dq, state.hip, state.dhip, 0.0))
        rates.append(state.dq[:4])
        plant.hold(np.zeros(4))
    assert not plant.impacts
    energy, rates = np.array(energy), np.array(rates)
    power = np.sum(friction * np.tanh(rates / equations.SLIDING) * rates, axis=1)
    spent = np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) * PERIOD))
    assert spent[-1] > 0.3
    assert energy - energy[0] == pytest.approx(-spent, abs=2e-3)
