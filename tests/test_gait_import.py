"""Others' gaits: a step written down in another program's conventions comes back as the same gait."""

import json

import numpy as np
import pytest
import robots
from conftest import RABBIT
from scipy.io import savemat

from controller.belief import load_gait
from controller.design.frost import read_mat
from controller.design.imported import BASE
from controller.design.orbit import periodic_orbit
from controller.design.polish import polish
from sim.cli import main


def run(capsys, *argv):
    code = main([str(word) for word in argv])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.fixture(scope="module")
def polished(model, gait):
    return polish(model, gait)


@pytest.fixture(scope="module")
def orbit(model, polished):
    return periodic_orbit(model, polished)


def csv(path, columns):
    rows = np.column_stack(list(columns.values()))
    path.write_text(",".join(columns) + "\n" + "\n".join(",".join(repr(float(x)) for x in row) for row in rows))
    return path


def judged(capsys, file, out, *flags):
    code, text, err = run(capsys, "gait", "import", file, "--out", out, "--json", *flags)
    return code, json.loads(text) if text else {}, err


def test_a_trajectory_of_ours(capsys, tmp_path, model, polished, orbit):
    q = orbit.q
    columns = {"t": orbit.t, "left_hip": q[:, 0], "right_hip": q[:, 1], "left_knee": q[:, 2], "right_knee": q[:, 3]}
    file, out = csv(tmp_path / "step.csv", columns | {"torso": q[:, 4]}), tmp_path / "again.toml"
    _, found, err = judged(capsys, file, out)
    assert found["fit_rad"] < 1e-9 and found["polish_rad"] < 1e-6, err
    assert found["step_time_s"] == pytest.approx(orbit.step_time, rel=1e-6)
    assert found["step_time_file_s"] == pytest.approx(orbit.step_time, rel=1e-9)
    assert np.abs(load_gait(out, model).alpha - polished.alpha).max() < 1e-6


def test_others_conventions(capsys, tmp_path, orbit):
    """Links down, axes +y, degrees, base pitch about +y, right foot standing: the walker's own map is used."""
    urdf, folder = tmp_path / "down.urdf", tmp_path / "mine"
    text = robots.urdf(up=-1.0, axis="0 1 0", base=robots.SLIDES, names=("lh", "lk", "rh", "rk"))
    urdf.write_text(text)
    assert run(capsys, "walker", "new", folder, "--urdf", urdf)[0] == 0
    q = np.degrees(orbit.q)
    columns = {"rh": 180.0 - q[:, 0], "lh": 180.0 - q[:, 1], "rk": -q[:, 2], "lk": -q[:, 3], "base_pitch": -q[:, 4]}
    file = csv(tmp_path / "step.csv", columns)
    flags = ["--walker", folder, "--degrees", "--stance", "right"]
    _, found, err = judged(capsys, file, folder / "gaits" / "theirs.toml", *flags)
    assert found["step_time_s"] == pytest.approx(orbit.step_time, rel=1e-6), err
    assert "step_time_file_s" not in found


def records(*rows):
    """Structs of MATLAB in an array."""
    made = np.empty(len(rows), dtype=[(name, object) for name in rows[0]])
    for i, row in enumerate(rows):
        made[i] = tuple(row.values())
    return made


@pytest.fixture(scope="module")
def frost(tmp_path_factory, orbit):
    """A walker of other conventions, and a library of two of its gaits as FROST keeps them; the second is ours."""
    folder = tmp_path_factory.mktemp("frost")
    text = robots.urdf(up=-1.0, axis="0 1 0", base=robots.SLIDES, names=("lh", "lk", "rh", "rk"))
    (folder / "down.urdf").write_text(text)
    assert main(["walker", "new", str(folder / "mine"), "--urdf", str(folder / "down.urdf")]) == 0
    q, rest = orbit.q.T, np.zeros_like(orbit.t)
    columns = {"rh": np.pi - q[0], "lh": np.pi - q[1], "rk": -q[2], "lk": -q[3]}
    order = sorted(columns, key=lambda name: text.index(f'name="{name}"'))
    x = np.vstack([rest, rest + 0.8, -q[4], *(columns[name] for name in order)])
    inputs = {"u": np.zeros((4, len(rest))), "fRightToe": np.zeros((3, len(rest)))}
    step = {"tspan": orbit.t, "states": {"x": x}, "inputs": inputs}
    impact = {"tspan": [], "states": {"x": x[:, -1]}, "inputs": {"fRightToe": np.zeros(3)}}
    library = np.empty((2, 2), dtype=object)
    library[0] = [0.1, records(step | {"states": {"x": 1.1 * x}}, impact)]
    library[1] = [0.2, records(step, impact)]
    savemat(folder / "library.mat", {"gaits": library, "note": "two of them"})
    savemat(folder / "none.mat", {"gaits": records(impact), "x": 3.0})
    savemat(folder / "numbers.mat", {"x": np.arange(3.0)})
    nothing = np.where(x == x[4, 4], np.nan, x)
    for name, states in {"turned": x.T, "nan": nothing, "complex": x + 1j, "text": "x"}.items():
        savemat(folder / f"{name}.mat", {"gaits": records(step | {"states": {"x": states}})})
    savemat(folder / "nostates.mat", {"gaits": records(step | {"states": {"y": x}})})
    odd = {"text": "abc", "record": records(step, impact), "complex": orbit.t + 1j, "back": orbit.t[::-1]}
    for name, tspan in odd.items():
        savemat(folder / f"tspan-{name}.mat", {"gaits": records(step | {"tspan": tspan})})
    (folder / "noise.mat").write_bytes(bytes(range(256)))
    return folder


def test_a_library_of_frost(capsys, frost, orbit):
    """States of the floating base and joints in the order of the robot's file; the contact is named by the inputs."""
    flags = ["--walker", frost / "mine", "--stance", "right", "--number", "2"]
    _, found, err = judged(capsys, frost / "library.mat", frost / "again.toml", *flags)
    assert found["fit_rad"] < 1e-9 and found["step_time_s"] == pytest.approx(orbit.step_time, rel=1e-6), err
    assert found["step_time_file_s"] == pytest.approx(orbit.step_time, rel=1e-9)
    assert "library.mat --number 2 --walker mine --stance right --degree 6" in (frost / "again.toml").read_text()


@pytest.mark.parametrize(
    "name, flags, words",
    [
        ("library.mat", ["--stance", "right"], ["holds 2 gaits", "--number 1 to 2"]),
        ("library.mat", ["--stance", "right", "--number", "3"], ["--number 3: must be 1 to 2"]),
        ("library.mat", ["--number", "2"], ["on the left foot", "stands on: right"]),
        ("none.mat", [], ["none of its phases is a step", "(7, 12 or more)", "it is (7,)"]),
        ("turned.mat", [], ["none of its phases is a step", "7)"]),
        ("nan.mat", [], ["it is not finite numbers"]),
        ("text.mat", [], ["it is not finite numbers"]),
        ("complex.mat", [], ["it is complex"]),
        ("nostates.mat", [], ["it is missing"]),
        ("numbers.mat", [], ["no gait of FROST", "tspan and states.x"]),
        ("noise.mat", [], ["no MATLAB file up to version 7", "-v7"]),
        ("nowhere.mat", [], ["cannot be read"]),
        ("down.urdf", ["--number", "1"], ["only a .mat holds several"]),
    ],
)
def test_a_mat_that_is_no_step_says_why(capsys, frost, name, flags, words):
    code, _, err = run(capsys, "gait", "import", frost / name, "--walker", frost / "mine", "--out", "x.toml", *flags)
    assert code == 2 and err.count("\n") == 1 and all(word in err for word in words), err


@pytest.mark.parametrize("name", ["text", "record", "complex", "back"])
def test_times_of_a_mat_that_are_none_say_nothing_of_the_step(frost, name):
    columns = read_mat((frost / f"tspan-{name}.mat").read_bytes(), ["a", "b", "c", "d"], "right", None, name)
    assert {*columns} == {BASE, "a", "b", "c", "d"}


def test_bezier_outputs_over_another_clock(capsys, tmp_path, polished, orbit):
    """Rows in another order; their clock is twice ours, with an offset."""
    rows = ["left_hip", "left_knee", "right_hip", "right_knee"]
    data = {
        "outputs": rows,
        "alpha": polished.alpha[[0, 2, 1, 3]].tolist(),
        "clock": {"left_hip": -2.0, "left_knee": -1.0, "torso": -2.0},
        "clock_offset": 0.5,
        "clock_range": [2.0 * polished.theta_plus + 0.5, 2.0 * polished.theta_minus + 0.5],
    }
    file = tmp_path / "theirs.json"
    file.write_text(json.dumps(data))
    _, found, err = judged(capsys, file, tmp_path / "again.toml")
    assert found["fit_rad"] < 1e-9, err
    assert found["step_time_s"] == pytest.approx(orbit.step_time, rel=1e-6)


def bezier(**changes):
    rows = {"outputs": '["a", "b", "c", "d"]', "clock": "{a = 1, e = 1}", "clock_range": "[0, 1]"}
    return "".join(f"{key} = {value}\n" for key, value in (rows | {"alpha": 4 * [4 * [0]]} | changes).items())


BAD = {
    "too short": ("a.csv", "t,torso\n0,1\n", ["1 samples", "12 or more"]),
    "a word": ("a.csv", "t,torso\n" + "0,x\n" * 20, ["line 2", "'x'"]),
    "blank lines": ("a.csv", "t,torso\n\n \n" + "0,1\n" * 12 + ",\n\n0,1,2\n", ["line 18: 3 cells", "2 numbers"]),
    "two of a name": ("a.csv", "t,torso, t\n" + "0,1,2\n" * 20, ["2 columns 't'", "one of each"]),
    "a cell too large": ("a.csv", "t,torso\n" + "0,1\n" * 20 + "0," + "1" * 2**18, ["line 22", "field larger"]),
    "a column": ("a.csv", "t,torso\n" + "0,1\n" * 20, ["no column left_hip", "t, torso"]),
    "backwards": (
        "a.csv",
        "left_hip,left_knee,right_hip,right_knee,torso\n" + "".join(f"{3 + 0.01 * k},0,3,0,0\n" for k in range(20)),
        ["does not sweep forward"],
    ),
    "no outputs": ("a.toml", "alpha = [1]\n", ["outputs", "four"]),
    "not TOML": ("a.toml", "alpha", ["TOML"]),
    "a list": ("a.json", "[1]", ["list"]),
    "beyond a float": ("a.toml", bezier(alpha=f"[[{'9' * 400}]]"), ["alpha", "numbers"]),
    "a clock beyond a float": ("a.toml", bezier(clock=f"{{a = 1, e = {'9' * 400}}}"), ["clock", "up to 1e+06"]),
    "an offset beyond a float": ("a.toml", bezier(clock_offset="9" * 400), [f"clock_offset = {'9' * 40};", "number"]),
    "no clock": ("a.toml", 'outputs = ["a","b","c","d"]\nclock = {a = 1}\n', ["clock", "one more"]),
}


@pytest.mark.parametrize("name, text, words", BAD.values(), ids=BAD.keys())
def test_what_is_no_step_is_one_line(capsys, tmp_path, name, text, words):
    file = tmp_path / name
    file.write_text(text)
    code, _, err = run(capsys, "gait", "import", file, "--out", tmp_path / "out.toml")
    assert code == 2 and err.count("\n") == 1 and all(word in err for word in words), err
    assert not (tmp_path / "out.toml").exists()


def test_nothing_is_written_over(capsys, tmp_path):
    code, _, err = run(capsys, "gait", "import", "x.csv", "--out", RABBIT / "gaits" / "paper.toml")
    assert code == 2 and "x.csv" in err
