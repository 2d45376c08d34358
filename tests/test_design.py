"""Gaits on the zero dynamics against the full model; designed gaits keep what was asked."""

import dataclasses
import re

import numpy as np
import pytest
from conftest import RABBIT
from random_walkers import random_model

from controller.belief import Gains, Loop, WalkerModel, load_gait
from controller.common.errors import UserError
from controller.design import gait_file, orbit_kernels
from controller.design.check import check, invariance_error, requirements_of
from controller.design.compare import compare
from controller.design.gains import score
from controller.design.optimise import Infeasible, design
from controller.design.orbit import periodic_orbit, quadrature
from controller.design.orbit_kernels import decay
from controller.design.parameters import Parametrisation, closed, elevate, posture
from controller.design.poincare import return_map, step
from controller.design.polish import polish
from controller.design.requirements import Requirements
from controller.design.transverse import transverse_eigenvalues
from controller.fitting.library import GaitLibrary, file_name

PAPER_EIGENVALUE = 0.75


@pytest.fixture(scope="module")
def polished(model, gait):
    return polish(model, gait)


@pytest.fixture(scope="module")
def designed(model):
    return design(model, Requirements(step_length=0.4, speed=0.8))


@pytest.fixture(scope="module")
def small(model):
    """Of a lower degree, for what any optimum shows: half the time."""
    return design(model, Requirements(step_length=0.4, speed=0.8), degree=4)


@pytest.fixture(scope="module")
def library(model):
    return GaitLibrary.load(RABBIT / "gaits", model)


def random_gait(model, seed):
    """Some vector of free numbers near a walk."""
    rng = np.random.default_rng(seed)
    space = Parametrisation(model=model, degree=6, step_length=0.4)
    p = space.vector(load_gait(RABBIT / "gaits" / "paper.toml", model)) + rng.normal(scale=0.02, size=space.size)
    return closed(model, space.gait(p))


# Zero dynamics


def test_quadrature_is_exact_for_smooth_integrands():
    s, integrals = quadrature(25)
    assert integrals @ np.exp(s) == pytest.approx(np.exp(s) - 1, abs=1e-13)
    assert integrals @ np.sin(3 * s) == pytest.approx((1 - np.cos(3 * s)) / 3, abs=1e-13)


@pytest.mark.parametrize("seed", range(4))
def test_any_vector_of_free_numbers_is_invariant_and_periodic_on_the_full_model(model, gains, seed):
    gait = random_gait(model, seed)
    orbit = periodic_orbit(model, gait)
    assert invariance_error(model, gait) < 1e-10
    x = np.r_[gait.q_minus, gait.dq_minus]
    end, time, peak, _ = step(model, gait, gains, x)
    assert end == pytest.approx(x, abs=1e-9)
    assert time == pytest.approx(orbit.step_time, abs=1e-9)
    assert peak == pytest.approx(np.abs(orbit.u).max(axis=0), rel=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_zero_dynamics_and_impact_of_errors_give_every_eigenvalue_of_the_full_map(model, gains, seed):
    gait = random_gait(model, seed)
    orbit = periodic_orbit(model, gait)
    short = np.abs(np.r_[orbit.delta**2, transverse_eigenvalues(model, gait, orbit, gains)])
    full = np.abs(return_map(model, gait, gains).eigenvalues)
    assert np.sort(short)[::-1] == pytest.approx(full, abs=1e-4)


def test_decay_solves_the_output_dynamics():
    gains = Gains(kp=np.array([60.0, 25.0, 1.0, 0.0]), kd=np.array([10.0, 10.0, 10.0, 0.0]))  # under-, critical, over-
    h = 1e-6
    slope = (decay(gains, 0.3 + h) - decay(gains, 0.3 - h)) / (2 * h)
    A = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.diag(gains.kp), -np.diag(gains.kd)]])
    assert slope == pytest.approx(A @ decay(gains, 0.3), abs=1e-7)
    assert decay(gains, 0.0) == pytest.approx(np.eye(8))


def test_a_full_step_converges_with_fourth_order(model, gains, polished):
    loop = Loop(model.lumped, polished.table, gains)
    x = np.r_[polished.q_minus, polished.dq_minus]
    x[4] -= 0.01
    ends = []
    for h in (4e-3, 2e-3, 1e-3):
        ends.append(orbit_kernels.full_step(loop, model.torque_limits, x, h, 0, 2.0).x)
    ratio = np.abs(ends[0] - ends[1]).max() / np.abs(ends[1] - ends[2]).max()
    assert 10 < ratio < 25


def test_posture_stands_on_level_ground(model):
    q = posture(model, -0.2, -0.4, 0.1, 0.37)
    ahead, height, _ = model.swing_foot(q, np.zeros(5))
    assert (ahead, height) == pytest.approx((0.37, 0.0), abs=1e-12)
    assert q[2:] == pytest.approx([-0.2, -0.4, 0.1])


def test_a_gait_becomes_its_vector_and_back(model, designed):
    for degree, length in ((6, 0.4), (6, None), (8, 0.4)):
        space = Parametrisation(model=model, degree=degree, step_length=length)
        again = space.gait(space.vector(designed.gait))
        assert again.alpha == pytest.approx(elevate(designed.gait.alpha, degree), abs=1e-9)


# The paper's gait


def test_polished_gait_is_the_papers_and_exact(model, gait, gains, polished):
    assert np.abs(polished.alpha - gait.alpha).max() <= 0.02
    found = return_map(model, polished, gains)
    assert found.residual <= 1e-8
    restricted = periodic_orbit(model, polished).delta ** 2
    assert restricted == pytest.approx(PAPER_EIGENVALUE, abs=0.01)
    assert found.largest == pytest.approx(restricted, abs=1e-4)


def test_shipped_polished_gait_is_what_polishing_gives(model, polished):
    shipped = load_gait(RABBIT / "gaits" / "paper-polished.toml", model)
    assert shipped.alpha == pytest.approx(polished.alpha, abs=1e-6)


# Design


def test_designed_gait_keeps_what_was_asked_and_is_cheaper_than_the_papers(model, designed, polished):
    report = check(model, designed.gait, Requirements(step_length=0.4, speed=0.8))
    assert report.passed, [finding for finding in report.findings if finding.holds is False]
    assert (report.orbit.step_length, report.orbit.step_time) == pytest.approx((0.4, 0.5), abs=1e-6)
    assert report.orbit.cost <= periodic_orbit(model, polished).cost


def test_design_finds_the_same_optimum_from_elsewhere(model, designed, gait):
    other = design(model, Requirements(step_length=0.4, speed=0.8), warm=gait)
    assert other.orbit.cost == pytest.approx(designed.orbit.cost, rel=1e-3)


def test_same_request_same_bytes(model, small):
    again = design(model, Requirements(step_length=0.4, speed=0.8), degree=4)
    texts = [gait_file.to_toml(model, found.gait, found.orbit) for found in (small, again)]
    assert texts[0] == texts[1]


def test_a_requirement_that_bites_is_kept_at_a_price(model, small):
    upright = design(model, Requirements(step_length=0.4, speed=0.8, torso_max=0.1), degree=4)
    assert np.abs(upright.orbit.q[:, 4]).max() <= 0.1 < np.abs(small.orbit.q[:, 4]).max()
    assert upright.orbit.cost > small.orbit.cost


def test_work_is_cheaper_where_work_is_the_cost(model, small):
    need = Requirements(step_length=0.4, speed=0.8)
    thrifty = design(model, need, cost="work", degree=4, warm=small.gait)
    assert thrifty.orbit.work < small.orbit.work


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (dict(step_length=2.0, speed=0.8), ["step length", "2 m", "must be below 1.6 m"]),
        (dict(step_length=-0.4, speed=0.8), ["step length", "above 0"]),
        (dict(step_length=0.4, speed=float("nan")), ["speed", "above 0"]),
        (dict(step_length=1.59, speed=0.8), ["1.59 m"]),
    ],
)
def test_what_no_gait_can_keep_is_refused_by_name(model, request_, words):
    with pytest.raises(UserError) as caught:
        design(model, Requirements(**request_))
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_infeasible_names_what_stands_in_the_way(model):
    with pytest.raises(Infeasible, match="torque misses by"):
        design(model, Requirements(step_length=0.4, speed=0.8, torque_share=0.05), degree=4)


def test_another_walker_gets_its_own_gait(tmp_path, gains):
    other = random_model(3, tmp_path)
    found = design(other, Requirements(step_length=0.4, speed=0.8))
    assert check(other, found.gait, Requirements(step_length=0.4, speed=0.8)).passed


# Files


def test_a_gait_file_comes_back_to_the_last_bit(model, designed, tmp_path):
    path = tmp_path / "g.toml"
    path.write_text(gait_file.to_toml(model, designed.gait, designed.orbit))
    again = load_gait(path, model)
    assert np.array_equal(again.alpha, designed.gait.alpha)
    assert np.array_equal(again.dq_minus, designed.gait.dq_minus)


def test_a_gait_of_another_walker_is_refused(model):
    tac = WalkerModel(RABBIT.parent / "rabbit-tac" / "rabbit-tac.urdf")
    path = next((RABBIT.parent / "rabbit-tac" / "gaits").glob("*.toml"))
    assert load_gait(path, tac).name == path.stem
    with pytest.raises(UserError, match=f"rabbit-tac.*{tac.fingerprint}.*{model.fingerprint}"):
        load_gait(path, model)


def test_fingerprint_sees_every_link_number(model):
    for name in ("torso", "femur", "tibia"):
        for field in dataclasses.fields(getattr(model, name)):
            other = WalkerModel(RABBIT / "rabbit.urdf")
            link = getattr(other, name)
            setattr(other, name, dataclasses.replace(link, **{field.name: getattr(link, field.name) + 1e-3}))
            assert other.fingerprint != model.fingerprint


# Library


def test_library_gaits_are_exact_and_keep_the_requirements(model, library, gains):
    assert len(library.speeds) >= 7 and (library.speeds[0], library.speeds[-1]) == (0.5, 1.1)
    for speed in library.speeds:
        gait = load_gait(RABBIT / "gaits" / file_name(0.4, speed), model)
        report = check(model, gait, requirements_of(model, gait))
        assert report.passed, (speed, [finding for finding in report.findings if finding.holds is False])
        assert (report.orbit.speed, report.orbit.step_length) == pytest.approx((speed, 0.4), abs=1e-5)


@pytest.mark.parametrize(("speed", "length"), [(0.55, 0.4), (0.76, 0.37), (0.93, 0.43), (1.05, 0.4)])
def test_gaits_between_the_librarys_are_periodic_and_as_fast_as_asked(model, library, gains, speed, length):
    gait = library.gait(speed, length)
    orbit = periodic_orbit(model, gait)
    assert (orbit.speed, orbit.step_length) == pytest.approx((speed, length), rel=2e-6)
    found = return_map(model, gait, gains)
    assert found.residual < 1e-8 and found.largest < 0.9


def test_library_is_continuous_in_speed(library):
    for speed in library.speeds[1:-1]:
        below, at, above = (library.gait(speed + d, 0.4).alpha for d in (-1e-5, 0.0, 1e-5))
        assert np.abs(above - at).max() < 1e-3 and np.abs(at - below).max() < 1e-3


@pytest.mark.parametrize(("speed", "length", "word"), [(0.3, 0.4, "speed = 0.3"), (0.8, 0.6, "step length = 0.6")])
def test_outside_the_library_is_refused(library, speed, length, word):
    with pytest.raises(UserError, match=f"{word}.*must be"):
        library.gait(speed, length)


def test_a_library_of_too_low_a_degree_is_refused(model, tmp_path):
    text = (RABBIT / "gaits" / "paper.toml").read_text()
    head = re.sub("(?m)^(degree|periodicity).*", "", text[: text.index("alpha = [")])
    rows = "alpha = [[3, 3, 3], [3, 3, 3], [0, 0, 0], [0, 0, 0]]"
    wide = "periodicity_tolerance_rad = 1e6\nperiodicity_tolerance_rad_s = 1e6"
    (tmp_path / "L0.40-v0.80.toml").write_text(f"{head}\n{rows}\n{wide}\n")
    with pytest.raises(UserError, match=r"L0\.40-v0\.80\.toml: degree 2; must be 4 or more"):
        GaitLibrary.load(tmp_path, model)


def test_an_empty_folder_is_no_library(model, tmp_path):
    with pytest.raises(UserError, match="no library gaits"):
        GaitLibrary.load(tmp_path, model)


# Gains


TWENTY = Gains(kp=np.full(4, 20.0), kd=np.full(4, 20.0))


def test_score_counts_slow_decay_and_torque(model, polished, gains):
    paper, weak = score(model, polished, gains, 1e-3), score(model, polished, TWENTY, 1e-3)
    assert paper.value < weak.value
    assert paper.largest == pytest.approx(PAPER_EIGENVALUE, abs=0.01)
    hard = score(model, polished, Gains(kp=np.full(4, 700.0), kd=np.full(4, 70.0)), 1e-3)
    assert hard.torque_excess > 0.0


# Comparison


def test_a_gait_is_no_way_apart_from_itself_of_a_higher_degree(model, designed):
    space = Parametrisation(model=model, degree=8, step_length=0.4)
    higher = closed(model, space.gait(space.vector(designed.gait)))
    found = compare(model, designed.gait, higher)
    assert found.alpha.shape == (2, 4, 9) and np.abs(found.apart).max() < 1e-8
    for measure in found.measures:
        assert measure.second == pytest.approx(measure.first, rel=1e-6, abs=1e-8), measure.name


def test_a_gait_printed_to_two_decimals_is_told_from_its_orbit(model, gait, polished):
    figures = {m.name: m for m in compare(model, gait, polished).measures}
    off = figures["off_orbit_rad_s"]
    assert off.first > 0.05 and off.second < 1e-9
    by_hand = np.abs(gait.dq_minus - periodic_orbit(model, gait).dq[-1]).max()
    assert off.first == pytest.approx(by_hand)
