"""What the review page plots, worked out from a log at every tick."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.errors import UserError
from sim.interface import COORDINATES, JOINTS, LEGS
from sim.log.format.fields import DIAGNOSTICS, OUTPUTS
from sim.log.read.frames import Run

Column = NDArray[np.float64]
LEAST_NORMAL = 5.0  # [N]; below it the foot hardly touches, and a friction ratio says nothing
STATE, CONTROL, MPC, ERROR, TIMING = "/plant/state", "/control", "/mpc", "/prediction/error", "/timing"
TOPICS = (STATE, CONTROL, MPC, ERROR, TIMING, DIAGNOSTICS)
MOST_DIAGNOSTICS = 100


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signals:
    """Every plotted signal of a run on one time axis.

    Attributes:
        tick: Ticks, (n,).
        t: Time in [s], (n,).
        columns: Key -> values, (n,), NaN where there are none; units are those of `sim.review.panels`.
        impacts: Ticks of the touch-downs.
    """

    tick: NDArray[np.int64]
    t: Column
    columns: dict[str, Column]
    impacts: NDArray[np.int64]


def signals_of(run: Run) -> Signals:
    """Work out the signals of a run.

    Raises:
        UserError: it has no tick of plant and controller.
    """
    frames = {topic: run.frames[topic] for topic in TOPICS if topic in run.frames}
    if STATE not in frames or CONTROL not in frames:
        raise UserError(f"{run.log.path}: needs the channels {STATE} and {CONTROL}")
    tick = np.intersect1d(frames[STATE].tick, frames[CONTROL].tick)
    if not tick.size:
        raise UserError(f"{run.log.path}: has no tick to show")
    rows = {topic: np.searchsorted(frame.tick, tick) for topic, frame in frames.items()}

    def column(topic: str, name: str) -> Column:
        if topic not in frames or name not in frames[topic] or not len(frames[topic].tick):
            return np.full(len(tick), np.nan)
        frame = frames[topic]
        at = np.minimum(rows[topic], len(frame.tick) - 1)
        values = frame[name].astype(np.float64)[at]
        values[frame.tick[at] != tick] = np.nan
        return values

    found = _plain(column)
    found |= {f"diagnostics.{name}": column(DIAGNOSTICS, name) for name in diagnostics_units(run)}
    t = frames[STATE].t[np.minimum(rows[STATE], len(frames[STATE].tick) - 1)]
    impacts = np.array([tick[np.argmin(np.abs(t - e.t))] for e in run.events if e.name == "impact"], np.int64)
    found |= _forces(column)
    found["impact_error"] = _impact_error(tick, column(CONTROL, "impact_in"), impacts, t)
    with np.errstate(over="ignore"):  # what a double holds and a float32 does not is as good as infinite
        columns = {key: np.where(np.abs(v) < 1e30, v, np.nan) for key, v in found.items()}
    return Signals(tick=tick, t=t, columns=columns, impacts=impacts)


def diagnostics_units(run: Run) -> dict[str, str]:
    """Units of the controller's own figures by their names; none where there are no figures."""
    if DIAGNOSTICS not in run.frames:
        return {}
    units = run.log.units(DIAGNOSTICS)
    names = [name for name in run.frames[DIAGNOSTICS] if not name.startswith("_")][:MOST_DIAGNOSTICS]
    return {name: units.get(name, "1") for name in names}


def _plain(column: Any) -> dict[str, Column]:
    found = {}
    for joint in JOINTS:
        found[f"u_zd.{joint}"] = column(CONTROL, f"u_zd.{joint}")
        found[f"u_mpc.{joint}"] = column(CONTROL, f"u_mpc.{joint}")
        found[f"torque.{joint}"] = column(STATE, f"torque.{joint}")
    for output in OUTPUTS:
        found[f"y.{output}"] = column(CONTROL, f"y.{output}")
        found[f"dy.{output}"] = column(CONTROL, f"dy.{output}")
    for name in ("theta", "dtheta", "s"):
        found[name] = column(CONTROL, name)
    for name in COORDINATES:
        found[f"q.{name}"] = column(STATE, f"q.{name}")
        found[f"dq.{name}"] = column(STATE, f"dq.{name}")
    for leg in LEGS:
        found[f"foot.{leg}.x"] = column(STATE, f"foot.{leg}.x")
        found[f"clearance.{leg}"] = 1e3 * column(STATE, f"clearance.{leg}")
        for axis in ("normal", "tangential"):
            found[f"force.{leg}.{axis}"] = column(STATE, f"contact_force.{leg}.{axis}")
    found |= {f"hip.{axis}": column(STATE, f"hip.{axis}") for axis in "xz"}
    found |= {
        "speed": column(STATE, "dhip.x"),
        "push.x": column(STATE, "push.x"),
        "push.z": column(STATE, "push.z"),
    }
    found |= {f"error.{axis}": column(ERROR, f"contact_force.{axis}") for axis in ("normal", "tangential")}
    found |= {name: column(MPC, name) for name in ("active", "iterations", "slack")}
    found |= {name: 1e3 * column(TIMING, name) for name in ("solve", "tick")}
    found["stance"] = column(CONTROL, "stance")
    return found


def _forces(column: Any) -> dict[str, Column]:
    """Friction ratio of the stance foot, and what the controller had expected of the hold that just ended."""
    right = column(CONTROL, "stance") == 1
    normal, tangential = (
        np.where(right, column(STATE, f"contact_force.right.{axis}"), column(STATE, f"contact_force.left.{axis}"))
        for axis in ("normal", "tangential")
    )
    wanted_n, wanted_t = (_later(column(CONTROL, f"contact_force.{axis}")) for axis in ("normal", "tangential"))
    return {
        "ratio": _ratio(tangential, normal),
        "ratio.expected": _ratio(wanted_t, wanted_n),
        "expected.normal": wanted_n,
        "expected.tangential": wanted_t,
    }


def _later(values: Column) -> Column:
    """What a tick expects of its hold, where the plant's answer stands: one tick later."""
    return np.concatenate((np.full(min(1, len(values)), np.nan), values[:-1]))


def _ratio(tangential: Column, normal: Column) -> Column:
    with np.errstate(all="ignore"):
        return np.where(normal > LEAST_NORMAL, np.abs(tangential) / normal, np.nan)


def _impact_error(tick: NDArray[np.int64], ahead: Column, impacts: NDArray[np.int64], t: Column) -> Column:
    """Predicted time of the next impact minus the real one in [ms]; NaN where none is predicted or comes."""
    error = np.full(len(tick), np.nan)
    if impacts.size and len(t) > 1 and tick[-1] > tick[0]:
        nth = np.searchsorted(impacts, tick, side="right")
        real = np.append(impacts.astype(float), np.nan)[nth]
        period_ms = 1e3 * (t[-1] - t[0]) / float(tick[-1] - tick[0])
        seen = ahead > 0
        error[seen] = (tick[seen] + ahead[seen] - real[seen]) * period_ms
    return error


def difference(a: Signals, b: Signals) -> Signals:
    """B minus A at the ticks both have."""
    tick, in_a, in_b = np.intersect1d(a.tick, b.tick, return_indices=True)
    both = a.columns.keys() & b.columns.keys()  # figures of one controller's own have no difference
    columns = {key: b.columns[key][in_b] - a.columns[key][in_a] for key in a.columns if key in both}
    return Signals(tick=tick, t=a.t[in_a], columns=columns, impacts=a.impacts)


def decimated(signals: Signals, most: int) -> tuple[Column, dict[str, Column]]:
    """At most `most` samples a signal; a bucket of ticks keeps its least and its largest value.

    Args:
        signals: Every tick.
        most: Samples, an even number.

    Returns:
        Times in [s] and columns, all of one length.
    """
    n = len(signals.t)
    if n <= most:
        return signals.t, signals.columns
    edges = np.linspace(0, n, most // 2 + 1).astype(np.int64)
    starts, ends = edges[:-1], edges[1:] - 1
    t = np.column_stack((signals.t[starts], signals.t[ends])).ravel()
    return t, {key: _buckets(values, starts, ends) for key, values in signals.columns.items()}


def _buckets(values: Column, starts: NDArray[np.int64], ends: NDArray[np.int64]) -> Column:
    low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
    falling = values[ends] < values[starts]
    return np.column_stack((np.where(falling, high, low), np.where(falling, low, high))).ravel()
