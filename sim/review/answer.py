"""The answer first: how a run ended, why and when, in one sentence."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.errors import UserError
from sim.interface import JOINTS
from sim.log.read.frames import Run
from sim.log.tools.text import printable
from sim.loop import Outcome
from sim.review.facts import limit_of_torque, scenario_of
from sim.review.signals import Signals, signals_of
from sim.trials.falls.cause import sentence
from sim.trials.falls.recorded import recorded_verdict

MID_STEP = (0.2, 0.8)
"""Of the normalised clock, where the swing foot should be clear of the ground."""


def answer(run: Run, signals: Signals | None = None) -> tuple[str, float | None]:
    """A sentence, and the moment in [s] at which a fall began, None without one.

    Args:
        run: A log, perhaps damaged.
        signals: Its signals, where they have been worked out.
    """
    result = run.result
    outcome = str(result.get("outcome", ""))
    if outcome == Outcome.FELL.value:
        found = recorded_verdict(run)
        why, began = (result.get("fall_reason", ""), None) if found is None else (sentence(*found), found[1].began_s)
        return printable(f"fell{_in_step(result)}: {why}"), began
    if outcome == Outcome.COMPLETED.value:
        try:
            near = _nearest(run, signals or signals_of(run))
        except UserError:  # a log without ticks
            near = ""
        words = f"walked all {result.get('steps')} steps" + (f"; nearest to its limits: {near}" if near else "")
        return printable(words), None
    return printable(" ".join(filter(None, (outcome or "not finished", str(result.get("message", "")))))), None


def _in_step(result: Mapping[str, Any]) -> str:
    """Which step was not made, "" where a log that was tampered with does not say."""
    made = str(result.get("steps") or 0)
    return f" in step {int(made) + 1}" if made.isascii() and made.isdecimal() and len(made) < 9 else ""


def _nearest(run: Run, signals: Signals) -> str:
    """How near torque, friction, clearance and energy came to their limits, and when."""
    words, limits = [], limit_of_torque(run)
    joints = [joint for joint in JOINTS if joint in limits]
    if joints:
        share = np.column_stack([np.abs(signals.columns[f"torque.{joint}"]) / limits[joint] for joint in joints])
        at, which = divmod(int(np.argmax(np.nan_to_num(share))), len(joints))
        name, limit = joints[which].replace("_", " "), limits[joints[which]]
        words.append(f"{name} {share[at, which] * limit:.1f} of {limit:g} N.m at {signals.t[at]:.3f} s")
    scenario, ratio = scenario_of(run), signals.columns["ratio"]
    if scenario and np.isfinite(ratio).any():
        at = int(np.nanargmax(ratio))
        words.append(f"|F_T / F_N| {ratio[at]:.2f} of {scenario.plant.ground.friction:g} at {signals.t[at]:.3f} s")
    words += _least(signals)
    return ", ".join(words)


def _least(signals: Signals) -> list[str]:
    """Least clearance of the swing foot in mid-step, and least rate of the clock: how near it came to a stop."""
    columns, words = signals.columns, []
    swings = np.where(columns["stance"] == 1, columns["clearance.left"], columns["clearance.right"])
    middle = np.where((columns["s"] > MID_STEP[0]) & (columns["s"] < MID_STEP[1]), swings, np.nan)
    if np.isfinite(middle).any():
        at = int(np.nanargmin(middle))
        words.append(f"swing foot {middle[at]:.1f} mm above the ground at {signals.t[at]:.3f} s")
    if np.isfinite(columns["dtheta"]).any():
        at = int(np.nanargmin(columns["dtheta"]))
        words.append(f"clock down to {columns['dtheta'][at]:.2f} rad/s at {signals.t[at]:.3f} s")
    return words
