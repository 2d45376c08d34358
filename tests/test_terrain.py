"""The ground is where its settings put it, for the walker as for the judges."""

import math
from pathlib import Path

import numpy as np
import pytest
from fakes import Tape
from hypothesis import given
from hypothesis import strategies as st

from sim.bridge.run import run_scenario
from sim.errors import UserError
from sim.plant import MujocoPlant
from sim.plant.terrain import Terrain
from sim.scenario import GroundSettings, PlantSettings, load, with_values
from sim.scenario.plant import Ledge, Patch, Ramp, RoughSettings

MJCF = Path(__file__).parent.parent / "models/rabbit/rabbit.xml"
Q = np.array([3.54, 2.92, -0.36, -0.15, 0.015])  # [rad], the gait's posture after impact


def terrain(seed: int = 0, length: float = 5.0, **values: object) -> Terrain:
    return Terrain(GroundSettings(**values), seed=seed, length=length)


def plant(**values: object) -> MujocoPlant:
    return MujocoPlant(PlantSettings(ground=GroundSettings(**values)), MJCF, 1e-3)


@given(st.floats(-0.4, 0.4), st.floats(-5, 50))
def test_a_plane_is_one_facet_through_the_origin(slope: float, x: float) -> None:
    ground = terrain(slope=slope)
    assert len(ground.facets) == 1
    assert ground.height(x) == pytest.approx(math.tan(slope) * x)


@given(
    ramps=st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(0.5, 3), st.floats(0.1, 2)), max_size=3),
    ledges=st.lists(st.tuples(st.floats(-0.1, 0.1), st.floats(0.5, 3)), max_size=3),
    slope=st.floats(-0.2, 0.2),
    x=st.floats(-5, 10),
)
def test_height_is_the_sum_of_all_features(ramps, ledges, slope, x) -> None:
    ground = terrain(
        slope=slope,
        ramps=tuple(Ramp(slope=a, start=b, length=c) for a, b, c in ramps),
        ledges=tuple(Ledge(height=h, position=p) for h, p in ledges),
    )
    expected = math.tan(slope) * x
    expected += sum(math.tan(a) * min(max(x - b, 0.0), c) for a, b, c in ramps)
    expected += sum(h for h, p in ledges if x >= p)
    assert ground.height(x) == pytest.approx(expected, abs=1e-9)


def test_a_stair_has_as_many_ledges_as_it_says() -> None:
    ground = terrain(ledges=(Ledge(height=0.05, position=1.0, count=3, spacing=0.5),))
    assert [round(ground.height(x), 9) for x in (0.9, 1.1, 1.6, 2.1, 9.0)] == [0, 0.05, 0.1, 0.15, 0.15]


def test_the_later_patch_counts() -> None:
    ground = terrain(patches=(Patch(friction=0.1, start=1, length=2), Patch(friction=0.9, start=2, length=0.5)))
    assert [ground.under(x).friction for x in (0, 1.5, 2.2, 2.7, 4)] == [0.6, 0.1, 0.9, 0.1, 0.6]


def test_rough_ground_is_seeded_bounded_and_prolonged_by_length() -> None:
    rough = RoughSettings(height=0.02, spacing=0.1)
    ground, again, other = (terrain(seed=s, rough=rough) for s in (1, 1, 2))
    longer = terrain(seed=1, length=9.0, rough=rough)
    x = np.linspace(-1, 4.5, 500)
    heights = [np.array([g.height(float(at)) for at in x]) for g in (ground, again, other, longer)]
    assert np.array_equal(heights[0], heights[1]) and not np.allclose(heights[0], heights[2])
    assert heights[0] == pytest.approx(heights[3], abs=1e-12)
    assert 0.01 < np.abs(heights[0]).max() <= 0.02 + 1e-12
    assert np.all(heights[0][x < 0.2] == 0)
    steps = np.abs(np.diff(heights[0]))
    assert steps.max() < 0.4 * (x[1] - x[0]) + 1e-9  # no cliffs: at most 4 cm over a facet of 10 cm


def test_ground_before_the_beginning_and_too_fine_ground_are_refused() -> None:
    with pytest.raises(UserError, match="beyond -10"):
        terrain(ramps=(Ramp(slope=0.1, start=-20.0),))
    with pytest.raises(UserError, match=r"plant\.ground\.rough\.spacing = 1e-05 m: must be above"):
        terrain(rough=RoughSettings(height=0.01, spacing=1e-5))


def test_a_foot_rests_on_the_facet_it_stands_on() -> None:
    """Drop the walker on a ledge behind the origin: the sensed contact and the clearance are the ledge's."""
    walker = plant(ledges=(Ledge(height=0.05, position=-1.0),))
    walker.reset(Q, np.zeros(5), "left")
    state = walker.state()
    assert state.foot[0, 1] == pytest.approx(0.05 + 0.002, abs=1e-5)
    assert state.clearance[0] == pytest.approx(0, abs=2e-6) and state.contact[0]


def test_a_foot_against_a_riser_has_not_landed() -> None:
    """It touches the ledge's face in mid-step, which is ground, but nothing to stand on."""
    ledge = {"plant.ground.ledges.0.height": 0.06, "plant.ground.ledges.0.position": 1.0, "controller.kind": "zd-pd"}
    tape = Tape()
    run_scenario(with_values(load("undisturbed"), ledge | {"steps": 3}), tape=tape)
    states = [state for _, state, *_ in tape.told]
    pressed = np.abs([state.contact_force for state in states]).max(axis=2) > 100.0
    aloft = np.array([state.clearance for state in states]) > 0.01
    contact = np.array([state.contact for state in states])
    assert (pressed & aloft).any() and not contact[aloft].any()
    assert contact[pressed & ~aloft].all()


@pytest.mark.parametrize("width", [0.0031, 0.0035])
def test_a_foot_that_rests_on_both_edges_of_a_slot_stands(width) -> None:
    """A slot nearly as wide as the foot under where it stands: it touches nothing below, and no riser."""
    slot = Ledge(height=-0.02, position=-width / 2), Ledge(height=0.02, position=width / 2)
    walker = plant(ledges=slot)
    walker.reset(Q, np.zeros(5), "left")
    stood = []
    for _ in range(60):
        walker.hold(np.array([20.0, -5.0, 10.0, 0.0]))
        state = walker.state()
        if state.contact_force[0, 1] > 50.0:
            stood.append(state.contact[0])
    assert len(stood) > 10 and all(stood)


def test_boxes_push_as_the_plane_does() -> None:
    """A ledge of no height far away turns the plane into boxes; the walker must not notice."""
    ends = []
    for ledges in ((), (Ledge(height=0.0, position=5.0),)):
        walker = plant(slope=0.05, ledges=ledges)
        walker.reset(Q, np.zeros(5), "left")
        for _ in range(100):
            walker.hold(np.array([20.0, -5.0, 10.0, 0.0]))
        ends.append(walker.state())
    for name in ("q", "dq", "foot", "clearance", "contact_force"):
        assert getattr(ends[1], name) == pytest.approx(getattr(ends[0], name), abs=1e-5), name


def test_a_slippery_patch_limits_the_tangential_force() -> None:
    walker = plant(friction=1.0, patches=(Patch(friction=0.05, start=-1.0, length=2.0),))
    walker.reset(Q, np.zeros(5), "left")
    ratios = []
    for _ in range(80):
        walker.hold(np.array([60.0, 0.0, 30.0, 0.0]))
        tangential, normal = walker.state().contact_force[0]
        if normal > 1.0:
            ratios.append(abs(tangential) / normal)
    assert max(ratios) == pytest.approx(0.05, rel=0.02)


def test_links_on_boxes_are_sensed() -> None:
    """A wall behind the walker, up to its right knee."""
    walker = plant(ledges=(Ledge(height=0.6, position=-5.0), Ledge(height=-0.6, position=-0.25)))
    walker.reset(Q, np.zeros(5), "left")
    assert walker.state().penetrating == ("right_femur",)
