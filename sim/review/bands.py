"""The story of a run in bands: stretches of time in which something holds, found at every tick."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.interface import JOINTS, LEGS
from sim.log.format.fields import CONTROL, PLANT_STATE
from sim.log.read.frames import Run
from sim.review.facts import limit_of_torque, scenario_of
from sim.review.signals import Signals

MOST_SPANS = 2000  # of a band
CLOSE = 3e-3  # [s]; stretches that are nearer are drawn as one
AT_LIMIT = 0.999  # of a torque limit
ON_CONE = 0.995  # of the friction that the controller assumes
MISSED = 50.0  # [N] of a contact force that is not as expected, a sixth of the walker's weight

Flags = NDArray[np.bool_]


def bands(run: Run, signals: Signals) -> list[dict[str, Any]]:
    """Bands in the page's order, each with its name, a colour of the style sheet and its stretches in [s].

    Args:
        run: A log, perhaps damaged.
        signals: Its signals.
    """
    touch = [_flags(run, signals, PLANT_STATE.topic, f"contact.{leg}") for leg in LEGS]
    rows: list[tuple[str, str, Flags]] = []
    if any(one.any() for one in touch):
        rows += [(f"{leg} foot on the ground", leg, one) for leg, one in zip(LEGS, touch, strict=True)]
        rows += [("double support", "c3", touch[0] & touch[1]), ("flight", "bad", ~(touch[0] | touch[1]))]
    columns = signals.columns
    rows.append(("push", "push", np.nan_to_num(np.hypot(columns["push.x"], columns["push.z"])) > 0.0))
    for joint, limit in limit_of_torque(run).items():
        if joint in JOINTS and limit > 0.0:
            full = np.abs(np.nan_to_num(columns[f"torque.{joint}"])) >= AT_LIMIT * limit
            rows.append((f"{joint.replace('_', ' ')} at its torque limit", "warn", full))
    scenario = scenario_of(run)
    if scenario and np.nan_to_num(columns["active"]).any():
        on_cone = np.nan_to_num(columns["ratio.expected"]) >= ON_CONE * scenario.controller.friction
        rows.append(("friction row active", "contact", on_cone))
    rows.append(("fall-back", "bad", _flags(run, signals, CONTROL.topic, "fallback")))
    miss = np.fmax(np.abs(columns["error.normal"]), np.abs(columns["error.tangential"]))
    rows.append((f"force off by {MISSED:.0f} N", "c4", np.nan_to_num(miss) > MISSED))
    found = [{"name": name, "colour": colour, "spans": spans(signals.t, held)} for name, colour, held in rows]
    feet = tuple(f"{leg} foot on the ground" for leg in LEGS)
    return [row for row in found if row["spans"] or row["name"] in feet]


def _flags(run: Run, signals: Signals, topic: str, name: str) -> Flags:
    """A flag at every tick of the signals; off where the log has none."""
    frame = run.frames[topic] if topic in run.frames else None
    if frame is None or name not in frame or not len(frame.tick):
        return np.zeros(len(signals.tick), bool)
    at = np.minimum(np.searchsorted(frame.tick, signals.tick), len(frame.tick) - 1)
    return np.asarray((frame[name][at] != 0) & (frame.tick[at] == signals.tick))


def spans(t: NDArray[np.float64], held: Flags) -> list[tuple[float, float]]:
    """Stretches (from, to) in [s] in which a flag holds; a tick holds until the next.

    Args:
        t: Time in [s], (n,).
        held: The flag, (n,).
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([False], held, [False])).astype(np.int8)))
    ends = np.append(t, t[-1] + (t[-1] - t[-2] if len(t) > 1 else 0.0))
    found: list[tuple[float, float]] = []
    for a, b in zip(ends[edges[::2]].tolist(), ends[edges[1::2]].tolist(), strict=True):
        if found and a - found[-1][1] < CLOSE:
            found[-1] = (found[-1][0], b)
        else:
            found.append((a, b))
    return [(round(a, 6), round(b, 6)) for a, b in found[:MOST_SPANS]]
