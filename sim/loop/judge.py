"""Who walked, how far, and who fell: steps and falls judged from the truth, in one place."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from controller.common.compiled import compiled
from sim.interface import LEGS, LINKS, Rows
from sim.loop.outcome import FallReason, Outcome

GRAZE = 1e-6  # [m]; what a foot at rest on compliant ground sinks in, and more than rounding
SETTLING = 0.02  # [s] after an impact, in which contact forces are those of the impact
STEP_SHARE = 0.125  # of the leg: a quarter of a gait's usual step, which is half a leg
TRIP_SHARE = 0.00125  # of the leg: 1 mm for RABBIT, whose feet differ by 0.6 mm in height in the paper's x0-
HIP_SHARE = 0.5625  # of the leg; RABBIT's hip, 0.8 m above its foot when it stands upright, may sink to 0.45 m


@dataclass(frozen=True, slots=True, kw_only=True)
class FallCriteria:
    """When a run counts as a fall, and when a landing counts as a step.

    A foot that scuffs past the other touches the ground a little ahead of it, and a walker that tumbles forward
    does so with both feet in turn, ten times a second: neither is a step.

    The defaults are RABBIT's; `of_leg` scales them to another walker.

    Attributes:
        step_length: Least distance ahead of the stance foot at which a landing is a step in [m].
        hip_height: Least height of the hip above the lower foot in [m].
        torso_tilt: Largest absolute torso angle in [rad].
        stall_time: Longest time without a step in [s].
        scuff_depth: Deepest the swing foot may pass below the ground outside a landing in [m]; infinite where a scuff
            is reported and no fall.
    """

    step_length: float = 0.1
    hip_height: float = 0.45
    torso_tilt: float = 1.2
    stall_time: float = 2.0
    scuff_depth: float = math.inf

    @classmethod
    def of_leg(cls, length: float, *, trips: bool = False) -> "FallCriteria":
        """Criteria for a walker by its leg's nominal length in [m], the height of its hip when it stands upright.

        Args:
            length: Of the leg in [m].
            trips: Whether a swing foot that passes below the ground is a fall.
        """
        depth = TRIP_SHARE * length if trips else math.inf
        return cls(step_length=STEP_SHARE * length, hip_height=HIP_SHARE * length, scuff_depth=depth)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scuffing:
    """The swing foot below the ground without landing, which only a plant without contact allows for long.

    Attributes:
        depth: Largest depth outside landings in [m].
        ticks: Ticks spent below.
        ahead: Of these, ticks ahead of the stance foot.
    """

    depth: float = 0.0
    ticks: int = 0
    ahead: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchDown:
    """A completed step.

    Attributes:
        number: Counted from 1.
        t: Time of the touch-down in [s].
        duration: Step time in [s].
        length: From foot to foot along the ground's x axis in [m].
        foot: "left" or "right", the foot that landed.
    """

    number: int
    t: float
    duration: float
    length: float
    foot: str


LANDED, SCUFF_BEGAN, SCUFF_ENDED, ENDED = 1, 2, 4, 8
"""What a look finds, a bit each; 0 when there is nothing to tell."""

COMPLETED, TIME_OVER, BODY_CONTACT, TRIPPED, HIP_LOW, TORSO_TILT, STALLED = range(7)
"""Why a run ends."""

WORK = np.dtype(
    [
        *((name, float) for name in ("step_length", "hip_height", "torso_tilt", "stall_time", "scuff_depth")),
        ("steps_asked", np.int64),
        ("end_time", float),  # [s]
        ("steps", np.int64),  # completed
        ("stance", np.int64),  # row of the foot that stands
        ("last_impact", float),  # [s]
        ("duration", float),  # [s] of the last step
        ("length", float),  # [m] of the last step
        ("depth", float),  # [m] of the swing foot in the ground now
        ("ahead", float),  # [m] of the swing foot before the stance foot now
        ("height", float),  # [m] of the hip above the lower foot now
        ("scuffs", np.int64),  # ticks of the present scuff, 0 where there is none
        ("deepest", float),  # [m] of the present or last scuff
        ("lasted", np.int64),  # [ticks] the last scuff
        ("scuff_most", float),  # [m] over the run
        ("scuff_ticks", np.int64),  # of the run
        ("scuff_ahead", np.int64),  # of these, ahead of the stance foot
        ("reason", np.int64),  # why the run ends
    ],
    align=True,
)
"""What a run is judged by, and the walk so far."""


@compiled
def look(work: Any, state: Any, judged: Any, i: int) -> int:
    """Judge the truth in row `i` and fill that row of `judged`; what there is to tell."""
    w, s, out = work[0], state[i], judged[i]
    found = 0
    stance = w.stance
    swing = 1 - stance
    if s.contact[swing] != 0:
        length = s.foot[swing, 0] - s.foot[stance, 0]
        if not length < w.step_length:
            w.stance, stance, swing = swing, swing, stance
            w.steps += 1
            w.duration, w.length, w.last_impact = s.t - w.last_impact, length, s.t
            found |= LANDED
    settled = s.t - w.last_impact > SETTLING
    # A landing is the time until contact forces are those of walking: the foot behind is then leaving the ground. A
    # stance foot without contact below the ground counts, too: the plant has exchanged the feet on a landing too
    # short for a step.
    w.depth = 0.0
    w.ahead = s.foot[swing, 0] - s.foot[stance, 0]
    if settled:
        w.depth = -s.clearance[swing]
        if s.contact[stance] == 0 and -s.clearance[stance] > w.depth:
            w.depth = -s.clearance[stance]
    if w.depth > GRAZE:
        if w.scuffs == 0:
            w.deepest = 0.0
            found |= SCUFF_BEGAN
        w.scuffs += 1
        w.deepest, w.scuff_most = max(w.deepest, w.depth), max(w.scuff_most, w.depth)
        w.scuff_ticks += 1
        if w.ahead > 0.0:
            w.scuff_ahead += 1
    elif w.scuffs > 0:
        w.lasted, w.scuffs = w.scuffs, 0
        found |= SCUFF_ENDED
    touching = 0
    for link in range(s.penetrating.shape[0]):
        touching += s.penetrating[link]
    low = s.foot[0, 1]
    if s.foot[1, 1] < low:
        low = s.foot[1, 1]
    w.height = s.hip[1] - low
    w.reason = -1
    if touching != 0:
        w.reason = BODY_CONTACT
    elif w.depth > w.scuff_depth:
        w.reason = TRIPPED
    elif w.height < w.hip_height:
        w.reason = HIP_LOW
    elif abs(s.q[4]) > w.torso_tilt:
        w.reason = TORSO_TILT
    elif s.t - w.last_impact > w.stall_time:
        w.reason = STALLED
    elif w.steps >= w.steps_asked:
        w.reason = COMPLETED
    elif s.t >= w.end_time:
        w.reason = TIME_OVER
    if w.reason >= 0:
        found |= ENDED
    out.steps, out.stance, out.last_impact, out.settled = w.steps, stance, w.last_impact, 1 if settled else 0
    return found


class Judge:
    """Counts steps and looks for falls, tick by tick.

    A step is completed when the swing foot touches the ground far enough ahead of the stance foot; the feet then
    change roles. What the controller believes plays no part.
    """

    def __init__(
        self, stance: str, criteria: FallCriteria | None = None, *, steps: int = 2**62, end_time: float = math.inf
    ) -> None:
        """Begin a run.

        Args:
            stance: The foot that stands at the start.
            criteria: When the run counts as a fall; RABBIT's by default.
            steps: Steps after which it is completed.
            end_time: Simulated time after which it ends anyway in [s].
        """
        self.criteria = criteria or FallCriteria()
        self.end_time = end_time
        self.work = work = np.zeros(1, WORK)
        for name, value in dataclasses.asdict(self.criteria).items():
            work[name] = value
        work["steps_asked"], work["end_time"], work["stance"] = steps, end_time, LEGS.index(stance)
        self._row = work[0]

    def look(self, state: Rows, judged: Rows, i: int) -> int:
        """Judge the truth in row `i` of `state`, and fill that row of `judged`; returns what there is to tell."""
        found: int = look(self.work, state, judged, i)
        return found

    @property
    def steps(self) -> int:
        """Steps completed."""
        return int(self._row["steps"])

    @property
    def stance(self) -> int:
        """Row of the stance foot in per-foot arrays."""
        return int(self._row["stance"])

    @property
    def last_impact(self) -> float:
        """Time of the last landing in [s]."""
        return float(self._row["last_impact"])

    @property
    def scuffing(self) -> Scuffing:
        """The swing foot below the ground so far."""
        row = self._row
        return Scuffing(depth=float(row["scuff_most"]), ticks=int(row["scuff_ticks"]), ahead=int(row["scuff_ahead"]))

    def touch_down(self) -> TouchDown:
        """The step just completed."""
        row = self._row
        return TouchDown(
            number=self.steps,
            t=self.last_impact,
            duration=float(row["duration"]),
            length=float(row["length"]),
            foot=LEGS[self.stance],
        )

    def scuff(self) -> str:
        """What to note of the scuff that has just begun or ended."""
        row = self._row
        if row["scuffs"]:
            return f"the swing foot passes below the ground, {row['ahead']:+.3f} m from the stance foot"
        return f"the swing foot is above the ground again: {1e3 * row['deepest']:.2f} mm deep, {row['lasted']} ticks"

    def end(self, state: np.void) -> tuple[Outcome, FallReason, str]:
        """How and why the run ends at a row of `STATE`, with the figures."""
        c, row = self.criteria, self._row
        deep = apart(1e3 * row["depth"], 1e3 * c.scuff_depth, 1)
        high, tilt = apart(row["height"], c.hip_height, 3), apart(state["q"][-1], c.torso_tilt, 2)
        falls = {
            BODY_CONTACT: (FallReason.BODY_CONTACT, ", ".join(np.array(LINKS)[state["penetrating"] != 0])),
            TRIPPED: (FallReason.TRIPPED, f"{deep} mm deep, at most {1e3 * c.scuff_depth:g} mm"),
            HIP_LOW: (FallReason.HIP_LOW, f"{high} m above the lower foot, least {c.hip_height:g} m"),
            TORSO_TILT: (FallReason.TORSO_TILT, f"{tilt} rad, at most {c.torso_tilt} rad"),
            STALLED: (FallReason.STALLED, f"{c.stall_time} s"),
            TIME_OVER: (FallReason.STALLED, f"time limit of {self.end_time} s"),
        }
        if row["reason"] == COMPLETED:
            return Outcome.COMPLETED, FallReason.NONE, ""
        return Outcome.FELL, *falls[int(row["reason"])]


def apart(value: float, limit: float, digits: int) -> str:
    """A figure beyond a limit with as many decimals as it takes not to look like the limit; `digits` at least."""
    while digits < 9 and round(abs(value), digits) == round(limit, digits):
        digits += 1
    return f"{value:.{digits}f}"
