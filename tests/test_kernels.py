"""The compiled closed form says what Pinocchio says of the unpinned walker, to rounding."""

import numpy as np
import oracle
import pytest

from controller.belief import kernels

STATES = 1000
TOLERANCE = 1e-10  # relative to the largest entry of each quantity


def worst(ours, theirs):
    """Largest relative difference over all states."""
    return max(np.abs(a - b).max() / np.abs(b).max() for a, b in zip(ours, theirs, strict=True))


@pytest.fixture(scope="module")
def states(random_states):
    return random_states(STATES)


@pytest.fixture(scope="module")
def torques():
    return np.random.default_rng(1).uniform(-75, 75, (STATES, 4))


def test_inertia_and_bias_of_the_pinned_walker(model, walker, states):
    ours = [model.dynamics(q, dq) for q, dq in states]
    theirs = [walker.pinned(q, dq) for q, dq in states]
    assert worst([d.D for d in ours], [D for D, _ in theirs]) < TOLERANCE
    biases = [d.C @ dq + d.G for d, (_, dq) in zip(ours, states, strict=True)]
    assert worst(biases, [bias for _, bias in theirs]) < TOLERANCE


def test_acceleration_with_damping(model, walker, states, torques):
    ours = [model.acceleration(q, dq, u) for (q, dq), u in zip(states, torques, strict=True)]
    theirs = [walker.acceleration(q, dq, u) for (q, dq), u in zip(states, torques, strict=True)]
    assert worst(ours, theirs) < TOLERANCE


def test_swing_foot_from_the_pinned_constraint(model, walker, states):
    ours, theirs = [], []
    for q, dq in states:
        q_e, dq_e = walker.unpinned(q, dq)
        assert np.abs(walker.foot(q_e, oracle.STANCE_FOOT)).max() < 1e-12
        velocity = walker.jacobian(q_e, oracle.SWING_FOOT) @ dq_e
        ours.append(np.array(model.swing_foot(q, dq)))
        theirs.append(np.append(walker.foot(q_e, oracle.SWING_FOOT), velocity[1]))
    assert worst(ours, theirs) < TOLERANCE


@pytest.mark.parametrize("foot", [oracle.STANCE_FOOT, oracle.SWING_FOOT])
def test_both_foot_jacobians(model, walker, states, foot):
    """Columns of the feet's Jacobians in the paper's coordinates; the stance foot has none."""
    for q, _ in states:
        q_e, _ = walker.unpinned(q, np.zeros(5))
        theirs = walker.jacobian(q_e, foot) @ walker.pin_map(q_e)
        if foot == oracle.STANCE_FOOT:
            assert np.abs(theirs).max() < TOLERANCE
            continue
        ours = [model.swing_foot(q, column)[2] for column in np.eye(5)]
        assert np.abs(theirs[1] - ours).max() < TOLERANCE


def test_stance_force_is_equation_18(model, walker, states, torques):
    ours = [model.stance_force(q, dq, u) for (q, dq), u in zip(states, torques, strict=True)]
    theirs = [walker.stance_force(q, dq, u) for (q, dq), u in zip(states, torques, strict=True)]
    assert worst([F for F, _ in ours], [F for F, _ in theirs]) < TOLERANCE
    assert worst([S for _, S in ours], [S for _, S in theirs]) < TOLERANCE


def test_impact_is_the_kkt_system_of_the_unpinned_walker(model, walker, states):
    ours = [model.impact(q, dq) for q, dq in states]
    theirs = [walker.impact(q, dq) for q, dq in states]
    assert worst([dq for _, dq in ours], [dq for _, dq in theirs]) < TOLERANCE
    assert all(np.array_equal(a, b) for (a, _), (b, _) in zip(ours, theirs, strict=True))


def test_link_angles_and_back(states):
    phi, back = np.empty(5), np.empty(5)
    for q, _ in states[:20]:
        kernels.to_links(q, phi)
        kernels.from_links(phi, back)
        assert back == pytest.approx(q, abs=1e-14)
        assert phi == pytest.approx([q[4] + q[0], q[4] + q[1], q[4] + q[0] + q[2], q[4] + q[1] + q[3], q[4]])
