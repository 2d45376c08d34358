"""Stand-ins for both worlds, for tests of what lies between them."""

import dataclasses

import numpy as np

from sim.errors import PlantDiverged
from sim.interface import LINKS, STATE, ControlStep, PlantState, Status, write_step
from sim.loop import EachTick, Ticks
from sim.loop.ticks import Frame

PERIOD = 1e-3  # [s]
COM = {"torso": (0.0, 0.24), "left_femur": (0.0, 0.11)}  # [m]


def plant_state(**changes):
    """A walker that stands: left foot under the hip, right foot behind and in the air."""
    still = PlantState(
        t=0.0,
        q=np.zeros(5),
        dq=np.zeros(5),
        hip=np.array([0.0, 0.75]),
        dhip=np.zeros(2),
        foot=np.array([[0.0, 0.0], [-0.2, 0.1]]),
        clearance=np.array([0.0, 0.1]),
        torque=np.zeros(4),
        contact=(True, False),
        contact_force=np.array([[0.0, 314.0], [0.0, 0.0]]),
        push=np.zeros(2),
    )
    return dataclasses.replace(still, **changes)


def write_state(row, state):
    """Fill a row of `STATE`."""
    for name in STATE.names:
        row[name] = [link in state.penetrating for link in LINKS] if name == "penetrating" else getattr(state, name)


def rows_of(state):
    """The same state as a single row of `STATE`."""
    rows = np.zeros(1, STATE)
    write_state(rows[0], state)
    return rows


def control_step(**changes):
    """What a controller that stands on its left foot and solves its problem decides."""
    return ControlStep(
        **{"stance": "left", "u_total": np.ones(4), "u_zd": np.ones(4), "status": Status.OPTIMAL} | changes
    )


def tell(tape, k, state, observation, step, tick_s):
    """Tell a tape a single tick, as the loop does."""
    tape.ticks(one_tick(k, state, observation, step, tick_s, tape.frame_every))


def one_tick(k, state, observation, step, tick_s, frame_every=0, **judged):
    """A tick of given records as a stretch of one row."""
    ticks = dataclasses.replace(Ticks.room(1), first=k)
    write_state(ticks.state[0], state)
    if observation is not None:
        for name in ("t", "q", "dq", "contact"):
            ticks.seen[0][name] = getattr(observation, name)
    if not write_step(ticks.step, 0, step):
        ticks.texts[k] = step.status
    if frame_every and k % frame_every == 0:
        ticks.frames[k] = Frame(state.applied, step.plan)
    for name, value in judged.items():
        ticks.judged[0][name] = value
    ticks.tick_s[0] = tick_s
    return ticks


class Clockwork:
    """A plant that takes a step of 0.4 m every `ticks_per_step` ticks, whatever torque is held."""

    def __init__(self, ticks_per_step=10, *, never_lands=False, falls_at=None, diverges_at=None):
        self.ticks_per_step, self.never_lands = ticks_per_step, never_lands
        self.falls_at, self.diverges_at = falls_at, diverges_at
        self.com, self.torque_limits = COM, np.full(4, 75.0)
        self.reset()

    def reset(self, q=None, dq=None, stance="left"):
        self.k = 0
        self.torques, self.forces = [], []

    def state(self):
        steps = 0 if self.never_lands else self.k // self.ticks_per_step
        feet = np.zeros((2, 2))
        stance = steps % 2  # the left foot stands first
        feet[stance, 0] = 0.4 * steps
        feet[1 - stance, 0] = 0.4 * (steps - 1)  # the foot that stood before
        contact = [False, False]
        contact[stance] = True
        hip = 0.2 if self.falls_at is not None and self.k >= self.falls_at else 0.75
        return plant_state(t=self.k * PERIOD, foot=feet, contact=tuple(contact), hip=np.array([feet[stance, 0], hip]))

    def load(self, forces):
        self.loaded = tuple(forces)

    def look(self, state, seen, i):
        truth = self.state()
        write_state(state[i], truth)
        seen["t"][i], seen["q"][i], seen["dq"][i], seen["contact"][i] = truth.t, 0.0, 0.0, truth.contact

    def move(self, step, i, acting):
        if self.k == self.diverges_at:
            raise PlantDiverged("qpos[3] is nan")
        self.torques.append(step["u_total"][i].copy())
        self.forces.append(tuple(force for force, acts in zip(self.loaded, acting, strict=True) if acts))
        self.k += 1


class Counting:
    """A controller whose torque tells the tick; `step_of` may change what it reports."""

    def __init__(self, step_of=lambda k: {}):
        self.step_of, self.seen = step_of, []

    def reset(self, stance):
        self.seen.clear()

    def step(self, observation):
        k = len(self.seen)
        self.seen.append(observation)
        return control_step(**{"u_total": np.full(4, float(k)), **self.step_of(k)})


class Tape(EachTick):
    """Remembers ticks and events."""

    frame_every = 1

    def __init__(self):
        self.told, self.events = [], []

    def tick(self, k, state, observation, step, tick_s):
        self.told.append((k, state, observation, step, tick_s))

    def event(self, k, level, name, message):
        self.events.append((k, level, name, message))

    def named(self, name):
        return [event for event in self.events if event[2] == name]
