"""The Poincare analysis finds what is there: on maps of known eigenvalues, and on the walker."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from sim import cli
from sim.bridge.run import build_rig
from sim.plant.kinematics import LegGeometry
from sim.scenario import Scenario, with_values
from sim.stability import poincare
from sim.stability.fixed_point import find_fixed_point
from sim.stability.sections import Surface, to_stance_order
from sim.stability.step_map import Fell, StepMap, distance, jacobian

LEGS = LegGeometry(lengths=((0.4, 0.4), (0.4, 0.4)))
SURFACE = Surface(LEGS)
X0 = np.array([2.92, 3.54, -0.15, -0.36, 0.015, -0.21, -0.16, -0.25, 0.23, -0.85])
EIGENVALUES = np.array([0.75, -0.3, 0.2, 0.1, 0.05, 0.0, 0.02, 0.01, 0.005])


def linear_map(eigenvalues: NDArray, *, jump: float = 0.0, seed: int = 3) -> tuple[StepMap, NDArray]:
    """A map along the surface with these eigenvalues about its fixed point, and curvature; steps of `jump` on top."""
    rng = np.random.default_rng(seed)
    fixed = SURFACE.project(X0)
    V = SURFACE.basis(fixed)
    basis = rng.normal(size=(9, 9))
    A = basis @ np.diag(eigenvalues) @ np.linalg.inv(basis)

    def P(x: NDArray) -> NDArray:
        w = V.T @ (x - fixed)
        step = jump * math.floor(1e4 * float(w.sum())) % (2 * jump) if jump else 0.0
        return SURFACE.project(fixed + V @ (A @ w + 0.3 * w * w + step))

    return P, fixed


def test_states_of_the_surface_are_on_it_and_its_directions_stay_there() -> None:
    x = SURFACE.project(X0)
    assert abs(SURFACE.height(x[:5])) < 1e-15
    V = SURFACE.basis(x)
    assert V.T @ V == pytest.approx(np.eye(9), abs=1e-12)
    assert SURFACE.gradient(x[:5]) @ V[:5] == pytest.approx(np.zeros(9), abs=1e-12)
    h = 1e-6
    slope = [(SURFACE.height(x[:5] + h * e) - SURFACE.height(x[:5] - h * e)) / (2 * h) for e in np.eye(5)]
    assert SURFACE.gradient(x[:5]) == pytest.approx(slope, abs=1e-9)


def test_stance_order_is_its_own_mirror() -> None:
    q, dq = np.arange(5.0), np.arange(5.0, 10.0)
    assert to_stance_order(q, dq, "left").tolist() == list(range(10))
    assert to_stance_order(q, dq, "right").tolist() == [1, 0, 3, 2, 4, 6, 5, 8, 7, 9]


@pytest.mark.parametrize("largest", [0.75, -0.9, 1.4])
def test_the_fixed_point_is_found_even_if_it_is_unstable(largest: float) -> None:
    P, fixed = linear_map(np.array([largest, *EIGENVALUES[1:]]))
    start = fixed + 1e-3 * SURFACE.basis(fixed) @ np.ones(9)
    found = find_fixed_point(P, SURFACE, start, settling=3)
    assert found.converged
    assert found.x == pytest.approx(fixed, abs=1e-9)


def test_eigenvalues_are_those_of_the_map() -> None:
    P, fixed = linear_map(EIGENVALUES)
    found = poincare.analyse(P, SURFACE, fixed)
    assert np.sort(np.abs(found.eigenvalues)) == pytest.approx(np.sort(np.abs(EIGENVALUES)), abs=1e-4)
    assert found.largest == pytest.approx(0.75, abs=1e-4)
    assert found.noise < 1e-3
    assert found.roughness < 1e-6
    assert [row.h for row in found.study] == list(poincare.STEP_SIZES)


def test_jumps_of_the_map_show_as_roughness_and_spoil_small_perturbations_only() -> None:
    P, fixed = linear_map(EIGENVALUES, jump=2e-4)
    found = poincare.analyse(P, SURFACE, fixed)
    assert found.roughness > 5e-5
    assert found.largest == pytest.approx(0.75, abs=0.1)
    assert 1e-4 < found.noise < 0.1
    small = found.study[-1]
    assert small.largest is not None and abs(small.largest - 0.75) > 0.1


def test_a_walk_that_hops_about_for_ever_has_its_mean_for_a_fixed_point() -> None:
    P, fixed = linear_map(EIGENVALUES, jump=1e-3)
    found = find_fixed_point(P, SURFACE, fixed + 1e-2 * SURFACE.basis(fixed) @ np.ones(9))
    assert found.converged
    assert 1e-5 < found.scatter < 0.03
    assert distance(found.x, fixed) < 0.05


def test_a_walk_that_wanders_off_has_none() -> None:
    _, fixed = linear_map(EIGENVALUES)

    def leaving(x: NDArray) -> NDArray:
        return SURFACE.project(x + np.array([0.0] * 5 + [0.4] * 5))

    assert not find_fixed_point(leaving, SURFACE, fixed, newton=0).converged


def test_a_walker_that_falls_has_no_fixed_point() -> None:
    def P(x: NDArray) -> NDArray:
        raise Fell("the hip sank below the fall height")

    found = find_fixed_point(P, SURFACE, X0)
    assert not found.converged
    assert "step 1" in found.message and "hip" in found.message
    with pytest.raises(Fell):
        poincare.analyse(P, SURFACE, X0)


def rig_of(**changes: object):
    return build_rig(with_values(Scenario(), {"plant.timestep": 1e-3, "controller.kind": "zd-pd", **changes}))


def test_the_section_state_of_ticks_is_the_one_the_rigid_plant_locates() -> None:
    """Extrapolated from ticks, as for any plant, against the event located within the tick."""
    rig = rig_of(**{"plant.kind": "rigid"})
    tape = rig.sections()
    tape._plant = object()
    exact = rig.sections()

    class Both:
        frame_every = 0

        def ticks(self, ticks):
            tape.ticks(ticks)
            exact.ticks(ticks)

        def event(self, *a):
            tape.event(*a)
            exact.event(*a)

    rig.run(Both(), steps=3)
    assert len(exact.states) == len(tape.states) == 3
    for ours, theirs in zip(tape.states, exact.states, strict=True):
        assert distance(ours, theirs) < 2e-3
        assert abs(rig.surface.height(ours[:5])) < 1e-12
        assert abs(rig.surface.height(theirs[:5])) < 1e-12


@pytest.mark.parametrize("kind", ["rigid", "mujoco"])
def test_zd_pd_has_about_the_eigenvalue_of_the_paper(kind: str) -> None:
    rig = rig_of(**{"plant.kind": kind, "plant.timestep": 1e-3 if kind == "rigid" else 0.25e-3})
    x = rig.settled(12, 1)[0]
    J = jacobian(rig.step_map, rig.surface, rig.surface.project(x), 1e-2)
    largest = np.abs(np.linalg.eigvals(J)).max()
    assert largest == pytest.approx(0.75, abs=0.02 if kind == "rigid" else 0.05)


def test_the_step_map_does_not_remember(capsys) -> None:
    rig = rig_of(**{"plant.kind": "rigid"})
    x = rig.surface.project(rig.x_gait)
    first = rig.step_map(x)
    rig.step_map(rig.surface.project(x + 1e-2))
    assert rig.step_map(x).tobytes() == first.tobytes()


def test_the_command_says_why_there_is_no_fixed_point(capsys) -> None:
    code = cli.main(["poincare", "payload-x2", "--plant.kind", "rigid", "--controller", "zd-pd", "--quiet"])
    out = capsys.readouterr().out
    assert code == 1
    assert "none found: falls in step 2" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--step-size", "-1"], "--step-size"),
        (["nowhere"], "no scenario 'nowhere'"),
        (["--plant.mass-factor.left-femur", "1.5"], "legs must be alike"),
    ],
)
def test_bad_input_is_named(capsys, words: list[str], message: str) -> None:
    assert cli.main(["poincare", *words]) == 2
    assert message in capsys.readouterr().err
