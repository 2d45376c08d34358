"""What broke in a run that fell, from its log: the verdict that a `Witness` of the run itself gives."""

import math

import numpy as np

from sim.interface import COORDINATES, JOINTS
from sim.log.format.fields import LEGS, OUTPUTS
from sim.log.read.frames import Run
from sim.loop import Outcome
from sim.trials.falls.cause import Cause, Evidence
from sim.trials.falls.verdict import SUNK, verdict
from sim.trials.falls.witness import FORESEEN, KEPT

STATE, CONTROL = "/plant/state", "/control"


def recorded_verdict(run: Run) -> tuple[Cause, Evidence] | None:
    """What broke; None for a run that did not fall, or whose log lacks what tells.

    Args:
        run: A log, perhaps damaged.
    """
    if run.result.get("outcome") != Outcome.FELL.value or not {STATE, CONTROL} <= set(run.frames):
        return None
    state, control = run.frames[STATE], run.frames[CONTROL]
    n = min(len(state.t), len(control.t))
    names = {f"clearance.{leg}" for leg in LEGS} | {f"contact.{leg}" for leg in LEGS}
    if n < 2 or not np.array_equal(state.tick[:n], control.tick[:n]) or not names <= set(state):
        return None
    t, period = state.t[:n], (state.t[1] - state.t[0]) / max(1, state.tick[1] - state.tick[0])
    clearance = np.column_stack([state[f"clearance.{leg}"][:n] for leg in LEGS])
    touches = np.column_stack([state[f"contact.{leg}"][:n] != 0 for leg in LEGS]) | (clearance < -SUNK)
    feet = np.column_stack([state[f"foot.{leg}.x"][:n] for leg in LEGS])
    landings = [event.t for event in run.events if event.name == "impact"]
    step = np.searchsorted(landings, t + 0.5 * period)  # landings so far; one is told before the tick it falls on
    stance = step % 2  # runs start on the left leg
    landed = np.concatenate(([0.0], landings))[step]
    rows = np.column_stack(
        [
            t,
            stance,
            landed,
            _due(t, step, control["impact_in"][:n] * period),
            control["s"][:n],
            control["dtheta"][:n],
            control["fallback"][:n],
            touches,
            np.take_along_axis(feet, stance[:, None], axis=1),
            *(state[f"torque.{joint}"][:n] for joint in JOINTS),
            *(control[f"y.{output}"][:n] for output in OUTPUTS),
            *(control[f"u_total.{joint}"][:n] for joint in JOINTS),
            *(state[f"dq.{name}"][:n] for name in COORDINATES),
            *(control[f"observation.q.{name}"][:n] - state[f"q.{name}"][:n] for name in COORDINATES),
            _clock_at_landing(step, control["s"][:n]),
        ]
    )
    limits = run.result.get("torque_limit_Nm")
    limits = limits if isinstance(limits, dict) else {}
    known = [limits.get(joint) for joint in JOINTS]
    limit = np.array([x if isinstance(x, int | float) else math.inf for x in known])
    return verdict(rows[-round(KEPT / period) :], -float(clearance[0].min()), period, limit)


def _clock_at_landing(step: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Normalised clock one tick before the last landing, (n,); 1 where there was none."""
    first = np.searchsorted(step, step)  # of the step that a tick is in
    return np.where(first > 0, s[np.maximum(first - 1, 0)], 1.0)


def _due(t: np.ndarray, step: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """When the swing foot should land in [s], (n,): what the controller foresaw first within `FORESEEN`."""
    due = np.full(len(t), math.inf)
    foreseen = (ahead >= 0.0) & (ahead <= FORESEEN)
    for number in np.unique(step[foreseen]):
        ticks = np.flatnonzero(step == number)
        first = ticks[np.argmax(foreseen[ticks])]
        due[first : ticks[-1] + 1] = t[first] + ahead[first]
    return due
