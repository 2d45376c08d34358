"""What happens in a run: walker, gait, controller, plant and its errors, sensors, motors, pushes, start, end.

A scenario is a tree of frozen dataclasses and the same tree as TOML. To add a setting, add a field with a
default, its unit and range in the annotation and a sentence in the docstring: the loader, the command line's
flags and help, and the log follow.
"""

import dataclasses
import difflib
import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from sim.errors import UserError
from sim.scenario.per_link import BodyFactors, JointFactors
from sim.scenario.plant import GroundSettings, PlantSettings
from sim.scenario.signals import ActuationSettings, SensorSettings
from sim.settings import tree as settings
from sim.settings.units import (
    AT_LEAST_ONE,
    FRACTION,
    NOT_NEGATIVE,
    POSITIVE,
    Newton,
    Radian,
    Range,
    Ratio,
    Second,
    Unit,
)

__all__ = [
    "ActuationSettings",
    "BodyFactors",
    "ControllerSettings",
    "FittingSettings",
    "GroundSettings",
    "JointFactors",
    "LtvSettings",
    "PlantSettings",
    "Push",
    "Scenario",
    "SensorSettings",
    "StartSettings",
    "WeightSettings",
]

SHIPPED = Path(__file__).parent / "shipped"
DEFAULT = "push-25N"

Body = Literal["torso", "left_femur", "left_tibia", "right_femur", "right_tibia"]
Four = tuple[float, float, float, float]
Five = tuple[float, float, float, float, float]

QP_WEIGHT = Range(low=1e-4, high=1e4, words="between 1e-4 and 1e4")  # a dense solver has sixteen digits to share

TIME_PER_STEP = 2.0  # [s] of simulated time allowed for each step when no limit is given


@dataclass(frozen=True, slots=True, kw_only=True)
class LtvSettings:
    """Prediction and cost of c-mpc-ltv; the other controllers do not read them.

    Attributes:
        stages: Prediction horizon.
        stage_time: Length of a stage.
        substeps: Integration steps of a stage.
        output: Weight on the outputs y.
        output_calm: Weight on them where the clock's rate is that of the nominal orbit.
        calm: Distance of the clock's rate from the nominal orbit's at which the weight is half way between.
        output_rate: Weight on their rates.
        clock_rate: Weight on the clock's rate off the nominal orbit.
        torque: Weight on the MPC's torques.
        last: Factor on the weights of the last stage.
        torque_penalty: Weight on planned torques beyond their limits; the one applied now never is.
        force_penalty: Weight on contact forces beyond their limits.
        slope_memory: Share of the old belief about the ground's slope kept at a touch-down; 1 believes in level ground.
    """

    stages: Annotated[int, Unit("stages"), AT_LEAST_ONE] = 50
    stage_time: Annotated[Second, POSITIVE] = 6e-3
    substeps: Annotated[int, Unit("steps"), AT_LEAST_ONE] = 1
    output: Annotated[float, Unit("1/rad^2"), POSITIVE] = 1e5
    output_calm: Annotated[float, Unit("1/rad^2"), POSITIVE] = 2e6
    calm: Annotated[float, Unit("rad/s"), POSITIVE] = 0.02
    output_rate: Annotated[float, Unit("s^2/rad^2"), NOT_NEGATIVE] = 1e3
    clock_rate: Annotated[float, Unit("s^2/rad^2"), NOT_NEGATIVE] = 3e4
    torque: Annotated[float, Unit("1/(N.m)^2"), POSITIVE] = 0.1
    last: Annotated[Ratio, NOT_NEGATIVE] = 10.0
    torque_penalty: Annotated[float, Unit("1/(N.m)^2"), NOT_NEGATIVE] = 30.0
    force_penalty: Annotated[float, Unit("1/N^2"), POSITIVE] = 100.0
    slope_memory: Annotated[float, Unit("ratio"), FRACTION] = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class FittingSettings:
    """Which gait the controller follows after an impact, by the speed measured there; speeds count from its own gait's.

    Attributes:
        enabled: Whether it follows another gait at all; needs a gait library beside the gait (cmpc gait library).
        share: Speed of the gait to follow for the speed measured; below 0 a walker too fast follows a slower gait.
        slower: Most that the gait followed may be slower.
        faster: Most that it may be faster.
        hysteresis: Changes below this are not made.
        most: Largest change at one impact.
    """

    enabled: bool = False
    share: Ratio = -1.0
    slower: Annotated[float, Unit("m/s"), NOT_NEGATIVE] = 0.25
    faster: Annotated[float, Unit("m/s"), NOT_NEGATIVE] = 0.0
    hysteresis: Annotated[float, Unit("m/s"), NOT_NEGATIVE] = 0.02
    most: Annotated[float, Unit("m/s"), POSITIVE] = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class WeightSettings:
    """Cost of c-mpc in Eq. (16), relative to the paper's; ordered stance hip, swing hip, stance knee, swing knee.

    Attributes:
        output: Factors on the paper's weights 2 K_P / T^2 on the outputs y.
        output_rate: Factors on the paper's weights K_D / T on their rates.
        torque: Weights R on the MPC's torques; 1 in the paper.
    """

    output: Annotated[Four, Unit("ratio"), NOT_NEGATIVE] = (1.0, 1.0, 1.0, 1.0)
    output_rate: Annotated[Four, Unit("ratio"), NOT_NEGATIVE] = (1.0, 1.0, 1.0, 1.0)
    torque: Annotated[Four, Unit("1/(N.m)^2"), POSITIVE] = (1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClfSettings:
    """Tuning of clf-qp, found on the walks that controller/rivals names; the other controllers do not read it.

    Attributes:
        epsilon: The Lyapunov function's epsilon; the smaller, the faster the outputs converge.
        penalty: Weight on missing its guaranteed decay.
        force_penalty: Weight on contact forces beyond their limits.
    """

    epsilon: Annotated[Ratio, Range(low=1e-3, words="1e-3 or above")] = 0.015
    penalty: Annotated[float, Unit("s^2/rad^2"), QP_WEIGHT] = 10.0
    force_penalty: Annotated[float, Unit("1/N^2"), QP_WEIGHT] = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputMpcSettings:
    """Tuning of output-mpc, found on the walks that controller/rivals names; the other controllers do not read it.

    Attributes:
        stages: Prediction horizon.
        stage_time: Length of a stage.
        output: Weight on the outputs y.
        output_rate: Weight on their rates.
    """

    stages: Annotated[int, Unit("stages"), Range(low=1, high=100, words="from 1 to 100")] = 10
    stage_time: Annotated[Second, Range(low=1e-4, high=0.1, words="between 1e-4 and 0.1")] = 5e-3
    output: Annotated[float, Unit("1/s^4"), Range(low=1.0, high=1e9, words="between 1 and 1e9")] = 3e7
    output_rate: Annotated[float, Unit("1/s^2"), Range(low=0.0, high=1e9, words="between 0 and 1e9")] = 3e4


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerSettings:
    """The controller and its beliefs; joint gains are ordered stance hip, swing hip, stance knee, swing knee.

    Attributes:
        kind: Control law: the paper's cascade (ZD+PD inside an MPC), ZD+PD alone, or a cascade with an MPC that
            linearises the closed loop through impacts and minds the clock's rate; or a rival: a control Lyapunov
            function held by a QP, or MPC of the linearised outputs.
        kp: Proportional gains K_P of the outputs.
        kd: Derivative gains K_D of the outputs.
        horizon: Prediction horizon N.
        period: Sampling and hold period T.
        friction: Friction coefficient the controller assumes.
        friction_rows: Whether the MPC, or the QP of clf-qp, bounds the stance contact force; output-mpc never does.
        normal_force_min: Lower bound on the stance foot's normal force.
        solver: QP solver: riccati, made for this problem, or any by its name in qpsolvers.
        weights: Cost of c-mpc.
        ltv: Prediction and cost of c-mpc-ltv.
        clf: Tuning of clf-qp.
        output_mpc: Tuning of output-mpc.
        gait_fitting: Which gait to follow.
    """

    kind: Literal["c-mpc", "zd-pd", "c-mpc-ltv", "clf-qp", "output-mpc"] = "c-mpc"
    kp: Annotated[Four, Unit("1/s^2"), NOT_NEGATIVE] = (60.0, 90.0, 90.0, 50.0)
    kd: Annotated[Four, Unit("1/s"), NOT_NEGATIVE] = (10.0, 20.0, 20.0, 10.0)
    horizon: Annotated[int, Unit("ticks"), AT_LEAST_ONE] = 100
    period: Annotated[Second, POSITIVE] = 1e-3
    friction: Annotated[Ratio, NOT_NEGATIVE] = 0.6
    friction_rows: bool = True
    normal_force_min: Annotated[Newton, NOT_NEGATIVE] = 20.0
    solver: str = "riccati"
    weights: WeightSettings = dataclasses.field(default_factory=WeightSettings)
    ltv: LtvSettings = dataclasses.field(default_factory=LtvSettings)
    clf: ClfSettings = dataclasses.field(default_factory=ClfSettings)
    output_mpc: OutputMpcSettings = dataclasses.field(default_factory=OutputMpcSettings)
    gait_fitting: FittingSettings = dataclasses.field(default_factory=FittingSettings)


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
    step: Annotated[int | None, Unit("step"), AT_LEAST_ONE] = None
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
        gait: A name in the walker's gaits/, or a path to a .toml file.
        controller: The controller and its beliefs.
        plant: The true walker and its world.
        sensors: What stands between the plant and the controller's eyes.
        actuation: What stands between the controller's command and the joints.
        pushes: External forces.
        start: Offsets from the gait's first state.
    """

    name: str = "custom"
    description: str = ""
    steps: Annotated[int, Unit("steps"), AT_LEAST_ONE] = 10
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
        _check_timestep(self.plant.timestep, self.controller.period)
        for index, push in enumerate(self.pushes):
            _check_when(push, f"pushes.{index}")

    @property
    def end_time(self) -> float:
        """Simulated time at which the run ends at the latest in [s]."""
        return self.time_limit or TIME_PER_STEP * self.steps

    @property
    def substeps(self) -> int:
        """Physics steps in one control period."""
        return round(self.controller.period / self.plant.timestep)


def _check_timestep(timestep: float, period: float) -> None:
    ratio = period / timestep
    whole = max(1, round(ratio)) if math.isfinite(ratio) else 1
    if abs(ratio - whole) > 1e-9 * whole:
        near = period / whole
        raise UserError(
            f"plant.timestep = {timestep!r} s: must divide controller.period = {period!r} s "
            f"a whole number of times; the nearest legal value is {near:.6g} s"
        )


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


def to_toml(scenario: Scenario) -> str:
    """The whole scenario as TOML text; `from_toml` reads back an equal one."""
    return settings.to_toml(scenario)


def from_toml(source: str | Path) -> Scenario:
    """A scenario from TOML.

    Args:
        source: A `Path` is read as a file, whose name is the scenario's unless it says otherwise; a `str`
            is the TOML text itself.

    Raises:
        UserError: unreadable file, invalid TOML, unknown key, wrong type or illegal value, on one line.
    """
    where = str(source) if isinstance(source, Path) else "scenario"
    try:
        text = source.read_text(encoding="utf-8") if isinstance(source, Path) else source
        tree = tomllib.loads(text)
        if isinstance(source, Path):
            tree.setdefault("name", source.stem)
        return settings.build(Scenario, tree)
    except OSError as error:
        raise UserError(f"{where}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UserError(f"{where}: is not UTF-8 text (byte {error.start})") from error
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{where}: is not valid TOML: {error}") from error
    except UserError as error:
        raise UserError(f"{where}: {error}") from error
    except ValueError as error:  # an integer of thousands of digits
        raise UserError(f"{where}: is not valid TOML: {error}") from error


def with_values(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """A copy with several settings changed at once, by dotted path; see `settings.with_values`."""
    return settings.with_values(scenario, changes)


def with_value(scenario: Scenario, path: str, value: Any) -> Scenario:
    """A copy with one setting changed: `with_value(scenario, "plant.mass_factor.torso", 2.0)`."""
    return settings.with_values(scenario, {path: value})


def settings_table(scenario: Scenario | None = None) -> tuple[settings.Setting, ...]:
    """Every setting with dotted path, value, type, unit, range and help; of the defaults if none is given."""
    return tuple(settings.table(scenario if scenario is not None else Scenario()))


def shipped() -> dict[str, str]:
    """Names of the scenarios that come with the program, each with its description."""
    return {path.stem: from_toml(path).description for path in sorted(SHIPPED.glob("*.toml"))}


def load(name: str) -> Scenario:
    """A shipped scenario by name, or any other by the path of its .toml file.

    Raises:
        UserError: no such name (the message has the nearest and the list), or an illegal file.
    """
    if name.endswith(".toml") or os.sep in name:
        return from_toml(Path(name))
    path = SHIPPED / f"{name}.toml"
    if not path.is_file():
        names = sorted(path.stem for path in SHIPPED.glob("*.toml"))
        near = difflib.get_close_matches(name, names, n=1, cutoff=0.4)
        guess = f"; did you mean {near[0]}?" if near else ";"
        raise UserError(f"no scenario {name!r}{guess} Shipped: {', '.join(names)}; or give a .toml file")
    return from_toml(path)
