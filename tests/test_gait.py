"""Outputs over the clock, and gait files that are refused by name, value and unit."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import oracle
import pytest
from conftest import RABBIT, ROOT

from controller.belief import kernels, load_gait
from controller.belief.closed_loop import outputs
from controller.belief.polynomial import power_basis
from controller.common.errors import UserError

PAPER = (RABBIT / "gaits" / "paper.toml").read_text()


def test_power_basis_is_the_bernstein_form():
    rng = np.random.default_rng(0)
    for degree in range(2, 9):
        alpha = rng.uniform(-4, 4, (4, degree + 1))
        poly = power_basis(alpha)
        for s in np.linspace(-0.2, 1.2, 29):
            powers = s ** np.arange(degree + 1)
            assert poly @ powers == pytest.approx(oracle.bernstein(alpha, s), abs=1e-9)


def test_derivatives_are_those_of_finite_differences(gait):
    h = 1e-5 * gait.table.theta_span
    for theta in np.linspace(gait.theta_plus, gait.theta_minus, 21):
        (before, slope_before, _), (after, slope_after, _) = gait.desired(theta - h), gait.desired(theta + h)
        value, slope, curvature = gait.desired(theta)
        assert value == pytest.approx(oracle.bernstein(gait.alpha, gait.normalised(theta)), abs=1e-13)
        assert (after - before) / (2 * h) == pytest.approx(slope, abs=1e-6)
        assert (slope_after - slope_before) / (2 * h) == pytest.approx(curvature, abs=1e-4)


def test_ends_of_the_polynomials_are_the_first_and_last_coefficients(gait):
    assert gait.desired(gait.theta_plus)[0] == pytest.approx(gait.alpha[:, 0], abs=1e-14)
    assert gait.desired(gait.theta_minus)[0] == pytest.approx(gait.alpha[:, -1], abs=1e-14)
    assert gait.normalised(gait.theta_plus) == 0.0 and gait.normalised(gait.theta_minus) == pytest.approx(1.0)


def test_clock_runs_from_the_mirrored_posture_to_the_posture_before_impact(gait):
    assert gait.theta_minus == pytest.approx(gait.clock @ gait.q_minus)
    assert gait.theta_plus == pytest.approx(gait.clock @ oracle.R @ gait.q_minus)
    assert (gait.theta_plus, gait.theta_minus) == pytest.approx((-3.375, -2.860), abs=1e-3)


def test_compiled_outputs_are_equation_5(gait, walking_states):
    stage = kernels.new_stage()
    for q, dq in walking_states(200):
        theta, dtheta = outputs(gait.table, q, dq, stage)
        assert (theta, dtheta) == pytest.approx((gait.clock @ q, gait.clock @ dq))
        desired, slope, curvature = gait.desired(theta)
        assert stage.y == pytest.approx(q[:4] - desired, abs=1e-11)
        assert stage.dy == pytest.approx(dq[:4] - slope * dtheta, abs=1e-9)
        assert (*stage.h1, *stage.h2) == pytest.approx((*slope, *curvature), rel=1e-8, abs=1e-8)


def test_the_papers_table_closes_on_itself(gait, model):
    """What the impact leaves is, to the table's two decimals, on the polynomials' start."""
    q, dq = gait.post_impact(model)
    start, slope, _ = gait.desired(gait.theta_plus)
    assert q[:4] == pytest.approx(start, abs=0.01)
    assert dq[:4] == pytest.approx(slope * (gait.clock @ dq), abs=0.1)


# Files

ALPHA = np.array(tomllib.loads(PAPER)["alpha"])
BAD = {
    "not toml": (lambda text: "alpha = [", ["TOML"]),
    "alpha missing": (lambda text: text.replace("alpha =", "beta ="), ["alpha is missing", "4 rows"]),
    "clock missing": (lambda text: text.replace("clock =", "clok ="), ["clock is missing", "5 numbers"]),
    "three rows": (lambda text: with_alpha(ALPHA[:3]), ["alpha has shape (3, 7)", "4 rows"]),
    "two columns": (lambda text: with_alpha(ALPHA[:, :2]), ["alpha has shape (4, 2)", "at least 3"]),
    "ragged": (lambda text: text.replace("2.93, 2.92]", "2.93]"), ["alpha", "equal length"]),
    "words": (lambda text: text.replace("3.66", '"x"'), ["alpha", "numbers"]),
    "nan": (lambda text: text.replace("3.66", "nan"), ["alpha", "not finite"]),
    "inf in q_minus": (lambda text: text.replace("0.015]", "inf]"), ["q_minus", "not finite"]),
    "four rates": (lambda text: text.replace("-0.21, -0.16,", "-0.21,"), ["dq_minus has shape (4,)", "5 numbers"]),
    "degree": (lambda text: text.replace("degree = 6 ", "degree = 5 "), ["degree = 5", "7 columns", "must be"]),
    "clock backwards": (lambda text: text.replace("[-1.0, 0.0, -0.5", "[1.0, 0.0, 0.5"), ["clock", "rad", "must grow"]),
    "posture before impact": (
        lambda text: text.replace("2.92],", "2.82],"),
        ["not periodic", "posture before", "0.1 rad", "up to 0.01 rad"],
    ),
    "posture after impact": (
        lambda text: text.replace("[3.54, 3.66", "[3.34, 3.66"),
        ["not periodic", "posture after", "0.2 rad", "up to 0.01 rad"],
    ),
    "rates after impact": (
        lambda text: text.replace("-0.85]", "-1.85]"),
        ["not periodic", "rates after", "rad/s", "up to 0.1 rad/s"],
    ),
    "integer beyond a float": (lambda text: text.replace("3.66", "9" * 400), ["alpha", "numbers"]),
    "integer beyond words": (lambda text: text.replace("degree = 6", f"degree = 0x{'f' * 5000}"), ["TOML", "digits"]),
    "degree beyond a float": (
        lambda text: text.replace("degree = 6", f"degree = {'9' * 400}"),
        [f"degree = {'9' * 40} but", "7 columns"],
    ),
    "tolerance beyond a float": (
        lambda text: text.replace("_rad = 0.01", f"_rad = {'9' * 400}"),
        [f"periodicity_tolerance_rad = {'9' * 40}; must be", "up to 1e+06"],
    ),
    "tolerance zero": (
        lambda text: text.replace("_rad = 0.01", "_rad = 0"),
        ["periodicity_tolerance_rad = 0", "above 0"],
    ),
    "tolerance true": (
        lambda text: text.replace("_rad_s = 0.1", "_rad_s = true"),
        ["periodicity_tolerance_rad_s = True", "above 0"],
    ),
}


def with_alpha(alpha):
    head = PAPER[: PAPER.index("alpha = [")].replace("degree = 6", f"degree = {alpha.shape[1] - 1}")
    return f"{head}alpha = {alpha.tolist()}\n"


@pytest.mark.parametrize("case", BAD)
def test_a_bad_gait_file_is_refused(case, tmp_path, model):
    change, words = BAD[case]
    path = tmp_path / "bad.toml"
    path.write_text(change(PAPER))
    assert path.read_text() != PAPER
    with pytest.raises(UserError) as caught:
        load_gait(path, model)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and "\n" not in message
    for word in words:
        assert word in message, message


def test_a_missing_gait_file_is_refused(tmp_path, model):
    with pytest.raises(UserError, match=r"none\.toml: no such gait"):
        load_gait(tmp_path / "none.toml", model)


def test_a_gait_file_that_is_no_text_is_refused(tmp_path, model):
    (tmp_path / "bad.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UserError, match=r"bad\.toml: not a TOML file"):
        load_gait(tmp_path / "bad.toml", model)


def test_a_gait_file_that_cannot_be_read_is_refused(tmp_path, model, monkeypatch):
    def denied(*_, **__):
        raise PermissionError(13, "Permission denied")

    path = tmp_path / "mine.toml"
    path.write_text(PAPER)
    monkeypatch.setattr(Path, "read_text", denied)
    with pytest.raises(UserError, match=r"mine\.toml: cannot be read: Permission denied"):
        load_gait(path, model)


def test_a_gait_file_is_utf_8_whatever_the_locale(tmp_path):
    """In a Python that raises where the locale would choose an encoding."""
    path, urdf = tmp_path / "mine.toml", RABBIT / "rabbit.urdf"
    path.write_text(re.sub("(?m)^name = .*", 'name = "trot é"', PAPER), encoding="utf-8")
    code = (
        "import sys, warnings\nfrom pathlib import Path\nfrom controller.belief import WalkerModel, load_gait\n"
        "model = WalkerModel(Path(sys.argv[2]))\nwarnings.simplefilter('error', EncodingWarning)\n"
        "print(ascii(load_gait(Path(sys.argv[1]), model).name))"
    )
    words = [sys.executable, "-X", "warn_default_encoding", "-c", code, path, urdf]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == r"'trot \xe9'", done.stderr
