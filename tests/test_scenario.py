"""Scenarios: TOML reads back equal, and whatever is illegal is refused by name, value and unit."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.errors import UserError
from sim.scenario import (
    ControllerSettings,
    GroundSettings,
    PlantSettings,
    Push,
    Scenario,
    StartSettings,
    from_toml,
    load,
    settings_table,
    shipped,
    to_toml,
    with_value,
    with_values,
)
from sim.scenario.per_link import BodyFactors, JointFactors
from sim.settings import tree as settings
from sim.settings.spec import LARGEST, specs

finite = st.floats(-LARGEST, LARGEST)
not_negative = st.floats(0.0, LARGEST)
positive = st.floats(0.0, LARGEST, exclude_min=True)
text = st.text(st.characters(exclude_categories=["Cs"]))
bodies = st.sampled_from(["torso", "left_femur", "left_tibia", "right_femur", "right_tibia"])


def some(cls, values, **more):
    return st.builds(cls, **{name: values for name in specs(cls)} | more)


where = {"force": finite, "direction": finite, "body": bodies, "point": st.none() | st.tuples(finite, finite)}
push_in_step = st.builds(Push, **where, step=st.integers(1, 1_000_000))
push_in_window = st.tuples(not_negative, positive).flatmap(
    lambda ends: st.builds(Push, **where, start=st.just(min(ends)), end=st.just(max(ends)))
)
timing = st.tuples(st.floats(1e-6, 1.0), st.integers(1, 1000))


@st.composite
def scenarios(draw):
    period, substeps = draw(timing)
    return Scenario(
        name=draw(text),
        description=draw(text),
        steps=draw(st.integers(1, 1_000_000)),
        time_limit=draw(not_negative),
        seed=draw(st.integers(0, 2**63 - 1)),
        walker=draw(text),
        gait=draw(text),
        controller=ControllerSettings(
            kind=draw(st.sampled_from(["c-mpc", "zd-pd"])),
            kp=draw(st.tuples(*[not_negative] * 4)),
            horizon=draw(st.integers(1, 10_000)),
            period=period,
            friction_rows=draw(st.booleans()),
            solver=draw(text),
        ),
        plant=PlantSettings(
            timestep=period / substeps,
            integrator=draw(st.sampled_from(["implicitfast", "RK4", "implicit", "Euler"])),
            ground=GroundSettings(friction=draw(st.floats(0.0, 100.0)), slope=draw(st.floats(-1.5, 1.5))),
            mass_factor=draw(some(BodyFactors, positive)),
            damping_factor=draw(some(JointFactors, not_negative)),
        ),
        pushes=tuple(draw(st.lists(push_in_step | push_in_window.filter(lambda p: p.end > p.start), max_size=3))),
        start=StartSettings(torso_offset=draw(finite), dq_offset=draw(st.tuples(*[finite] * 5))),
    )


@given(scenarios())
def test_toml_reads_back_equal(scenario):
    assert from_toml(to_toml(scenario)) == scenario


def test_defaults_are_legal_and_an_empty_file_means_them():
    assert from_toml("") == Scenario()


@pytest.mark.parametrize("name", shipped())
def test_shipped_scenarios_carry_their_own_name_and_a_description(name):
    scenario = load(name)
    assert scenario.name == name
    assert scenario.description


def test_shipped_scenarios_are_what_the_paper_did():
    assert set(shipped()) == {"undisturbed", "push-25N", "push-40N-first", "friction-50N", "payload-x2"}
    assert load("push-25N").pushes == (Push(force=25.0, step=2),)
    assert load("push-40N-first").pushes == (Push(force=40.0, step=1),)
    assert load("payload-x2").plant.mass_factor.torso == 2.0
    friction = load("friction-50N")
    assert (friction.controller.friction, friction.plant.ground.friction) == (0.6, 2.0)


def test_file_without_a_name_is_named_after_the_file(tmp_path):
    path = tmp_path / "hill.toml"
    path.write_text("[plant.ground]\nslope = 0.1\n")
    assert load(str(path)).name == "hill"


@given(st.data())
def test_with_value_changes_that_leaf_and_no_other(data):
    before = settings_table()
    row = data.draw(st.sampled_from([row for row in before if row.spec.type is float and not row.spec.length]))
    value = row.value * 2 if row.value else 0.125
    if row.path == "controller.period":  # which the physics step has to divide
        value = 0.002
    if row.path == "plant.timestep":
        value = 0.000125
    after = settings_table(with_value(Scenario(), row.path, value))
    assert [new.path for new, old in zip(after, before, strict=True) if new.value != old.value] == [row.path]


def test_an_int_serves_where_a_float_is_expected():
    value = with_value(Scenario(), "plant.mass_factor.torso", 2).plant.mass_factor.torso
    assert (value, type(value)) == (2.0, float)


def test_values_that_must_agree_change_together():
    changes = {"controller.period": 2e-3, "plant.timestep": 0.4e-3}
    assert with_values(Scenario(), changes).substeps == 5


def test_the_index_after_the_last_adds_a_push():
    scenario = with_values(load("push-25N"), {"pushes.1.force": -10, "pushes.1.step": 4, "pushes.0.force": 30})
    assert scenario.pushes == (Push(force=30.0, step=2), Push(force=-10.0, step=4))


def test_elements_of_tuples_have_paths():
    assert with_value(Scenario(), "controller.kp.1", 91).controller.kp == (60.0, 91.0, 90.0, 50.0)


def test_time_limit_is_derived_from_the_steps():
    assert Scenario(steps=100).end_time == 200.0
    assert Scenario(steps=100, time_limit=5.0).end_time == 5.0


def leaves(cls):
    for spec in specs(cls).values():
        yield from leaves(spec.type) if spec.is_table else [spec]


def test_every_number_has_a_unit_and_every_setting_help():
    for spec in leaves(Scenario):
        assert spec.help
        assert spec.unit or spec.type is not float


def test_what_may_be_missing_is_missing_by_default():
    """None is written by leaving the key out, so it has to be the default to read back."""
    for spec in leaves(Scenario):
        assert not spec.optional or spec.default is None


BAD = {
    'colour = "red"': ["colour: unknown key", "name, description"],
    "[plant]\nslop = 1": ["plant.slop: unknown key"],
    "[plant]\ntimstep = 1e-3": ["plant.timstep: unknown key", "plant.timestep"],
    "[plant.mass_factor]\ntorsso = 2": ["plant.mass_factor.torsso", "did you mean plant.mass_factor.torso"],
    "[[pushes]]\nforce = 1\nstep = 1\nbodie = 1": ["pushes.0.bodie", "pushes.0.body"],
    "plant = 3": ["plant = 3", "table"],
    "pushes = 3": ["pushes = 3", "array of tables"],
    "pushes = [1]": ["pushes.0 = 1", "table"],
    'steps = "ten"': ["steps = 'ten'", "integer", "[steps]"],
    "steps = 1.5": ["steps = 1.5", "integer"],
    "steps = true": ["steps = True", "integer"],
    "steps = 0": ["steps = 0", "from 1 to 1000000"],
    "seed = -1": ["seed = -1", "0 or above"],
    "name = 3": ["name = 3", "string"],
    "time_limit = -1": ["time_limit = -1 s", "[s]"],
    "[plant]\ntimestep = true": ["plant.timestep = True", "[s]"],
    "[plant]\ntimestep = 0": ["plant.timestep = 0 s", "above 0", "[s]"],
    "[plant]\ntimestep = -1e-3": ["plant.timestep = -0.001 s", "above 0"],
    "[plant]\ntimestep = 3e-4": ["plant.timestep = 0.0003 s", "controller.period = 0.001 s", "0.000333333 s"],
    "[plant]\ntimestep = 1.0": ["plant.timestep = 1.0 s", "0.001 s"],
    "[plant]\ntimestep = 1e-320": ["plant.timestep = 1e-320 s", "0.001 s"],
    "[plant]\nsaturation = 1": ["plant.saturation = 1", "true or false"],
    '[plant]\nintegrator = "rk4"': ["plant.integrator = 'rk4'", "RK4"],
    '[plant]\nkind = "bullet"': ["plant.kind = 'bullet'", "mujoco"],
    "[plant.mass_factor]\ntorso = 0": ["plant.mass_factor.torso = 0", "above 0", "[ratio]"],
    "[plant.mass_factor]\ntorso = nan": ["plant.mass_factor.torso = nan", "[ratio]"],
    "[plant.torque_limit_factor]\nleft_hip = -1": ["plant.torque_limit_factor.left_hip = -1", "0 or above"],
    "[plant.ground]\nfriction = -0.1": ["plant.ground.friction = -0.1", "between 0 and 100"],
    "[plant.ground]\nslope = 2.0": ["plant.ground.slope = 2.0 rad", "pi/2", "[rad]"],
    "[controller]\nhorizon = 0": ["controller.horizon = 0 ticks", "from 1 to 10000"],
    "[controller]\nperiod = inf": ["controller.period = inf s", "above 0"],
    "[controller]\nfriction = -1": ["controller.friction = -1", "0 or above"],
    "[controller]\nkp = [1, 2, 3]": ["controller.kp = [1, 2, 3]", "4 numbers", "[1/s^2]"],
    "[controller]\nkp = [1, 2, 3, nan]": ["controller.kp", "nan", "[1/s^2]"],
    "[controller]\nkd = 1": ["controller.kd = 1", "4 numbers", "[1/s]"],
    '[controller]\nkind = "pd"': ["controller.kind = 'pd'", "c-mpc, zd-pd"],
    '[[pushes]]\nforce = 1\nstep = 1\nbody = "head"': ["pushes.0.body = 'head'", "left_tibia"],
    "[[pushes]]\nstep = 1": ["pushes.0.force: missing", "[N]"],
    "[[pushes]]\nforce = inf\nstep = 1": ["pushes.0.force = inf N", "finite", "[N]"],
    "[[pushes]]\nforce = 1\nstep = 0": ["pushes.0.step = 0", "from 1 to 1000000"],
    "[[pushes]]\nforce = 1": ["pushes.0", "either step, or both start and end [s]"],
    "[[pushes]]\nforce = 1\nstep = 1\nstart = 1\nend = 2": ["pushes.0", "either step"],
    "[[pushes]]\nforce = 1\nstart = 1": ["pushes.0", "both start and end"],
    "[controller.plan]\nshortest = 2": ["controller.plan.shortest = 2.0 s", "below controller.plan.longest = 1.1 s"],
    "[[pushes]]\nforce = 1\nstart = 2\nend = 1": ["pushes.0.end = 1.0 s", "after pushes.0.start = 2.0 s"],
    "[start]\nq_offset = [0, 0, 0, 0]": ["start.q_offset", "5 finite numbers", "[rad]"],
    "[start]\ntorso_offset = nan": ["start.torso_offset = nan rad", "[rad]"],
    "steps = \n": ["not valid TOML", "line 1"],
    "steps = " + "[" * 5000 + "]" * 5000: ["not valid TOML", "nested too deeply"],
}


@pytest.mark.parametrize("toml", BAD)
def test_bad_input_is_refused_in_one_line_with_path_value_and_unit(toml, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(toml)
    with pytest.raises(UserError) as caught:
        from_toml(path)
    message = str(caught.value)
    assert "\n" not in message
    for words in [str(path), *BAD[toml]]:
        assert words in message


def test_unreadable_files_are_refused(tmp_path):
    with pytest.raises(UserError, match="cannot be read"):
        load(str(tmp_path / "none.toml"))
    with pytest.raises(UserError, match="cannot be read"):
        from_toml(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"')
    with pytest.raises(UserError, match="UTF-8"):
        load(str(tmp_path / "latin.toml"))


def test_an_unknown_name_is_refused_with_the_nearest_and_the_list():
    with pytest.raises(UserError, match=r"'push-25'; did you mean push-25N\? Shipped: friction-50N"):
        load("push-25")


@pytest.mark.parametrize(
    "path",
    ["plnt.timestep", "steps.x", "pushes.7.force", "pushes.x.force", "controller.kp.4", "", "plant..x"],
)
def test_an_unknown_path_is_refused(path):
    with pytest.raises(UserError):
        with_value(Scenario(), path, 1)


def test_scenarios_built_by_hand_are_checked_too():
    with pytest.raises(UserError, match=r"plant\.mass_factor\.torso = nan"):
        Scenario(plant=PlantSettings(mass_factor=BodyFactors(torso=math.nan)))


def test_table_lists_every_push():
    paths = [row.path for row in settings.table(load("push-25N"))]
    assert "pushes.0.force" in paths and len(paths) == len(set(paths))
