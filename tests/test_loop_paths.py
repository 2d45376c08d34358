"""A run has the same bits whichever way its loop takes: from row to row in compiled code, or from record to record."""

import numpy as np
import pytest

from sim.bridge.run import build_controller, build_plant, instrument, known_belief, start_state
from sim.interface import LEGS
from sim.loop import Course, Loop, NoTape
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

    frame_every = 7

    def __init__(self):
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


def walk(scenario, seen_as):
    belief = known_belief(scenario.walker, scenario.gait)
    plant = build_plant(scenario)
    q, dq = start_state(scenario, belief)
    rows = Rows()
    course = Course(
        q=q, dq=dq, steps=scenario.steps, end_time=scenario.end_time, pushes=scenario.pushes, stance=LEGS[0]
    )
    controller = seen_as(build_controller(scenario.controller, belief))
    summary = Loop(plant=instrument(plant, scenario), controller=controller, course=course, tape=rows).run()
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
