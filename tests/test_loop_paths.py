"""A run has the same bits whichever way its loop takes: from row to row in compiled code, or from record to record."""

import numpy as np
import pytest

from sim.bridge.run import build_controller, build_plant, instrument, known_belief, start_state
from sim.interface import LEGS
from sim.loop import Course, Loop, NoTape, Patient
from sim.loop import loop as the_loop
from sim.scenario import load, with_values

PUSHED = {"name": "push-25N", "steps": 2}
NOISY = {"sensors.angle_noise": 1e-4, "sensors.latency": 1, "actuation.latency": 1, "actuation.noise": 0.1}


class RecordsAlone:
    """A controller of which the loop sees no more than the protocol asks for."""

    def __init__(self, inner):
        self._inner = inner

    def reset(self, stance):
        self._inner.reset(stance)

    def step(self, observation):
        return self._inner.step(observation)


class Rows(NoTape):
    """Keeps every row."""

    def __init__(self, frame_every=7):
        self.frame_every = frame_every
        self.parts, self.plans, self.events = [], [], []

    def ticks(self, ticks):
        step = ticks.step.copy()
        step["solve_s"] = 0.0  # measures the machine
        self.parts.append((ticks.state.copy(), ticks.seen.copy(), step, ticks.judged.copy()))
        last = ticks.first + len(ticks)
        frames = [ticks.frames[k] for k in sorted(ticks.frames) if ticks.first <= k < last]
        self.plans += [(f.plan.outputs(), f.plan.contact_forces()) for f in frames if f.plan]

    def event(self, k, level, name, message):
        self.events.append((k, level, name, message))

    def bits(self):
        columns = [np.concatenate(column) for column in zip(*self.parts, strict=True)]
        return {(part, name): rows[name].tobytes() for part, rows in enumerate(columns) for name in rows.dtype.names}


def walk(scenario, seen_as, frame_every=7, **how):
    belief = known_belief(scenario.walker, scenario.gait)
    plant = build_plant(scenario)
    q, dq = start_state(scenario, belief)
    rows = Rows(frame_every)
    course = Course(
        q=q, dq=dq, steps=scenario.steps, end_time=scenario.end_time, pushes=scenario.pushes, stance=LEGS[0]
    )
    controller = seen_as(build_controller(scenario.controller, belief))
    summary = Loop(plant=instrument(plant, scenario), controller=controller, course=course, tape=rows).run(**how)
    return rows, summary


@pytest.mark.parametrize("kind", ["zd-pd", "c-mpc"])
@pytest.mark.parametrize("plant", ["mujoco", "rigid"])
@pytest.mark.parametrize("changes", [{}, NOISY], ids=["clean", "noisy"])
def test_rows_and_records_give_the_same_run(kind, plant, changes):
    timestep = 1e-3 if plant == "rigid" else 0.25e-3
    scenario = with_values(
        load("push-40N-first"),
        {"controller.kind": kind, "plant.kind": plant, "plant.timestep": timestep, "steps": 2} | changes,
    )
    rows, there = walk(scenario, lambda controller: controller)
    records, here = walk(scenario, RecordsAlone)
    ours, theirs = rows.bits(), records.bits()
    assert [name for name in ours if ours[name] != theirs[name]] == []
    assert rows.events == records.events
    assert there.state_digest == here.state_digest and there.steps == here.steps
    assert len(rows.plans) == len(records.plans) and bool(rows.plans) == (kind == "c-mpc")
    for plan, other in zip(rows.plans, records.plans, strict=True):
        assert np.array_equal(plan[0], other[0]) and np.array_equal(plan[1], other[1])


RIGID = {"controller.kind": "zd-pd", "plant.kind": "rigid", "plant.timestep": 1e-3}
MUJOCO = {"controller.kind": "zd-pd", "plant.kind": "mujoco"}
ERRING = {
    "sensors.angle_noise": 1e-4,
    "sensors.torso_rate_noise": 1e-3,
    "sensors.angle_resolution": 1e-5,
    "sensors.torso_drift": 1e-3,
    "sensors.contact_delay": 2,
    "sensors.contact_dropout": 0.01,
    "sensors.latency": 1,
    "actuation.latency": 1,
    "actuation.noise": 0.1,
    "actuation.resolution": 0.01,
    "actuation.lag": 1e-3,
}
RIDES = {
    "walks": {"steps": 3},
    "is pushed": {"steps": 3, "pushes.0.force": 20.0, "pushes.0.step": 1, "pushes.0.body": "left_tibia"},
    "scuffs": {"steps": 4, "pushes.0.force": 35.0, "pushes.0.step": 1, "controller.impact_time": 0.0},
    "falls": {"steps": 9, "pushes.0.force": 90.0, "pushes.0.start": 0.3, "pushes.0.end": 0.9},
    "runs out of time": {"steps": 9, "time_limit": 0.7773},
    "has rough ground and friction": {"steps": 3, "plant.ground.slope": 0.03, "plant.joint_friction.left_knee": 1.0},
    "has other substeps": {"steps": 2, "plant.timestep": 5e-4, "plant.ground.damping_factor": 0.5},
    "is seen late and noisily, its motors err": {"steps": 3} | ERRING,
    "differentiates what it sees": {"steps": 2, "sensors.rates": "differentiated", "sensors.rate_cutoff": 50.0},
    "falls at once": {"steps": 3, "plant.saturation": False, "controller.kp": (4e7,) * 4},
}


def same(way, other):
    rows, summary = way
    ours, theirs = rows.bits(), other[0].bits()
    assert [name for name in ours if ours[name] != theirs[name]] == []
    assert other[0].events == rows.events
    for name in ("outcome", "message", "fall_reason", "steps", "state_digest", "rms_torque_Nm", "slip_m"):
        assert getattr(other[1], name) == getattr(summary, name)


@pytest.mark.parametrize("plant", [RIGID, MUJOCO], ids=["rigid", "mujoco"])
@pytest.mark.parametrize("changes", RIDES.values(), ids=RIDES)
def test_a_ride_through_uneventful_ticks_gives_the_same_run(changes, plant, monkeypatch):
    rides_alike(with_values(load("undisturbed"), plant | changes), monkeypatch)


@pytest.mark.parametrize("plant", [RIGID, MUJOCO], ids=["rigid", "mujoco"])
@pytest.mark.parametrize("name", ["is pushed", "falls", "is seen late and noisily, its motors err", "falls at once"])
def test_a_ride_of_c_mpc_goes_on_where_its_kernel_has_no_answer(name, plant, monkeypatch):
    scenario = with_values(load("undisturbed"), plant | RIDES[name] | {"controller.kind": "c-mpc"})
    summary = rides_alike(scenario, monkeypatch)
    assert (summary.fallbacks > 50) == name.startswith("falls")  # ticks that diverge, or that no solver answers


def rides_alike(scenario, monkeypatch):
    told = []
    how = {"stop": Patient(lambda: None), "progress": lambda *what: told.append(what)}
    ridden = [
        walk(scenario, lambda controller: controller, frame_every=0),
        walk(scenario, lambda controller: controller, frame_every=100),
        walk(scenario, lambda controller: controller, frame_every=0, **how),
    ]
    monkeypatch.setattr(the_loop, "ride_of", lambda *_: None)
    in_the_ride = told.copy()
    told.clear()
    row_to_row = walk(scenario, lambda controller: controller, frame_every=0, **how)
    assert in_the_ride == told
    for way in ridden:
        same(row_to_row, way)
    return row_to_row[1]


def broken_state(plant, controller):
    plant._work["now"][0, 5:] = 1e80


def broken_law(plant, controller):
    controller.loop.gains.kp[:] = np.nan


@pytest.mark.parametrize(("breaks", "outcome"), [(broken_state, "fell"), (broken_law, "error")])
def test_what_breaks_within_a_ride_is_told_as_it_is_outside(breaks, outcome, monkeypatch):
    scenario, built = with_values(load("undisturbed"), RIGID | {"steps": 3}), {}
    monkeypatch.setitem(globals(), "instrument", lambda plant, _: built.setdefault("plant", plant))

    def run():
        built.clear()

        def progress(steps, t):
            if round(1e3 * t) == 149:
                breaks(**built)

        with np.errstate(all="ignore"):
            return walk(scenario, lambda law: built.setdefault("controller", law), frame_every=0, progress=progress)

    ridden = run()
    monkeypatch.setattr(the_loop, "ride_of", lambda *_: None)
    same(run(), ridden)
    assert ridden[1].outcome == outcome and 150 <= ridden[1].ticks < 155


def test_a_ride_hears_a_wish_to_stop_between_two_of_its_stretches():
    asked = []

    def stop():
        asked.append(None)
        return "enough" if len(asked) == 4 else None

    scenario = with_values(load("undisturbed"), RIGID | {"steps": 10})
    _, summary = walk(scenario, lambda controller: controller, frame_every=0, stop=Patient(stop))
    assert (summary.outcome, summary.message) == ("interrupted", "enough")
    assert 4 < summary.ticks <= 3 * the_loop.BLOCK
    exact = walk(scenario, lambda controller: controller, frame_every=0, stop=stop_after(summary.ticks))[1]
    assert exact.state_digest == summary.state_digest and exact.ticks == summary.ticks


def stop_after(ticks):
    """A wish to stop that wants to be asked every tick."""
    asked = iter(range(10**6))
    return lambda: "enough" if next(asked) == ticks else None
