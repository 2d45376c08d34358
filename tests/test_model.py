"""Laws of mechanics the belief obeys, and the files it refuses."""

import re
from pathlib import Path

import numpy as np
import oracle
import pytest
from conftest import RABBIT

from controller.belief import WalkerModel
from controller.belief.lumped import Joints, lump
from controller.belief.model import B
from controller.common.errors import UserError
from controller.common.records import Leg, swap_legs

URDF = (RABBIT / "rabbit.urdf").read_text()


def test_inertia_is_symmetric_positive_definite(model, random_states):
    for q, dq in random_states(200, seed=1):
        D = model.dynamics(q, dq).D
        assert np.abs(D - D.T).max() < 1e-12
        assert np.linalg.eigvalsh(D)[0] > 0.0


def test_inertia_rate_minus_twice_coriolis_is_skew(model, random_states):
    h = 1e-6
    for q, dq in random_states(200, seed=2):
        dD = (model.dynamics(q + h * dq, dq).D - model.dynamics(q - h * dq, dq).D) / (2 * h)
        S = dD - 2 * model.dynamics(q, dq).C
        assert np.abs(S + S.T).max() < 1e-6 * max(1.0, np.abs(dD).max())


def test_gravity_is_the_slope_of_potential_energy(model, walker, random_states):
    h = 1e-6
    for q, dq in random_states(50, seed=3):
        slope = [(walker.energies(q + h * e, dq)[1] - walker.energies(q - h * e, dq)[1]) / (2 * h) for e in np.eye(5)]
        assert model.dynamics(q, dq).G == pytest.approx(slope, abs=1e-6 * 32 * 9.81)


def test_input_matrix_leaves_the_torso_unactuated(model):
    assert np.array_equal(model.dynamics(np.zeros(5), np.zeros(5)).B, B)
    assert np.array_equal(B, np.vstack([np.eye(4), np.zeros((1, 4))]))


def test_work_is_energy_without_damping(model, walker, gait):
    """Over 0.3 s energy grows by the work of the torques; halving Runge-Kutta's step gains 16 times."""
    undamped = lump(model.torso, model.femur, model.tibia, Joints(), 9.81)
    free = WalkerModel(model.path)
    free.lumped = undamped
    u = np.array([20.0, -10.0, 5.0, 3.0])  # [N.m]

    def flow(x):
        q, dq = x[:5], x[5:10]
        return np.concatenate([dq, free.acceleration(q, dq, u), [u @ dq[:4]]])

    q, dq = gait.post_impact(model)
    start = np.concatenate([q, dq, [0.0]])

    def imbalance(steps):
        end = oracle.runge_kutta(flow, start, 0.3, steps)
        return sum(walker.energies(end[:5], end[5:10])) - sum(walker.energies(q, dq)) - end[10]

    coarse, fine = imbalance(60), imbalance(120)
    assert abs(fine) < 1e-4  # [J] of some 250
    assert abs(coarse / fine) > 10.0


def test_damping_takes_energy(model, random_states):
    undamped = WalkerModel(model.path)
    undamped.lumped = lump(model.torso, model.femur, model.tibia, Joints(), 9.81)
    for q, dq in random_states(50, seed=4):
        D = model.dynamics(q, dq).D
        lost = dq @ D @ (undamped.acceleration(q, dq, np.zeros(4)) - model.acceleration(q, dq, np.zeros(4)))
        assert lost == pytest.approx(np.sum(model.damping * dq[:4] ** 2), rel=1e-9)


def test_stance_force_is_linear_in_torque(model, random_states):
    rng = np.random.default_rng(5)
    for q, dq in random_states(50, seed=5):
        u = rng.uniform(-75, 75, 4)
        at_rest, per_torque = model.stance_force(q, dq, np.zeros(4))
        assert model.stance_force(q, dq, u)[0] == pytest.approx(at_rest + per_torque @ u, abs=1e-7)


# Impact


def kinetic(model, q, dq):
    return 0.5 * dq @ model.dynamics(q, dq).D @ dq


def test_impact_never_adds_energy(model, random_states):
    for q, dq in random_states(300, seed=6):
        before, after = kinetic(model, q, dq), kinetic(model, *model.impact(q, dq))
        assert after <= before * (1 + 1e-12)


def test_landed_foot_stays_and_a_second_impact_of_a_still_foot_changes_nothing(model, walker, random_states):
    """The new swing foot is the old stance foot; if it does not move, pinning it takes nothing away."""
    for q, dq in random_states(50, seed=7):
        q_plus, dq_plus = model.impact(q, dq)
        # Rates that leave the swing foot at rest: the impact must keep them.
        q_e, _ = walker.unpinned(q_plus, dq_plus)
        J = walker.jacobian(q_e, oracle.SWING_FOOT) @ walker.pin_map(q_e)
        still = dq_plus - np.linalg.pinv(J) @ J @ dq_plus
        _, again = model.impact(q_plus, still)
        assert again == pytest.approx(swap_legs(still), abs=1e-8)


def test_impact_keeps_its_arguments_and_is_linear_in_rates(model, random_states):
    (q, dq), (_, other) = random_states(2, seed=8)
    kept_q, kept_dq = q.copy(), dq.copy()
    a, b, both = (model.impact(q, v)[1] for v in (dq, other, dq + 2 * other))
    assert np.array_equal(q, kept_q) and np.array_equal(dq, kept_dq)
    assert both == pytest.approx(a + 2 * b, abs=1e-9)


def test_exchanging_the_legs_twice_is_nothing(random_states):
    for q, dq in random_states(20):
        assert np.array_equal(swap_legs(swap_legs(q)), q)
        assert np.array_equal(swap_legs(q), oracle.R @ q)
        for leg in Leg:
            assert np.array_equal(leg.from_body(leg.from_body(dq[:4])), dq[:4])
            assert leg.other.other is leg is not leg.other
    assert np.array_equal(oracle.R @ oracle.R, np.eye(5))


# Files


def edited(tmp_path, pattern, replacement, count=0):
    text, made = re.subn(pattern, replacement, URDF, count=count, flags=re.S)
    assert made, pattern
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    return path


def refuse(path, *words):
    with pytest.raises(UserError) as caught:
        WalkerModel(path)
    message = str(caught.value)
    assert "\n" not in message and str(path) in message
    for word in words:
        assert word in message, message


def test_missing_file(tmp_path):
    refuse(tmp_path / "none.urdf", "no such")


def test_unreadable_file(tmp_path, monkeypatch):
    def denied(*_):
        raise PermissionError(13, "Permission denied")

    path = edited(tmp_path, "torso", "torso")
    monkeypatch.setattr(Path, "read_bytes", denied)
    refuse(path, "cannot be read: Permission denied")


@pytest.mark.parametrize("content", ["", "not xml", "<robot name='x'/>", "<mujoco/>"])
def test_not_a_urdf(tmp_path, content):
    path = tmp_path / "bad.urdf"
    path.write_text(content)
    refuse(path)


def test_another_topology(tmp_path):
    refuse(edited(tmp_path, r'name="right_knee"', 'name="right_ankle"'), "right_ankle", "must be", "right_knee")


@pytest.mark.parametrize(
    ("pattern", "replacement", "words"),
    [
        (r'<parent link="left_femur"/>', '<parent link="torso"/>', ["left"]),
        (r'<axis xyz="0 -1 0"/>', '<axis xyz="1 0 0"/>', ["left_hip", "(0, -1, 0)"]),
        (r'<axis xyz="0 -1 0"/>', '<axis xyz="0 1 0"/>', ["left_hip", "(0, -1, 0)"]),
        (r'<mass value="12"/>', '<mass value="0"/>', ["mass", "0.0 kg", "above 0 kg"]),
        (r'<mass value="12"/>', '<mass value="-1"/>', ["mass", "-1.0 kg", "above 0 kg"]),
        (r'<mass value="12"/>', '<mass value="nan"/>', []),
        (r'<mass value="12"/>', '<mass value="heavy"/>', []),
        (r'iyy="1.33"', 'iyy="0"', ["inertia", "0.0 kg m^2", "above 0"]),
        (r'iyy="0.47"', 'iyy="-0.47"', ["inertia", "left_hip", "-0.47 kg m^2"]),
        (r'<origin xyz="0 0 0"/>', '<origin xyz="0.1 0 0"/>', ["left_hip", "torso's origin"]),
        (r'<origin xyz="0 0 0.24"/>', '<origin xyz="0 0.02 0.24"/>', ["centre of mass", "0.02", " m;"]),
        (r'<origin xyz="0 0 0"/>', '<origin xyz="0 0 0" rpy="0 3.14159 0"/>', ["left_hip", "rotated", "walker new"]),
        (r'<dynamics damping="5" friction="0"/>', '<mimic joint="left_hip"/>', ["left_knee", "mimics"]),
        (r'<origin xyz="0 0 0.4"/>', '<origin xyz="0 0 -0.4"/>', ["left_knee", "-0.4", " m;", "above 0 m"]),
        (r'<mass value="6.8"/>', '<mass value="7"/>', ["left and right leg differ"]),
        (r'effort="75"', 'effort="0"', ["effort limit", "N.m", "above 0"]),
        (r'effort="75"', 'effort="80"', ["effort limit", "80.0", "N.m", "differs"]),
        (r'damping="10"', 'damping="-10"', ["damping", "-10.0", "N.m.s/rad", "not below 0"]),
        (r'"left_tip"(.*?)link="left_foot"', r'"left_tip"\1link="left_toe"', []),
        (r'<link name="left_foot"/>\s*<joint name="left_tip".*?</joint>', "", ["left_foot"]),
        (
            r"</robot>",
            '<link name="tail"/><joint name="tail" type="continuous"><parent link="torso"/><child link="tail"/>'
            '<axis xyz="0 -1 0"/></joint></robot>',
            ["tail", "must be"],
        ),
    ],
)
def test_a_walker_that_can_not_be(tmp_path, pattern, replacement, words):
    refuse(edited(tmp_path, pattern, replacement, count=1), *words)


def test_a_heavier_walker_is_read_as_such(tmp_path, model):
    heavier = WalkerModel(edited(tmp_path, r'<mass value="12"/>', '<mass value="24"/>'))
    assert heavier.torso.mass == 24.0 and heavier.lumped.mass == model.lumped.mass + 12.0
    assert heavier.femur == model.femur
