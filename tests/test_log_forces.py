"""What the controller expected and what the plant gave; forces as arrows; the ground at its slope."""

from dataclasses import replace
from math import cos, sin

import numpy as np
import pytest

from sim.bridge.run import run_scenario
from sim.log.read import read_log
from sim.log.write import Recorder
from sim.log.write.arrows import CONTACT_SCALE, PUSH_SCALE
from sim.scenario import load, with_values
from tests.fakes import tell
from tests.test_recorder import HEADER, PERIOD, tick

SLOPE = 0.05  # [rad]
GROUND = ((-2.0, -0.1), (1.0, 0.05), (1.0, 0.02), (5.0, 0.02))  # [m], a ramp, then a step down to a level floor


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("forces") / "run.mcap"
    changes = {"steps": 1, "controller.horizon": 60, "plant.ground.slope": SLOPE}
    run_scenario(with_values(load("push-40N-first"), changes), log=path)
    return read_log(path)


def arrows(scene):
    return {entity.id: entity for entity in scene.entities}


def test_arrows_are_forces_at_the_right_place(log):
    state = {int(row["_tick"]): row for row in log.channel("/plant/state")}
    frames = log.messages("/forces")
    assert len(frames) > 10
    for time_ns, scene in frames[2:]:
        row = state[time_ns // 1_000_000]
        for leg in ("left", "right"):
            tangential, normal = row[f"contact_force.{leg}.tangential"], row[f"contact_force.{leg}.normal"]
            if np.hypot(tangential, normal) < 1.0:
                assert f"contact.{leg}" not in arrows(scene)
                continue
            arrow = arrows(scene)[f"contact.{leg}"].arrows[0]
            length = arrow.shaft_length + arrow.head_length
            assert length == pytest.approx(CONTACT_SCALE * np.hypot(tangential, normal))
            assert arrow.pose.position.x == pytest.approx(row[f"foot.{leg}.x"])
            turn = arrow.pose.orientation
            along = np.array((1 - 2 * turn.y**2, -2 * turn.w * turn.y))  # the frame's x axis, (x, z)
            world = np.array(
                (
                    tangential * cos(SLOPE) - normal * sin(SLOPE),
                    tangential * sin(SLOPE) + normal * cos(SLOPE),
                )
            )
            assert length * along == pytest.approx(CONTACT_SCALE * world, abs=1e-9)


def test_the_push_points_at_the_torso(log):
    row = {int(row["_tick"]): row for row in log.channel("/plant/state")}
    time_ns, scene = log.messages("/forces")[5]
    entity = arrows(scene)["push.0"]
    assert {m.key: float(m.value) for m in entity.metadata} == {"x [N]": 40.0, "z [N]": 0.0}
    arrow, tick_row = entity.arrows[0], row[time_ns // 1_000_000]
    tip = arrow.pose.position.x + arrow.shaft_length + arrow.head_length
    com = 0.24  # [m] above the hip along the torso
    assert arrow.shaft_length + arrow.head_length == pytest.approx(40.0 * PUSH_SCALE)
    assert tip == pytest.approx(tick_row["hip.x"] - com * sin(tick_row["q.torso"]))


def test_force_error_is_the_plant_s_answer_one_tick_later(log):
    state, control, error = (log.channel(t) for t in ("/plant/state", "/control", "/prediction/error"))
    legs = np.array(("left", "right"))[control["stance"]]
    for k in range(1, len(control), 37):
        for axis in ("tangential", "normal"):
            real = state[f"contact_force.{legs[k - 1]}.{axis}"][k]
            assert error[f"contact_force.{axis}"][k] == real - control[f"contact_force.{axis}"][k - 1]


def test_horizon_begins_with_what_the_tick_decided(log):
    control = log.channel("/control")
    frames = log.messages("/prediction")
    assert 50 <= len(frames) / (len(control) * PERIOD) <= 62
    for time_ns, message in frames:
        row = control[time_ns // 1_000_000]
        assert message.y.stance_knee[0] == row["y.stance_knee"]
        assert message.contact_force.normal[0] == pytest.approx(row["contact_force.normal"])
        assert message.impact_in == row["impact_in"]
        assert len(message.y.swing_hip) == 60 // 5 + 1
        assert message.period == pytest.approx(5 * PERIOD)


def test_impact_says_when_it_had_been_foreseen(log):
    control = log.channel("/control")
    ((time_ns, message),) = log.messages("/prediction/impact")
    k = time_ns // 1_000_000
    seen = np.flatnonzero(control["impact_in"][:k] > 0)
    assert message.foreseen == k - seen[0] > 0
    assert message.first_error == seen[0] + control["impact_in"][seen[0]] - k
    assert message.last_error == seen[-1] + control["impact_in"][seen[-1]] - k


def test_ground_lies_along_its_line(tmp_path):
    with Recorder(tmp_path / "run.mcap", replace(HEADER, ground=GROUND), PERIOD) as recorder:
        tell(recorder, 0, *tick(0), 0.0)
    ((_, scene),) = read_log(tmp_path / "run.mcap").messages("/scene")
    plates = arrows(scene)["ground"].cubes
    assert len(plates) == 2
    for plate, (start, end) in zip(plates, (GROUND[:2], GROUND[2:]), strict=True):
        turn = plate.pose.orientation
        along = np.array((1 - 2 * turn.y**2, -2 * turn.w * turn.y))
        up = np.array((-along[1], along[0]))
        top = np.array((plate.pose.position.x, plate.pose.position.z)) + plate.size.z / 2 * up
        assert top - plate.size.x / 2 * along == pytest.approx(start, abs=1e-12)
        assert top + plate.size.x / 2 * along == pytest.approx(end, abs=1e-12)
