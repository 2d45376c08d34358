"""Robots as published: what is made of others' files is the same robot, and what can not be made says why, at once."""

import json

import numpy as np
import pytest
import robots

from controller.belief import WalkerModel
from sim.bridge.convert import EXACT, proof_of
from sim.cli import main
from sim.errors import UserError
from sim.walkers import urdf
from sim.walkers.planar import Given
from sim.walkers.reduction import reduce

GIVEN = ["--torque", 75, 50]


def run(capsys, *argv):
    code = main([str(word) for word in argv])
    out, err = capsys.readouterr()
    return code, out, err


AS_PUBLISHED = {
    "a gait optimiser's": (robots.urdf(**robots.OPTIMISER), GIVEN),
    "links down": (robots.urdf(up=-1.0), []),
    "the other axes, links down": (robots.urdf(up=-1.0, axis="0 1 0"), []),
    "mirrored leg": (robots.urdf(right_axis="0 1 0"), []),
    "knee rotated by 0.2": (robots.urdf(knee_rpy="0 0.2 0"), []),
    "hip rotated by half a turn": (robots.urdf(hip_rpy="0 3.141592653589793 0"), []),
    "hip turned about z": (robots.urdf(hip_rpy="0 0 3.141592653589793"), []),
    "slides and a hinge": (robots.urdf(base=robots.SLIDES, up=-1.0, axis="0 1 0"), []),
    "planar joint": (robots.urdf(base=robots.WORLD.format("planar", '<axis xyz="0 1 0"/>')), []),
    "floating": (robots.urdf(base=robots.WORLD.format("floating", "")), []),
    "fixed to the world, leaning": (robots.urdf(base=robots.WORLD.format("fixed", '<origin rpy="0 0.1 0"/>')), []),
    "walk along y": (robots.urdf(axis="1 0 0", base=robots.WORLD.format("fixed", "")), []),
    "yawed by a thousandth": (robots.urdf(axis="0.001 -1 0"), []),
    "centres of mass off their axes": (robots.urdf(com_x=0.01, up=-1.0), []),
    "legs beside each other": (robots.urdf(legs_y=0.1), []),
    "stops and friction": (
        robots.urdf(
            limit='<limit effort="{effort}" velocity="1" lower="-0.5" upper="0.4"/>',
            dynamics='<dynamics damping="{damping}" friction="2"/>',
            knee_rpy="0 0.5 0",
        ),
        [],
    ),
    "no foot": (robots.urdf(feet=False), ["--tibia-length", 0.4]),
    "other names": (robots.urdf(names=("a", "b", "c", "d")), ["--map", "left_hip=c"]),
    "a namespace": (robots.urdf(up=-1.0).replace("<robot ", '<robot xmlns="http://toolbox" '), []),
}


def made(capsys, tmp_path, text, given, kind="urdf", ending="urdf"):
    file = tmp_path / f"published.{ending}"
    file.write_text(text)
    code, out, err = run(capsys, "walker", "new", tmp_path / "mine", f"--{kind}", file, *given)
    return code, out, err, tmp_path / "mine"


@pytest.mark.parametrize("text, given", AS_PUBLISHED.values(), ids=AS_PUBLISHED.keys())
def test_the_made_walker_is_the_file_s(capsys, tmp_path, text, given):
    """Mass matrix, bias and feet at 1,000 states, by Pinocchio on the file."""
    code, out, err, folder = made(capsys, tmp_path, text, given)
    assert code == 0 and not err, err
    found = proof_of(folder, WalkerModel(folder / "mine.urdf"))
    assert found is not None
    worst, legal = found
    assert max(worst.values()) <= legal <= 2 * EXACT, worst
    assert "within" in out and (folder / "published.urdf").read_text() == text
    assert "| part | found | made of it |" in (folder / "README.md").read_text()


@pytest.mark.parametrize(
    "kind, ending, text", [("mjcf", "xml", robots.mjcf()), ("xacro", "xacro", robots.XACRO)], ids=["mjcf", "xacro"]
)
def test_other_formats(capsys, tmp_path, kind, ending, text):
    code, out, err, folder = made(capsys, tmp_path, text, [], kind, ending)
    assert code == 0 and not err, err
    worst, legal = proof_of(folder, WalkerModel(folder / "mine.urdf"))
    assert max(worst.values()) <= legal == EXACT, worst
    code, out, _ = run(capsys, "walker", "check", folder, "--json")
    stages = json.loads(out)["stages"]
    assert [stage["name"] for stage in stages if not stage["holds"]] == ["gaits"], stages
    assert sum(stage["name"].startswith("as published") for stage in stages) == 3


def test_an_mjcf_is_taken_over_whole(capsys, tmp_path):
    _, _, _, folder = made(capsys, tmp_path, robots.mjcf(), [], "mjcf", "xml")
    model = WalkerModel(folder / "mine.urdf")
    assert model.torque_limits.tolist() == [90.0, 90.0, 60.0, 60.0]
    assert model.joints.rotor == pytest.approx(0.01) and model.joints.friction == pytest.approx(0.5)
    assert model.joints.damping == pytest.approx(0.1)
    assert model.joints.stiffness.tolist() == [0.0, 0.0, 3.0, 3.0]
    # A knee that bends by +q about +y is -q here, and its axes of femur and tibia are not those of the frames.
    lean = np.arctan2(0.01, 0.43)  # of the femur, knee to hip
    assert model.high[2] == pytest.approx(-lean, abs=1e-9)
    assert model.low[2] == pytest.approx(-lean - np.radians(140), abs=1e-9)
    assert model.joints.rest[2] == pytest.approx(-lean - np.radians(20), abs=1e-9)
    assert model.femur.length == pytest.approx(np.hypot(0.01, 0.43)) and model.tibia.length == pytest.approx(0.45)
    assert model.torso.com_across > 0.0


def test_files_that_an_mjcf_includes_are_found_where_mujoco_finds_them(capsys, tmp_path):
    """Beside the main file first, then beside the including one; XML in another order is the same robot."""
    text, (folder, deeper) = robots.mjcf(), (tmp_path / "parts", tmp_path / "parts" / "parts")
    deeper.mkdir(parents=True)
    legs = text[text.index('<body name="thigh"') : text.index("    </body>\n  </worldbody>")]
    (folder / "legs.xml").write_text(f"<mujoco>{legs}</mujoco>")
    (deeper / "legs.xml").write_text("<mujoco/>")
    (folder / "both.xml").write_text('<mujoco><include file="parts/legs.xml"/><include file="site.xml"/></mujoco>')
    (folder / "site.xml").write_text('<mujoco><site name="beside"/></mujoco>')
    code, _, err, made_of = made(
        capsys, tmp_path, text.replace(legs, '<include file="parts/both.xml"/>'), [], "mjcf", "xml"
    )
    assert code == 0, err
    kept = (made_of / "published.xml").read_text()
    assert "include" not in kept and kept.count("thigh") == text.count("thigh") and "beside" in kept
    worst, legal = proof_of(made_of, WalkerModel(made_of / "mine.urdf"))
    assert max(worst.values()) <= legal


@pytest.mark.parametrize("error, code", [(UserError("no proof"), 2), (KeyboardInterrupt(), 130)])
def test_a_folder_whose_walker_is_not_proved_goes_again(capsys, tmp_path, monkeypatch, error, code):
    def fails(*_):
        assert (tmp_path / "mine" / "mine.urdf").is_file()
        raise error

    with monkeypatch.context() as patch:
        patch.setattr("sim.bridge.convert.proof", fails)
        assert made(capsys, tmp_path, robots.urdf(up=-1.0), [])[0] == code
    assert not (tmp_path / "mine").exists()
    assert made(capsys, tmp_path, robots.urdf(up=-1.0), [])[0] == 0


@pytest.mark.parametrize("where", ["<!-- {} -->", '<site name="{}"/>'])
@pytest.mark.parametrize("included", [True, False])
def test_an_mjcf_that_is_not_in_utf_8_is_one_line(capsys, tmp_path, where, included):
    text, odd = robots.mjcf(), where.format("é")
    text = text.replace("<worldbody>", "<worldbody>" + ('<include file="odd.xml"/>' if included else odd))
    (tmp_path / "odd.xml").write_bytes(f"<mujoco>{odd}<site name='x'/></mujoco>".encode("latin-1"))
    file = tmp_path / "published.xml"
    file.write_bytes(text.encode("latin-1"))
    code, _, err = run(capsys, "walker", "new", tmp_path / "mine", "--mjcf", file)
    assert code == 2 and "must be an MJCF in UTF-8" in err and err.count("\n") == 1, err
    assert ("odd.xml" if included else "published.xml") in err and not (tmp_path / "mine").exists()


def test_a_file_in_our_conventions_is_copied(capsys, tmp_path, model):
    text = model.path.read_text()
    code, _, _, folder = made(capsys, tmp_path, text, [])
    assert code == 0 and (folder / "mine.urdf").read_text() == text
    assert not list(folder.glob("published.*"))


def test_backward_knees_turn_the_walk(capsys, tmp_path):
    limit = '<limit effort="{effort}" velocity="1" lower="{low}" upper="{high}"/>'
    text = robots.urdf(limit=limit.replace("{low}", "0").replace("{high}", "2"))
    code, out, _, folder = made(capsys, tmp_path, text, [])
    assert code == 0 and "-1 0 0" in out
    assert WalkerModel(folder / "mine.urdf").low[2] == -2.0


OUTSIDE = {
    "mimic": (robots.urdf(more='<mimic joint="left_hip"/>'), ["left_hip", "mimics", "must be"]),
    "out of the plane": (robots.urdf(hip_rpy="1.5708 0 0"), ["left_hip", "leaves the plane"]),
    "skew axis": (robots.urdf(right_axis="0.01 -1 0"), ["right_hip", "0.01 rad", "leaves the plane"]),
    "unequal legs": (robots.urdf(right_mass=4.0), ["tibias", "3.2 and 4 kg", "equal legs"]),
    "almost equal legs": (robots.urdf(right_mass=3.21), ["tibias", "--even-legs"]),
    "mass off the plane": (
        robots.urdf(torso_y=0.2, base=robots.WORLD.format("floating", "")),
        ["beside the plane", "planar base"],
    ),
    "no limits, no foot": (robots.urdf(**robots.OPTIMISER, feet=False), ["--torque HIP KNEE", "--tibia-length M"]),
    "three joints a leg": (
        robots.urdf().replace('_tip" type="fixed"', '_ankle" type="continuous"'),
        ["topology", "left_ankle", "five links"],
    ),
    "one leg": (
        '<robot name="x"><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/>'
        '<child link="b"/></joint></robot>',
        ["topology", "1 moving joints"],
    ),
}


@pytest.mark.parametrize("text, words", OUTSIDE.values(), ids=OUTSIDE.keys())
def test_what_stays_outside_says_why(capsys, tmp_path, text, words):
    code, out, err, folder = made(capsys, tmp_path, text, [])
    assert code == 2 and all(word in err for word in words), err
    assert err.count("\n") == 1 and not folder.exists()
    assert "OUTSIDE" in out or "MUST BE GIVEN" in out


def test_all_complaints_come_at_once(capsys, tmp_path):
    text = robots.urdf(right_mass=4.0, limit="", right_axis="0.01 -1 0", base=robots.SLIDES)
    _, _, err, _ = made(capsys, tmp_path, text, [])
    for word in ("right_hip", "right_knee", "tibias: mass", "torque limit, hips", "torque limit, knees"):
        assert word in err


def test_even_legs_are_the_mean(capsys, tmp_path):
    code, _, _, folder = made(capsys, tmp_path, robots.urdf(right_mass=3.22), ["--even-legs"])
    assert code == 0 and WalkerModel(folder / "mine.urdf").tibia.mass == pytest.approx(3.21)


def test_what_moves_beyond_a_foot_is_named():
    tree = urdf.read(robots.urdf().replace('_tip" type="fixed"', '_ankle" type="continuous"'), "x")
    _, rows = reduce(tree, Given())
    assert any("hinge left_ankle" in row.found for row in rows if row.stops)


BROKEN = {
    "no XML": ("<robot", ["XML"]),
    "another root": ("<mujoco/>", ["<mujoco>", "<robot>"]),
    "no link": ('<robot name="x"/>', ["no <link>"]),
    "a number that is none": (robots.urdf(com_x="-1.57."), ["'-1.57.'", "finite"]),
    "unknown parent": (robots.urdf().replace('parent link="torso"', 'parent link="tors"'), ["'tors'"]),
    "two roots": (robots.urdf(base='<link name="other"/>'), ["2 links without a parent"]),
    "joint of another type": (robots.urdf(kind="helical"), ["helical", "must be"]),
}


@pytest.mark.parametrize("text, words", BROKEN.values(), ids=BROKEN.keys())
def test_a_file_that_is_no_robot(capfd, tmp_path, text, words):
    """One line of ours, and nothing of any parser's."""
    file = tmp_path / "bad.urdf"
    file.write_text(text)
    code, _, err = run(capfd, "walker", "new", tmp_path / "mine", "--urdf", file)
    assert code == 2 and err.count("\n") == 1 and all(word in err for word in words), err


@pytest.mark.parametrize(
    "old, new, name, words",
    [
        ('damping="10"', 'damping="10" frictionloss="3"', "dry friction (frictionloss)", "0 and 3"),
        ('damping="5"', 'damping="5" range="-0.4 0.1"', "lower stops (range)", "-inf and -0.4"),
        ('damping="5"', 'damping="5" armature="0.2"', "rotor inertia (armature)", "0 and 0.2"),
        ('damping="5"', 'damping="5" stiffness="9"', "springs (stiffness)", "0 and 9"),
        ('<motor name="left_hip"', '<motor gear="2" name="left_hip"', "gears", "1 and 2/1"),
        ('timestep="0.00025"', 'timestep="0.001"', "timestep", "0.001 s"),
        ('mass="12"', 'mass="12.5"', "first cause", "torso: mass 12 kg in the URDF, 12.5 kg in the MJCF"),
        ('<joint name="hip_x"', '<joint damping="3" name="hip_x"', "base is free", "damping of hip_x 3"),
    ],
)
def test_check_sees_everything_that_moves(capsys, tmp_path, model, old, new, name, words):
    _, _, _, folder = made(capsys, tmp_path, model.path.read_text(), [])
    mjcf = folder / "mine.xml"
    assert old in mjcf.read_text()
    mjcf.write_text(mjcf.read_text().replace(old, new))
    code, out, err = run(capsys, "walker", "check", folder)
    failed = [line for line in out.splitlines() if line.startswith("FAIL")]
    assert code == 1 and any(name in line and words in line for line in failed), out
    assert err.startswith("the walker fails its check; ") and name in err and words in err


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('<geom name="torso" class="link"', '<geom name="torso"', "fromto"),
        ('name="hip_x" type="slide"', 'name="-1" type="slide"', 'no joint named "hip_x"'),
        ('<inertial pos="0.0 0 0.24" mass="3.2" diaginertia="0.2 0.2 0.008"/>', "", "left_tibia has no mass"),
        ('<motor name="left_hip" class="hip" joint="left_hip"/>', "", 'no actuator named "left_hip"'),
        ('joint="left_knee"', 'joint="left_hip"', "does not drive"),
        ('name="hip_z" type="slide"', 'name="hip_z" type="hinge"', "must be a slide"),
        ('<contact name="left_foot"', '<contact name="foot"', "left_foot"),
    ],
)
def test_a_plant_that_is_none_is_one_line(capsys, tmp_path, model, old, new, words):
    _, _, _, folder = made(capsys, tmp_path, model.path.read_text(), [])
    mjcf = folder / "mine.xml"
    text = mjcf.read_text().replace('pos="0 0 0.24" mass="3.2" diaginertia', 'pos="0.0 0 0.24" mass="3.2" diaginertia')
    assert old in text, text
    mjcf.write_text(text.replace(old, new))
    (folder / "gaits" / "paper.toml").write_text((model.path.parent / "gaits" / "paper.toml").read_text())
    flags = ["--controller", "zd-pd", "--gait", "paper", "--time-limit", 0.01, "--no-log"]
    code, _, err = run(capsys, "run", "undisturbed", "--walker", folder, *flags)
    assert code == 2 and err.count("\n") == 1 and words in err, err
