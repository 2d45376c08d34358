"""Judges a run again from its ticks: its steps, its end and its figures must be those that the log tells.

The signature shows a change; this shows a falsehood, also where somebody made a new signature. What only the state
after the last tick tells (its digest, the last step's length) is not in the ticks: `cmpc replay` finds it again.
"""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.errors import UserError
from sim.interface import JOINTS
from sim.log.format.fields import LEGS, OUTPUTS
from sim.log.read import Log
from sim.log.read.frames import Event, events_of, parsed
from sim.loop.judge import SETTLING, STEP_SHARE
from sim.loop.metrics import Durations
from sim.loop.outcome import Outcome
from sim.scenario import from_toml

TOLERANCE = 1e-9  # relative; sums in another order differ by less
_END = re.compile(r"(\w+) after (\d+) steps:\s*(.*)", re.S)
IMPACT = re.compile(r"step (\d+): (left|right) foot, ([\d.]+) s, (-?[\d.]+) m")
_STEP_ROUNDED = 6e-4  # [m]; the event of the last landing tells its length to 1 mm


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A landing: its tick, the length in [m], the foot, and the time since the last in [s]."""

    tick: int
    length: float
    foot: str
    duration: float


def judged_problems(log: Log) -> list[str]:
    """What a log tells of its run that its ticks contradict, a sentence each; none where it has no result."""
    result = {name: parsed(text) for name, text in log.metadata.get("result", {}).items()}
    if not result:
        return []
    try:
        with np.errstate(all="ignore"):
            return list(_problems(log, result))
    except (UserError, ValueError, KeyError, TypeError, OverflowError, IndexError, RecursionError) as error:
        return [f"the run cannot be judged from its ticks: {error}"]


def _problems(log: Log, result: dict[str, Any]) -> Iterator[str]:
    state, control, mpc, timing = (log.channel(t) for t in ("/plant/state", "/control", "/mpc", "/timing"))
    period = int(log.metadata["run"]["period_ns"]) * 1e-9
    n = len(state)
    if not len(control) == len(mpc) == len(timing) == n:
        yield "the channels have different numbers of ticks"
        return
    events = [(round(event.t / period), event) for event in events_of(log)]
    steps = _steps(state, _step_length(log, result), period)
    yield from _compare_steps(steps, events, n)
    yield from _compare_end(events, result, n)
    count = sum(event.name == "impact" for _, event in events)
    if result.get("steps") != count:
        yield f"the result tells {result.get('steps')} steps, the events {count}"
    try:
        wanted = from_toml(log.attachments["scenario.toml"][1].decode()).steps
    except (KeyError, ValueError):  # told by the check of attachments
        wanted = None
    if wanted is not None and (result.get("outcome") == Outcome.COMPLETED.value) != (count >= wanted):
        yield f"the outcome is {result.get('outcome')!r} after {count} of {wanted} steps"
    last = _last_step(events, steps, n, period)
    for name, value, tolerance in _figures(state, control, mpc, timing, steps, last, period):
        told = result.get(name)
        if not _agree(told, value, tolerance):
            yield f"the figure {name} is {json.dumps(told)[:80]}, the ticks give {json.dumps(value)[:80]}"


def _step_length(log: Log, result: dict[str, Any]) -> float:
    """Least length of a step in [m]."""
    said = result.get("judged_by")
    if isinstance(said, dict) and "step_length" in said:
        return float(said["step_length"])
    lengths = json.loads(log.metadata["run"]["link_lengths"])
    return STEP_SHARE * float(lengths["left_femur"] + lengths["left_tibia"])


def _steps(state: NDArray[Any], least: float, period: float) -> list[Step]:
    """Landings of the swing foot ahead of the stance foot; the left foot stands first."""
    contact = [state[f"contact.{leg}"].tolist() for leg in LEGS]
    x = [state[f"foot.{leg}.x"].tolist() for leg in LEGS]
    stance, last, steps = 0, 0, []
    for row, tick in enumerate(state["_tick"].tolist()):
        swing = 1 - stance
        if contact[swing][row] and x[swing][row] - x[stance][row] >= least:
            length = x[swing][row] - x[stance][row]
            steps.append(Step(tick=tick, length=length, foot=LEGS[swing], duration=(tick - last) * period))
            stance, last = swing, tick
    return steps


def _compare_steps(steps: list[Step], events: list[tuple[int, Event]], n: int) -> Iterator[str]:
    """Landings against events, those of the state after the last tick left out."""
    told = [(tick, event.message) for tick, event in events if event.name == "impact" and tick < n]
    if [tick for tick, _ in told] != [step.tick for step in steps]:
        yield f"the events tell {len(told)} landings, the ticks {len(steps)}, or at other times"
        return
    for number, (step, (tick, message)) in enumerate(zip(steps, told, strict=True), start=1):
        if message != f"step {number}: {step.foot} foot, {step.duration:.3f} s, {step.length:.3f} m":
            yield f"the event at tick {tick} tells another landing than the ticks: {message[:80]}"


def _compare_end(events: list[tuple[int, Event]], result: dict[str, Any], n: int) -> Iterator[str]:
    """The event of the end against the result."""
    ends = [(tick, event) for tick, event in events if event.name in {one.value for one in Outcome}]
    match = _END.fullmatch(ends[-1][1].message) if ends else None
    if match is None or len(ends) != 1 or ends[0][0] not in (n - 1, n):
        yield "no event tells how the run ended" if not ends else "the event of the run's end is not at its end"
        return
    outcome, steps, detail = match.groups()
    if outcome != result.get("outcome") or ends[0][1].name != outcome:
        yield f"the outcome is {str(result.get('outcome'))[:40]!r}, the event of the end says {outcome!r}"
    if result.get("steps") != int(steps):
        yield f"the result tells {result.get('steps')} steps, the event of the end {steps}"
    told = result.get("fall_reason") if outcome == Outcome.FELL.value else result.get("message")
    if _words(told) != _words(detail):
        yield "the result gives another reason for the end than its event"


def _words(text: object) -> str:
    return re.sub(r"[()\s]+", " ", str(text)).strip()


def _last_step(events: list[tuple[int, Event]], steps: list[Step], n: int, period: float) -> Step | None:
    """The landing that only the state after the last tick has, from its event."""
    for tick, event in events:
        match = IMPACT.fullmatch(event.message) if event.name == "impact" and tick >= n else None
        if match:
            began = steps[-1].tick if steps else 0
            return Step(tick=tick, length=float(match[4]), foot=match[2], duration=(tick - began) * period)
    return None


def _figures(
    state: NDArray[Any],
    control: NDArray[Any],
    mpc: NDArray[Any],
    timing: NDArray[Any],
    steps: list[Step],
    last: Step | None,
    period: float,
) -> Iterator[tuple[str, Any, float]]:
    """Name, value and relative tolerance of each figure that the ticks tell."""
    n, every = len(state), [*steps, *([last] if last else [])]
    torque = np.stack([state[f"torque.{joint}"] for joint in JOINTS])
    yield "ticks", n, 0.0
    yield "time_s", n * period, TOLERANCE + 1.01 * period / max(n * period, period)
    yield "step_time_s", _mean([step.duration for step in every]), 1e-6
    mean_length = _mean([step.length for step in every])
    spread = _STEP_ROUNDED / len(every) / mean_length if last and mean_length else 0.0
    yield "step_length_m", mean_length, TOLERANCE + spread
    if not n:
        return
    yield "peak_torque_Nm", dict(zip(JOINTS, np.abs(torque).max(axis=1).tolist(), strict=True)), TOLERANCE
    rms = np.sqrt(np.square(torque).mean(axis=1)).tolist()
    yield "rms_torque_Nm", dict(zip(JOINTS, rms, strict=True)), TOLERANCE
    y2 = sum(float(np.square(control[f"y.{name}"]).sum()) for name in OUTPUTS)
    yield "output_error_rms_rad", float(np.sqrt(y2 / (4 * n))), TOLERANCE
    zd2, mpc2 = (sum(float(np.square(control[f"{u}.{j}"]).sum()) for j in JOINTS) for u in ("u_zd", "u_mpc"))
    yield "mpc_torque_share", float(np.sqrt(mpc2 / zd2)) if zd2 else None, TOLERANCE
    yield "fallbacks", int(control["fallback"].sum()), 0.0
    yield "slack_max_N", max(0.0, float(mpc["slack"].max())), TOLERANCE
    yield from _feet(state, steps)
    hip = state["hip.x"]
    ahead = float(state["dhip.x"][-1]) * period
    moved = float(hip[-1] - hip[0]) + ahead
    yield "speed_m_s", moved / (n * period), TOLERANCE + (1e-3 + 2 * abs(ahead)) / max(abs(moved), 1e-9)
    for name, values in (("tick_ms", timing["tick"]), ("solve_ms", timing["solve"][timing["solve"] != 0.0])):
        durations = Durations()
        durations.add(values.tolist())
        yield name, durations.milliseconds(), TOLERANCE


def _feet(state: NDArray[Any], steps: list[Step]) -> Iterator[tuple[str, Any, float]]:
    """Slip of the stance foot and its worst friction ratio."""
    stance = np.zeros(len(state), int)
    since = np.arange(len(state))
    for step in steps:
        row = int(np.searchsorted(state["_tick"], step.tick))
        stance[row:] = LEGS.index(step.foot)
        since[row:] = np.arange(len(state) - row)
    rows = np.arange(len(state))
    x = np.stack([state[f"foot.{leg}.x"] for leg in LEGS])[stance, rows]
    touches = np.stack([state[f"contact.{leg}"] for leg in LEGS])[stance, rows]
    slides = (stance[1:] == stance[:-1]) & touches[1:]
    yield "slip_m", float(np.abs(np.diff(x))[slides].sum()), TOLERANCE
    force = [np.stack([state[f"contact_force.{leg}.{part}"] for leg in LEGS])[stance, rows] for part in _PARTS]
    ratio = np.where(force[1] > 0.0, np.abs(force[0]) / force[1], 0.0)
    settled = since * (state["_time_ns"][-1] * 1e-9 / max(int(state["_tick"][-1]), 1)) - SETTLING
    # Whether a tick just SETTLING after its impact counts is up to the rounding of the plant's clock.
    least = float(ratio[settled > 1e-9].max(initial=0.0))
    more = [max(least, one) for one in ratio[np.abs(settled) <= 1e-9].tolist()]
    yield "friction_ratio_max", [least, *more], TOLERANCE


_PARTS = ("tangential", "normal")


def _mean(values: list[float]) -> float | None:
    return sum(values) / len(values) if values else None


def _agree(told: Any, value: Any, tolerance: float) -> bool:
    """Whether a figure is what the ticks give; a list holds what it may be."""
    if isinstance(value, list):
        return any(_agree(told, one, tolerance) for one in value)
    if isinstance(value, dict):
        return (
            isinstance(told, dict)
            and told.keys() == value.keys()
            and all(_agree(told[key], value[key], tolerance) for key in value)
        )
    if value is None or isinstance(told, bool) or not isinstance(told, int | float):
        return told is value
    return bool(abs(told - value) <= tolerance * abs(value) + 1e-12) or (told != told and value != value)
