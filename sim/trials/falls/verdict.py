"""What broke in a run that fell, from its ticks: the first symptom of those that last until the fall.

Once a walker falls everything goes wrong at once, so neither the last tick nor the worst figure of a run tells
why. A tick shows a symptom when the symptom held during enough of the `WINDOW` before it. Ticks with a symptom
are followed back from the fall to the last `GAP` without any: there the fall began, and the symptom seen first is
its cause. Symptoms that begin within `TOGETHER` count as one event, named by the order of `Cause`. Undisturbed
walks show none.

What lies between the two worlds is judged first, over all the ticks there are: a motor that does not give what is
asked of it, observations or torques that come late, sensors that are off. Such a fault is there before any symptom
and is found by comparing what was asked with what was applied, and what was seen with what was; settings are not
looked at. Where it is too small to matter by itself (`WEAK`, `BEHIND`, `OFF`) the symptoms decide.
"""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interface import JOINTS, Vector
from sim.trials.falls.cause import Cause, Evidence

WINDOW = 0.04  # [s]
GAP = 0.12  # [s], about a quarter of a step
TOGETHER = 0.02  # [s]

WIDTH = 33  # numbers of a tick, columns as `_Ticks` takes them

AT_LIMIT = 0.999  # share of a joint's limit at which it counts as saturated
SLIDING = 0.1  # [m/s] of a foot along the ground; a stance foot at rest creeps by less than a hundredth of it
TOUCHED_DOWN = 0.06  # [s] after a landing in which the foot behind may still touch the ground
OVERDUE = 0.01  # [s]; undisturbed predictions are right to a tick, those in stages of 6 ms to a stage
STANDING = 0.1  # [rad/s] of the clock; the gait's is 0.9 and above
OVERRUN = 1.05  # of the normalised clock; the foot lands at 1
OFF_TRACK = 0.2  # [rad] of the largest output
SUNK = 1e-3  # [m] of a foot below the ground at the start; the gait's own start has 0.6 mm
AT_ONCE = 0.1  # [s] within which a foot that began in the ground explains a fall
EARLY = 0.85  # of the normalised clock, below which a landing is too early
STUCK = 1.5  # [s] without a step
SOON = 1.0  # [s] after the start within which a fall can be that of a foot that began in the ground

WEAK = 0.6  # part of the torque asked for that a joint gets, below which its motor counts as failing
ASKED = 3.0  # [N.m] RMS that has to be asked of a joint before its motor can be judged
BEHIND = 8e-3  # [s] by which observations and torques together may come late
LATEST = 0.06  # [s], longest delay looked for
OFF = 0.03  # [rad] of a measured angle on the mean
FEWEST = 40  # ticks from which on faults between the worlds can be judged

SHARES = {
    Cause.TRIP: 0.05,
    Cause.SLIP: 0.25,
    Cause.FLIGHT: 0.75,
    Cause.STALL: 0.75,
    Cause.LATE: 0.0,
    Cause.OVERRUN: 0.0,
    Cause.EARLY: 0.0,
    Cause.TORQUE: 0.75,
    Cause.SOLVER: 0.75,
    Cause.TRACKING: 0.5,
}
"""Share of the `WINDOW` during which a symptom has to hold; a foot that trips touches the ground for a moment."""


def verdict(rows: Vector, sunk: float, period: float, limits: Vector) -> tuple[Cause, Evidence]:
    """What broke, from the ticks before a fall.

    Args:
        rows: A tick a row, (n, `WIDTH`), from the last seconds before the fall.
        sunk: Depth of the lower foot in the ground at the start of the run in [m].
        period: Of the ticks in [s].
        limits: Largest torques of the joints in [N.m], (4,).
    """
    ticks = _Ticks(rows, period, np.asarray(limits))
    began, cause = ticks.beginning()
    between = ticks.between()
    found = ticks.evidence(began, sunk) if between is None else ticks.evidence(began, sunk, between)
    if between is not None and (fault := between.fault()):
        cause = fault
    if sunk > SUNK and len(rows) and found.began_s < AT_ONCE and found.began_s + found.lasted_s < SOON:
        cause = Cause.START
    return cause, found


@dataclass(frozen=True, slots=True, kw_only=True)
class _Between:
    """What lies between the two worlds; attributes as in `Evidence`."""

    weak_joint: str
    given: float
    measured_late_s: float
    applied_late_s: float
    sensor_error_rad: float

    def fault(self) -> Cause | None:
        """The fault that is large enough to explain a fall, None if none is."""
        if self.given < WEAK:
            return Cause.ACTUATOR
        if self.measured_late_s + self.applied_late_s > BEHIND:
            return Cause.DELAY
        return Cause.SENSOR if self.sensor_error_rad > OFF else None


class _Ticks:
    """The ticks as arrays, (n,) each."""

    def __init__(self, rows: Vector, period: float, limits: Vector) -> None:
        self.t, stance, landed, due, self.s, self.clock, fallback, left, right, foot = rows[:, :10].T
        torque, y = rows[:, 10:14].T, rows[:, 14:18]
        self.torque = torque.T
        self.commanded = rows[:, 18:22]
        self.asked = np.clip(self.commanded, -limits, limits)  # (n, 4), what the plant would let through
        self.rates, self.errors = rows[:, 22:27], rows[:, 27:32]  # (n, 5)
        self.landed_s = rows[:, 32]
        self.period = period
        self.stance, self.fallback = stance.astype(int), fallback > 0.0
        self.since, self.late = self.t - landed, self.t - due  # [s]
        self.touches = np.array((left, right)) > 0.0  # (2, n)
        self.saturated = np.abs(torque) >= AT_LIMIT * limits[:, None]  # (4, n)
        self.output = np.abs(y).max(axis=1, initial=0.0)
        stands, swings = self._of(self.stance), self._of(1 - self.stance)
        moved = np.abs(np.diff(foot, prepend=foot[:1]))
        same = np.diff(self.stance, prepend=self.stance[:1]) == 0
        settled = self.since > TOGETHER  # forces and motion of the landing itself are over
        self.slid = np.where(stands & same & settled, moved, 0.0)  # [m] in each tick
        self.scuffs = swings & (self.since > TOUCHED_DOWN)

    def _of(self, foot: Vector) -> NDArray[np.bool_]:
        found: NDArray[np.bool_] = np.where(foot == 0, self.touches[0], self.touches[1])
        return found

    def symptoms(self) -> dict[Cause, NDArray[np.bool_]]:
        """Whether each symptom has held for its share of the window before each tick, (n,) each."""
        now = {
            Cause.TRIP: self.scuffs,
            Cause.SLIP: self.slid > SLIDING * self.period,
            Cause.FLIGHT: ~self.touches.any(axis=0),
            Cause.STALL: self.clock < STANDING,
            Cause.LATE: self.late > OVERDUE,
            Cause.OVERRUN: self.s > OVERRUN,
            Cause.EARLY: (self.since < TOGETHER) & (self.landed_s < EARLY),
            Cause.TORQUE: self.saturated.any(axis=0),
            Cause.SOLVER: self.fallback,
            Cause.TRACKING: self.output > OFF_TRACK,
        }
        width = max(1, round(WINDOW / self.period))
        held = {}
        for cause, one in now.items():
            total = np.concatenate((np.zeros(width), np.cumsum(one)))
            held[cause] = total[width:] - total[:-width] >= max(1.0, SHARES[cause] * width)
        return held

    def beginning(self) -> tuple[int, Cause]:
        """Tick at which the fall began, and its cause."""
        symptoms = self.symptoms()
        n = len(self.t)
        shows = np.flatnonzero(np.logical_or.reduce(list(symptoms.values()))) if n else np.empty(0, dtype=int)
        gap = round(GAP / self.period)
        if not len(shows) or n - 1 - shows[-1] > gap:
            if n and self.since[-1] > STUCK:
                return int(self.clock.argmin()), Cause.STALL
            return max(0, n - 1 - gap), Cause.UNCLEAR
        breaks = np.flatnonzero(np.diff(shows) > gap)
        began = int(shows[breaks[-1] + 1] if len(breaks) else shows[0])
        soon = slice(began, began + max(1, round(TOGETHER / self.period)))
        return began, next(cause for cause, held in symptoms.items() if held[soon].any())

    def between(self) -> _Between | None:
        """Faults between the worlds, from all ticks; None where they are too few."""
        calm = np.isfinite(self.rates).all(axis=1) & np.isfinite(self.errors).all(axis=1)
        calm &= np.isfinite(self.asked).all(axis=1) & np.isfinite(self.torque).all(axis=1)
        if calm.sum() < FEWEST or not calm.all():
            return None
        # A reading that is late by tau is off by -rate * tau, and a bias is off by itself: least squares for both.
        rates = self.rates - self.rates.mean(axis=0)
        power = float((rates**2).sum())
        late = -float((rates * self.errors).sum()) / power if power > 0.0 else 0.0
        off = (self.errors + late * self.rates).mean(axis=0)
        lag = self._lag()
        asked, given = self.asked[: len(self.asked) - lag - 1], self.torque[lag + 1 :]
        size = np.sqrt((asked**2).mean(axis=0))
        part = (asked * given).sum(axis=0) / np.maximum((asked**2).sum(axis=0), 1e-9)
        part = np.where(size > ASKED, np.clip(part, 0.0, 1.0), 1.0)
        weak = int(part.argmin())
        return _Between(
            weak_joint=JOINTS[weak].replace("_", " ") if part[weak] < 1.0 else "",
            given=float(part[weak]),
            measured_late_s=max(0.0, late),
            applied_late_s=lag * self.period,
            sensor_error_rad=float(np.abs(off).max()),
        )

    def _lag(self) -> int:
        """Ticks by which the torque follows the command best; 0 where nothing tells them apart."""
        most = min(round(LATEST / self.period), len(self.asked) // 4)
        n = len(self.asked) - most - 1
        given = self.torque[most + 1 :]
        misses = [float(((given - self.asked[most - lag : most - lag + n]) ** 2).sum()) for lag in range(most + 1)]
        best = int(np.argmin(misses))
        return best if misses[best] < 0.5 * misses[0] else 0

    def evidence(self, began: int, sunk: float, between: _Between | None = None) -> Evidence:
        """The figures around the beginning of a fall."""
        if not len(self.t):
            nan = math.nan
            return Evidence(
                began_s=0.0, lasted_s=0.0, torque_share=nan, joint="", flight_share=nan, slip_m=nan, scuff_s=nan,
                clock_min_rad_s=nan, clock_max_rad_s=nan, late_s=nan, s_max=nan, output_max_rad=nan, fallback_share=nan,
                sunk_m=sunk,
            )  # fmt: skip
        part = slice(max(0, began - round(WINDOW / self.period)), began + round(WINDOW / self.period) + 1)
        at_limit = self.saturated[:, part]
        longest = int(at_limit.sum(axis=1).argmax())
        standing = np.flatnonzero(self.touches[:, : began + 1].any(axis=0))
        off = min(int(standing[-1]) + 1 if len(standing) else 0, len(self.t) - 1)
        return Evidence(
            began_s=float(self.t[began]),
            lasted_s=float(self.t[-1] - self.t[began]),
            torque_share=float(at_limit.any(axis=0).mean()),
            joint=JOINTS[longest].replace("_", " ") if at_limit[longest].any() else "",
            flight_share=float((~self.touches[:, part].any(axis=0)).mean()),
            slip_m=float(self.slid[part].sum()),
            scuff_s=float(self.scuffs[part].sum() * self.period),
            clock_min_rad_s=float(self.clock[part].min()),
            clock_max_rad_s=float(self.clock[part].max()),
            late_s=max(0.0, float(self.late[part].max())),
            s_max=float(self.s[part].max()),
            output_max_rad=float(self.output[part].max()),
            fallback_share=float(self.fallback[part].mean()),
            sunk_m=sunk,
            landed_s=float(self.landed_s[part].min()),
            off_s=float(self.t[off]),
            asked_Nm=float(np.abs(self.commanded[began:]).max()),
            **(dataclasses.asdict(between) if between else {}),
        )
