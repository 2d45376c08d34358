"""The story of a run: bands against the ticks, steps against the events, energy and momentum against MuJoCo."""

import mujoco
import numpy as np
import pytest

from sim.bridge.run import build_plant, run_scenario
from sim.interface import COORDINATES
from sim.review import load
from sim.review.bands import CLOSE, bands, spans
from sim.review.facts import disagreements
from sim.review.mechanics import mechanics_of
from sim.review.signals import signals_of
from sim.review.steps import steps
from sim.scenario import load as load_scenario
from sim.scenario import with_values


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """A log and its scenario: a heavy torso pushed forwards."""
    path = tmp_path_factory.mktemp("story") / "run.mcap"
    scenario = with_values(load_scenario("push-40N-first"), {"steps": 2, "plant.mass_factor.torso": 1.2})
    run_scenario(scenario, log=path)
    return load(path), scenario


def test_spans_are_where_the_flag_is_set():
    t = np.arange(1000) * 1e-3
    held = np.zeros(1000, bool)
    held[100:200] = held[202:300] = held[990:] = True
    assert spans(t, held) == [(0.1, 0.3), (0.99, 1.0)]
    assert spans(t, ~held)[0] == (0.0, 0.1) and CLOSE > 2e-3
    assert spans(t, np.zeros(1000, bool)) == []


def test_bands_are_those_of_the_ticks(walk):
    run, _ = walk
    signals = signals_of(run)
    found = {row["name"]: row["spans"] for row in bands(run, signals)}
    state = run["/plant/state"]

    def share(name):
        return sum(b - a for a, b in found[name])

    for leg in ("left", "right"):
        assert share(f"{leg} foot on the ground") == pytest.approx(1e-3 * state[f"contact.{leg}"].sum(), abs=0.02)
    assert share("push") == pytest.approx(1e-3 * (state["push.x"] != 0.0).sum(), abs=2e-3)
    limit = run.result["torque_limit_Nm"]["left_hip"]
    full = (np.abs(state["torque.left_hip"]) >= 0.999 * limit).sum()
    assert share("left hip at its torque limit") == pytest.approx(1e-3 * full, abs=0.02)


def test_steps_are_those_of_the_events(walk):
    run, _ = walk
    signals = signals_of(run)
    rows = steps(run, signals)
    impacts = [event for event in run.events if event.name == "impact"]
    assert len(rows) == len(impacts) == 2 and all(row["whole"] for row in rows)
    for row, impact in zip(rows, impacts, strict=True):
        seconds, metres = (float(row["cells"][at]) for at in (2, 3))
        assert f"{seconds:.3f} s, {metres:.3f} m" in impact.message


def test_energy_and_momentum_are_those_of_mujoco(walk):
    run, scenario = walk
    signals = signals_of(run)
    found = mechanics_of(run, signals.columns)
    model = build_plant(scenario).model
    data = mujoco.MjData(model)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    names = ("hip_x", "hip_z", "torso", "left_hip", "right_hip", "left_knee", "right_knee")
    q_at = [int(model.jnt_qposadr[model.joint(name).id]) for name in names]
    v_at = [int(model.jnt_dofadr[model.joint(name).id]) for name in names]
    state, k = run["/plant/state"], 200
    foot = ("left", "right")[int(run["/control"]["stance"][k])]
    angles = [COORDINATES[at] for at in (4, 0, 1, 2, 3)]
    data.qpos[q_at] = [state[f"hip.{axis}"][k] for axis in "xz"] + [state[f"q.{name}"][k] for name in angles]
    data.qvel[v_at] = [state[f"dhip.{axis}"][k] for axis in "xz"] + [state[f"dq.{name}"][k] for name in angles]
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    torso = model.body("torso").id
    mass, at, moves = model.body_subtreemass[torso], data.subtree_com[torso], data.subtree_linvel[torso]
    x, z = at[0] - state[f"foot.{foot}.x"][k], at[2] - state[f"foot.{foot}.z"][k]
    about_y = data.subtree_angmom[torso][1] + mass * (z * moves[0] - x * moves[2])  # positive forwards
    assert found["momentum"][k] == pytest.approx(about_y, rel=5e-3)
    height = state[f"foot.{foot}.z"][k]
    assert found["energy"][k] == pytest.approx(data.energy.sum() - mass * 9.81 * height, rel=2e-3)


def test_the_nominal_orbit_is_the_one_that_is_walked(tmp_path):
    scenario = with_values(load_scenario("undisturbed"), {"steps": 2, "gait": "paper-polished"})
    run_scenario(scenario, log=tmp_path / "run.mcap")
    run = load(tmp_path / "run.mcap")
    signals = signals_of(run)
    found = mechanics_of(run, signals.columns)
    quiet = slice(20, 480)
    assert np.nanmax(np.abs(signals.columns["dtheta"] - found["dtheta.nominal"])[quiet]) < 0.01
    assert np.nanmax(np.abs(found["energy"] - found["energy.nominal"])[quiet]) < 0.5


def test_what_the_controller_does_not_know_is_told(walk):
    run, _ = walk
    assert ("plant.mass_factor.torso", "1.2 ratio", "1 ratio") in disagreements(run)
    assert all("controller" not in row[0] for row in disagreements(run))
