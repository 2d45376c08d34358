"""What may be asked: how much of which disturbance, and under what bounds; and what is answered."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from controller.belief import Gait, WalkerModel
from controller.common.errors import UserError
from controller.limit.walk import Bounds, Kind, Motion, Phase

APART = 0.1  # of the value, up to which meshes agree about it
MOST_STEPS, MOST_INTERVALS, MOST_STARTS = 12, 100, 100  # a program with all of it takes hours
IMPULSE_TIME = 0.01  # [s] over which an impulse is delivered, as in a scenario


class Interrupted(Exception):
    """The user asked to stop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A disturbance that can be maximised.

    Attributes:
        kind: What it is to the program.
        sign: Which way.
        unit: Of the answer.
        words: What it is.
        free: Whether any periodic walk will do; else the walk starts and ends on the gait.
    """

    kind: Kind
    sign: float
    unit: str
    words: str
    free: bool = False


AXES = {
    "push-back": Axis(kind="push", sign=-1.0, unit="N", words="force on the torso, backward"),
    "push-forward": Axis(kind="push", sign=1.0, unit="N", words="force on the torso, forward"),
    "impulse-back": Axis(kind="push", sign=-1.0, unit="N.s", words="impulse on the torso, backward"),
    "impulse-forward": Axis(kind="push", sign=1.0, unit="N.s", words="impulse on the torso, forward"),
    "slope-down": Axis(kind="slope", sign=-1.0, unit="rad", words="constant slope, downhill", free=True),
    "slope-up": Axis(kind="slope", sign=1.0, unit="rad", words="constant slope, uphill", free=True),
    "step-down": Axis(kind="ledge", sign=-1.0, unit="m", words="step down, its place chosen"),
    "step-up": Axis(kind="ledge", sign=1.0, unit="m", words="step up, its place chosen"),
    "load": Axis(kind="load", sign=1.0, unit="ratio", words="factor on the torso's mass and inertia"),
    "friction": Axis(kind="friction", sign=-1.0, unit="ratio", words="least friction of the ground", free=True),
}
"""By name."""


def usual_step(axis: str) -> int:
    """Step that an axis is asked about unless another is named."""
    return 2 if axis in AXES and AXES[axis].kind == "ledge" else 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """How much of a disturbance can be survived.

    Attributes:
        axis: Name of one of `AXES`.
        step: Step throughout which it pushes, at whose start the impulse comes, or that lands behind the ledge.
        seconds: Duration of the push from the start in [s]; None for that of the step.
        steps: Of the walk, which ends in the gait's state before impact.
        friction: Of the ground.
        longest: Longest step in [s].
        torso: Largest angle of the torso in [rad].
        intervals: Collocation intervals of a step, coarse to fine.
        starts: Guesses tried on the coarsest.
        blind: How long a controller does what it does without knowing of the push in [s].
        controller: Which, where `blind` is above 0.
    """

    axis: str
    step: int = 1
    seconds: float | None = None
    steps: int = 3
    friction: float = 0.8
    longest: float = 1.0
    torso: float = 1.0
    intervals: tuple[int, ...] = (10, 14, 20)
    starts: int = 3
    blind: float = 0.0
    controller: str = ""

    @property
    def what(self) -> Axis:
        """The axis."""
        return AXES[self.axis]

    def searched_as(self, row: dict[str, Any]) -> bool:
        """Whether a row of a file of limits was found on these meshes, from as many guesses."""
        try:
            meshes = row.get("intervals", [intervals for intervals, _ in row.get("meshes", ())])
            return (tuple(meshes), len(row.get("starts", ()))) == (self.intervals, self.starts)
        except (TypeError, ValueError):  # a row from elsewhere, which has no lists there
            return False

    @property
    def pushed_time(self) -> float | None:
        """Duration of the push in [s], None for that of a step."""
        return IMPULSE_TIME if self.axis.startswith("impulse") else self.seconds

    def value(self, disturbance: float) -> float:
        """The answer in its unit from the program's variable."""
        if self.axis.startswith("impulse"):
            return disturbance * IMPULSE_TIME
        return float(np.arctan(disturbance)) if self.what.kind == "slope" else disturbance

    def key(self) -> dict[str, Any]:
        """What a row in a file of limits answers."""
        found: dict[str, Any] = {
            "axis": self.axis,
            "step": self.step,
            "friction": self.friction,
            "longest_step": self.longest,
            "torso": self.torso,
            "steps": self.steps,
        }
        if self.seconds is not None:
            found["seconds"] = self.seconds
        if self.blind:
            found |= {"blind": self.blind, "controller": self.controller}
        return found

    def words(self) -> str:
        """The question in words."""
        when = ""
        if self.what.kind == "push":
            when = f" through step {self.step}"
            if self.axis.startswith("impulse"):
                when = f" at the start of step {self.step}"
            elif self.seconds is not None:
                when = f" for {self.seconds:g} s"
        elif self.what.kind == "ledge":
            when = f" in step {self.step}"
        blind = f", {1e3 * self.blind:g} ms of {self.controller} first" if self.blind else ""
        return f"{self.what.words}{when}{blind}"

    def bounds(self, model: WalkerModel, gait: Gait) -> Bounds:
        """What the walk must keep; lengths in the proportion of RABBIT's leg of 0.8 m."""
        legs = model.leg_length / 0.8
        knee = float(np.sign(gait.alpha[2:].mean())) or -1.0
        return Bounds(
            torque=np.asarray(model.torque_limits, dtype=float),
            friction=self.friction,
            torso=self.torso,
            hip=0.5 * legs,
            length=(0.1 * legs, 0.7 * legs),
            time=(0.15, self.longest),
            knee=knee,
        )

    def walks(self, intervals: int) -> list[tuple[Phase, ...]]:
        """Structures of the walk, to be tried one by one: in which step a push of a given time ends."""
        whole, pushed_time = Phase(intervals=intervals), self.pushed_time
        if self.what.free:
            return [(whole,)]
        if self.what.kind != "push":
            return [(whole,) * self.steps]
        if pushed_time is None:
            return [tuple(Phase(intervals=intervals, pushed=i + 1 == self.step) for i in range(self.steps))]
        found = []
        ends = range(self.step, min(self.steps, self.step + 1 + int(pushed_time / 0.15)) + 1)
        for end in ends:
            if not (end - self.step) * 0.15 < pushed_time <= (end - self.step + 1) * self.longest:
                continue
            share = 3 if pushed_time < 0.05 else max(3, round(0.6 * intervals))
            phases = [whole] * (self.step - 1)
            phases += [Phase(intervals=intervals, pushed=True)] * (end - self.step)
            phases += [Phase(intervals=share, pushed=True, lands=False), whole] + [whole] * (self.steps - end)
            found.append(tuple(phases))
        return found

    def check(self) -> None:
        """Refuse what cannot be asked.

        Raises:
            UserError: in one line.
        """
        if self.axis not in AXES:
            raise UserError(f"{self.axis}: is no axis of cmpc limit; must be one of {', '.join(AXES)}")
        meshes = self.intervals or (0,)
        if not (1 <= self.starts <= MOST_STARTS and 4 <= min(meshes) and max(meshes) <= MOST_INTERVALS):
            raise UserError(
                f"--starts {self.starts}, --intervals {' '.join(map(str, self.intervals))}: must be from 1 to "
                f"{MOST_STARTS}, and one or more whole numbers from 4 to {MOST_INTERVALS}: the programs grow with them"
            )
        if not 1 <= self.steps <= MOST_STEPS:
            raise UserError(f"--steps {self.steps}: must be from 1 to {MOST_STEPS}: the program grows with them")
        if not (0.0 < self.friction <= 10.0 and 0.0 < self.torso <= 1.5 and 0.0 <= self.blind <= 1.0):
            raise UserError(
                f"--friction {self.friction:g}, --torso {self.torso:g} rad, --blind {self.blind:g} s: must be above 0 "
                "and at most 10, above 0 and at most 1.5 rad, from 0 to 1 s"
            )
        if self.step != usual_step(self.axis) and self.what.kind not in ("push", "ledge"):
            raise UserError(
                f"--step {self.step}: says which step is pushed, or lands behind the ledge; {self.axis} has none"
            )
        if not 1 <= self.step <= self.steps:
            raise UserError(f"--step {self.step}: must be from 1 to --steps, {self.steps}")
        if self.seconds is not None and not 0.02 <= self.seconds <= (self.steps - self.step + 1) * self.longest:
            most = (self.steps - self.step + 1) * self.longest
            raise UserError(f"--for {self.seconds:g} s: must be between 0.02 and {most:g} s, the walk's longest time")
        if self.seconds is not None and not self.axis.startswith("push"):
            raise UserError(f"--for: says how long a push lasts; {self.axis} has no duration")
        if self.blind and (self.what.kind != "push" or self.step != 1 or self.pushed_time is not None):
            raise UserError(f"--blind: needs a push through step 1; not {self.words()}")
        if bool(self.controller) != bool(self.blind):
            raise UserError(
                f"--controller {self.controller or 'none'}, --blind {self.blind:g} s: are who walks without knowing, "
                "and for how long; must be both or neither"
            )
        if not 0.15 < self.longest <= 5.0:
            raise UserError(f"--longest-step {self.longest:g} s: must be above 0.15 and up to 5 s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What was found: local optima, proofs in neither direction.

    Attributes:
        question: What was asked.
        value: The answer on the finest mesh, in the axis' unit.
        meshes: Intervals a step -> value.
        starts: What each guess led to on the coarsest mesh; None where no walk was found.
        at_bound: Whether the disturbance has run into the program's own bound and so means nothing.
        phases: Structure of the walk.
        motion: The walk.
        easy: The walk of least torque under nine tenths of a push, or a little less, which leaves something to hold on
            with; None if none was found.
        easy_phases: Its structure.
        fit: Largest error of the state after the blind time in [rad], [rad/s].
        replay: Time in [s] -> by how much the rigid plant under the walk's torques has left it in [rad].
    """

    question: Question
    value: float
    meshes: dict[int, float]
    starts: tuple[float | None, ...]
    at_bound: bool
    phases: tuple[Phase, ...]
    motion: Motion
    easy: Motion | None = None
    easy_phases: tuple[Phase, ...] = ()
    fit: float = 0.0
    replay: dict[str, float] = field(default_factory=dict)

    @property
    def spread(self) -> float:
        """Between the coarsest and the finest mesh, in the axis' unit."""
        values = list(self.meshes.values())
        return max(values) - min(values)

    @property
    def agree(self) -> int:
        """How many guesses led to within 1 % of the best."""
        known = [value for value in self.starts if value is not None]
        best = max(known, key=lambda value: value * self.question.what.sign)
        return sum(abs(value - best) <= 0.01 * abs(best) + 1e-9 for value in known)

    @property
    def sure(self) -> str:
        """How sure it is, in words."""
        if self.at_bound:
            return "no limit: the search ran into its own bound"
        if not self.trusted:
            return f"not to be trusted: {self._found}"
        return f"a local optimum: {self._found}"

    @property
    def trusted(self) -> bool:
        """Whether meshes agree about it, by the share `APART`; one mesh alone is believed."""
        return not self.at_bound and self.spread <= APART * abs(self.value)

    @property
    def _found(self) -> str:
        tried = len(self.starts)
        share = self.spread / max(abs(self.value), 1e-9)
        meshes = " -> ".join(f"{value:.4g}" for value in self.meshes.values())
        return (
            f"{self.agree} of {tried} starts lead there; meshes of "
            f"{', '.join(map(str, self.meshes))} intervals give {meshes} ({100 * share:.1f} % apart)"
        )

    def record(self) -> dict[str, Any]:
        """For a file of limits."""
        question = self.question
        found: dict[str, Any] = {
            **question.key(),
            "words": question.words(),
            "value": round(self.value, 6),
            "unit": question.what.unit,
            "at_bound": self.at_bound,
            "trusted": self.trusted,
            "sure": self.sure,
            "intervals": list(question.intervals),
            "meshes": [list(pair) for pair in self.meshes.items()],
            "starts": ["none" if value is None else f"{value:.4g}" for value in self.starts],
            "step_times": [round(t, 4) for t in self.step_times],
        }
        if question.blind:
            found["fit"] = self.fit
        if self.easy:
            found |= {"walked": round(question.value(self.easy.disturbance), 6), "replay": self.replay}
        return found

    @property
    def walked(self) -> tuple[Motion, tuple[Phase, ...]]:
        """The walk to be walked on a plant, and its structure."""
        return (self.easy, self.easy_phases) if self.easy else (self.motion, self.phases)

    @property
    def step_times(self) -> list[float]:
        """Of each step in [s]."""
        return times_of(self.motion, self.phases)


def times_of(motion: Motion, phases: tuple[Phase, ...]) -> list[float]:
    """Of each step of a walk in [s]."""
    times, whole = [], 0.0
    for phase, t in zip(phases, motion.times, strict=True):
        whole += t
        if phase.lands:
            times.append(whole)
            whole = 0.0
    return times
