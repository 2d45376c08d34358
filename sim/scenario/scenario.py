"""What happens in a run: walker, gait, controller, plant and its errors, sensors, motors, pushes, start, end.

A scenario is a tree of frozen dataclasses and the same tree as TOML. To add a setting, add a field with a
default, its unit and range in the annotation and a sentence in the docstring: the loader, the command line's
flags and help, and the log follow.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from controller.common.settings import ControllerSettings
from controller.common.units import (
    NOT_NEGATIVE,
    POSITIVE,
    Radian,
    Second,
    Unit,
    whole,
)
from sim.errors import UserError
from sim.scenario.plant import PlantSettings, whole_substeps
from sim.scenario.signals import ActuationSettings, SensorSettings
from sim.settings import tree as settings

Body = Literal["torso", "left_femur", "left_tibia", "right_femur", "right_tibia"]
Five = tuple[float, float, float, float, float]

MOST_STEPS = 1_000_000
TIME_PER_STEP = 2.0  # [s] of simulated time allowed for each step when no limit is given


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """An external force on one link: constant throughout a step or a window of time, or a short impulse.

    Attributes:
        force: Magnitude; negative pushes against the direction. Give this or an impulse.
        impulse: Force times time, delivered evenly over `duration` from the start of the step or from `start`.
        duration: Time over which an impulse is delivered.
        direction: Direction in the sagittal plane: 0 forward, pi/2 up.
        body: The link pushed.
        point: Point of attack (x, z) in the link's own frame; none for its centre of mass.
        step: The step throughout which the force acts, counted from 1; give this, or start and end.
        start: Time at which the force begins.
        end: Time at which it ends.
    """

    force: Annotated[float | None, Unit("N")] = None
    impulse: Annotated[float | None, Unit("N.s")] = None
    duration: Annotated[Second, POSITIVE] = 0.01
    direction: Radian = 0.0
    body: Body = "torso"
    point: Annotated[tuple[float, float] | None, Unit("m")] = None
    step: Annotated[int | None, Unit("step"), whole(1, MOST_STEPS)] = None
    start: Annotated[float | None, Unit("s"), NOT_NEGATIVE] = None
    end: Annotated[float | None, Unit("s"), POSITIVE] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StartSettings:
    """Offsets from the first state of the gait; angles ordered as `sim.interface.COORDINATES`.

    Attributes:
        torso_offset: Added to the torso angle alone: the whole walker is tilted about its stance foot.
        torso_lean: Tilts the torso on legs that stay as they are.
        q_offset: Added to the four joint angles and the torso angle.
        dq_offset: Added to their rates.
    """

    torso_offset: Radian = 0.0
    torso_lean: Radian = 0.0
    q_offset: Annotated[Five, Unit("rad")] = (0.0, 0.0, 0.0, 0.0, 0.0)
    dq_offset: Annotated[Five, Unit("rad/s")] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def q_change(self) -> Five:
        """`q_offset` with the lean in [rad]; hip angles are those between torso and femurs."""
        left, right, left_knee, right_knee, torso = self.q_offset
        lean = self.torso_lean
        return left - lean, right - lean, left_knee, right_knee, torso + lean


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """Everything that decides a run; two runs of equal scenarios are equal.

    Attributes:
        name: Short name, part of the log's file name.
        description: One sentence.
        steps: Number of steps after which the run is completed.
        time_limit: Simulated time after which the run ends anyway; 0 allows 2 s for each step.
        seed: Seed of everything random.
        walker: A folder under models/, or a path to one.
        gait: A name in the walker's gaits/, or a path to a .toml file; a walker that has no gait "paper" walks the
            first of its own by default.
        controller: The controller and its beliefs.
        plant: The true walker and its world.
        sensors: What stands between the plant and the controller's eyes.
        actuation: What stands between the controller's command and the joints.
        pushes: External forces.
        start: Offsets from the gait's first state.
    """

    name: str = "custom"
    description: str = ""
    steps: Annotated[int, Unit("steps"), whole(1, MOST_STEPS)] = 10
    time_limit: Annotated[Second, NOT_NEGATIVE] = 0.0
    seed: Annotated[int, NOT_NEGATIVE] = 0
    walker: str = "rabbit"
    gait: str = "paper"
    controller: ControllerSettings = dataclasses.field(default_factory=ControllerSettings)
    plant: PlantSettings = dataclasses.field(default_factory=PlantSettings)
    sensors: SensorSettings = dataclasses.field(default_factory=SensorSettings)
    actuation: ActuationSettings = dataclasses.field(default_factory=ActuationSettings)
    pushes: tuple[Push, ...] = ()
    start: StartSettings = dataclasses.field(default_factory=StartSettings)

    def __post_init__(self) -> None:
        settings.check(self)
        whole_substeps(self.plant.timestep, self.controller.period)
        shortest, longest = self.controller.plan.shortest, self.controller.plan.longest
        if shortest >= longest:
            raise UserError(
                f"controller.plan.shortest = {shortest!r} s: must be below controller.plan.longest = {longest!r} s"
            )
        for index, push in enumerate(self.pushes):
            _check_when(push, f"pushes.{index}")

    @property
    def end_time(self) -> float:
        """Simulated time at which the run ends at the latest in [s]."""
        return self.time_limit or TIME_PER_STEP * self.steps

    @property
    def substeps(self) -> int:
        """Physics steps in one control period."""
        return whole_substeps(self.plant.timestep, self.controller.period)


def _check_when(push: Push, path: str) -> None:
    if (push.force is None) == (push.impulse is None):
        if push.force is None:
            raise UserError(f"{path}.force: missing; must be a finite number [N], or {path}.impulse one [N.s]")
        raise UserError(f"{path}: force = {push.force!r} N, impulse = {push.impulse!r} N.s: must have one of them")
    window = (push.start, push.end)
    given = ", ".join(f"{key} = {getattr(push, key)!r}" for key in ("step", "start", "end"))
    if push.impulse is not None:
        if (push.step is None) == (push.start is None) or push.end is not None:
            raise UserError(f"{path}: {given}: an impulse must have either step, or start [s], and no end")
    elif (push.step is None) == (window == (None, None)) or (push.step is None and None in window):
        raise UserError(f"{path}: {given}: must have either step, or both start and end [s]")
    if push.start is not None and push.end is not None and push.end <= push.start:
        raise UserError(f"{path}.end = {push.end!r} s: must be after {path}.start = {push.start!r} s")


def with_values(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """A copy with several settings changed at once, by dotted path; see `settings.with_values`."""
    return settings.with_values(scenario, changes)


def with_value(scenario: Scenario, path: str, value: Any) -> Scenario:
    """A copy with one setting changed: `with_value(scenario, "plant.mass_factor.torso", 2.0)`."""
    return settings.with_values(scenario, {path: value})


def settings_table(scenario: Scenario | None = None) -> tuple[settings.Setting, ...]:
    """Every setting with dotted path, value, type, unit, range and help; of the defaults if none is given."""
    return tuple(settings.table(scenario if scenario is not None else Scenario()))
