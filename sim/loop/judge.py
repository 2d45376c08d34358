"""Who walked, how far, and who fell: steps and falls judged from the truth, in one place."""

import math
from dataclasses import dataclass

from sim.interface import PlantState
from sim.loop.outcome import FallReason
from sim.loop.scuff import Scuffing

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


class Judge:
    """Counts steps and looks for falls, tick by tick.

    A step is completed when the swing foot touches the ground far enough ahead of the stance foot; the feet then
    change roles. What the controller believes plays no part.
    """

    def __init__(self, stance: str, criteria: FallCriteria | None = None) -> None:
        """Args: stance: the foot that stands at the start; criteria: when a run counts as a fall."""
        self.criteria = criteria or FallCriteria()
        self.steps = 0
        self.last_impact = 0.0  # [s]
        self.scuffing = Scuffing()
        self._depth = 0.0  # [m] of the swing foot in the ground now
        self._stance = ("left", "right").index(stance)

    @property
    def stance(self) -> int:
        """Row of the stance foot in per-foot arrays."""
        return self._stance

    def settled(self, t: float) -> bool:
        """Whether the last impact is over long enough for contact forces to be those of walking."""
        return t - self.last_impact > SETTLING

    def touch_down(self, state: PlantState) -> TouchDown | None:
        """The step that this state completes, if it does."""
        swing = 1 - self._stance
        if not state.contact[swing]:
            return None
        length = float(state.foot[swing, 0] - state.foot[self._stance, 0])
        if length < self.criteria.step_length:
            return None
        self._stance = swing
        self.steps += 1
        duration, self.last_impact = state.t - self.last_impact, state.t
        return TouchDown(number=self.steps, t=state.t, duration=duration, length=length, foot=("left", "right")[swing])

    def scuff(self, state: PlantState) -> str:
        """Take in how deep the swing foot is in the ground outside a landing; returns what to note in the log.

        A landing is the time until contact forces are those of walking (`settled`): the foot behind is then leaving
        the ground. A stance foot without contact below the ground counts, too: the plant has exchanged the feet on a
        landing too short for a step.
        """
        self._depth = 0.0
        if not self.settled(state.t):
            return self.scuffing.look(0.0, 0.0)
        stance, swing = self._stance, 1 - self._stance
        self._depth = -float(state.clearance[swing])
        if not state.contact[stance]:
            self._depth = max(self._depth, -float(state.clearance[stance]))
        return self.scuffing.look(self._depth, float(state.foot[swing, 0] - state.foot[stance, 0]))

    def fall(self, state: PlantState) -> tuple[FallReason, str]:
        """Reason for a fall and its figures; `FallReason.NONE` while the walker stands."""
        c = self.criteria
        height = float(state.hip[1] - min(state.foot[0, 1], state.foot[1, 1]))
        tilt = float(state.q[-1])
        if state.penetrating:
            return FallReason.BODY_CONTACT, ", ".join(state.penetrating)
        if self._depth > c.scuff_depth:
            return FallReason.TRIPPED, f"{1e3 * self._depth:.1f} mm deep, at most {1e3 * c.scuff_depth:g} mm"
        if height < c.hip_height:
            return FallReason.HIP_LOW, f"{height:.3f} m above the lower foot, least {c.hip_height:g} m"
        if abs(tilt) > c.torso_tilt:
            return FallReason.TORSO_TILT, f"{tilt:.2f} rad, at most {c.torso_tilt} rad"
        if state.t - self.last_impact > c.stall_time:
            return FallReason.STALLED, f"{c.stall_time} s"
        return FallReason.NONE, ""
