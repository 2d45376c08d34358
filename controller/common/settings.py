"""Settings of the controllers: which law, its gains, its beliefs, its weights; each law reads its own class.

Common ground: scenario files, flags and the laws know the same classes, and nothing heavy is imported for them.
"""

import dataclasses
import functools
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from controller.common import outside
from controller.common.units import (
    FRACTION,
    NOT_NEGATIVE,
    POSITIVE,
    Newton,
    Range,
    Ratio,
    Second,
    Unit,
    Words,
    whole,
)

Four = tuple[float, float, float, float]

BUILT_IN = ("c-mpc", "zd-pd", "c-mpc-ltv", "clf-qp", "output-mpc", "c-mpc-plan")
"""Kinds of controller that come with the program."""

Kind = Annotated[str, Words(known=BUILT_IN, others=outside.is_named, legal=outside.LEGAL)]

QP_WEIGHT = Range(low=1e-4, high=1e4, words="between 1e-4 and 1e4")  # a dense solver has sixteen digits to share


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
        yielding: Whether the outputs are held more loosely where the clock is slower than nominal, so that the posture
            may change where the gait would stall.
        yielding_output: Weight on the outputs there.
        yielding_output_rate: Weight on their rates there.
        yielding_from: How much slower the clock must be for the weights to begin to change.
        yielding_to: How much slower it is where they have changed.
    """

    stages: Annotated[int, Unit("stages"), whole(1, 2000)] = 50
    stage_time: Annotated[Second, POSITIVE] = 6e-3
    substeps: Annotated[int, Unit("steps"), whole(1, 100)] = 1
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
    yielding: bool = False
    yielding_output: Annotated[float, Unit("1/rad^2"), POSITIVE] = 5e3
    yielding_output_rate: Annotated[float, Unit("s^2/rad^2"), NOT_NEGATIVE] = 1e2
    yielding_from: Annotated[float, Unit("rad/s"), NOT_NEGATIVE] = 0.02
    yielding_to: Annotated[float, Unit("rad/s"), POSITIVE] = 0.12

    def weights_at(self, faster: float) -> tuple[float, float]:
        """Weights on y^2 and dy^2 where the clock is faster than nominal by so much, in [rad/s]."""
        output, rate = self.output_at(abs(faster)), self.output_rate
        if not self.yielding or -faster <= self.yielding_from:
            return output, rate
        share = min(1.0, (-faster - self.yielding_from) / max(self.yielding_to - self.yielding_from, 1e-9))
        return output + share * (self.yielding_output - output), rate + share * (self.yielding_output_rate - rate)

    def output_at(self, off: float) -> float:
        """Weight on y^2 at a distance of the clock's rate from the nominal one in [rad/s].

        Speed comes back by leaving the outputs, so the two pull at each other. Where there is no speed to give back,
        the outputs can be held more tightly, and small departures of the plant's own orbit from the nominal one cost
        no output error.
        """
        near = self.calm * self.calm / (self.calm * self.calm + off * off)
        return self.output + near * (self.output_calm - self.output)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSettings:
    """The planner of c-mpc-plan, and when it is followed; the other controllers do not read them.

    Attributes:
        steps: Steps planned, what is left of this one among them.
        intervals: Of held torque in each.
        every: Time between two plans, and after every landing.
        delay: From the measurement a plan starts from to its use, in simulated time: what planning would take.
        iterations: Of the quadratic programme for one plan.
        torque: Weight on the torque of an interval.
        angle: Distance of a landing posture from the gait's that costs 1/2.
        speed: The same for the links' rates.
        last: Factor on the last landing.
        height: Distance of a landing foot from the ground that costs 1/2.
        force: Violation of a contact limit that costs 1/2.
        clearance: Least height of the swing foot in mid-step.
        spread: Distance of a later step's time from the gait's that costs 1/2.
        shortest: Least time of a step.
        longest: Longest time of a step.
        push: Observed push at which the plan is followed.
        output: Output error at which the plan is followed.
        rate: Distance of the clock's rate from the nominal orbit's at which the plan is followed.
        calm: Share of the three below which the gait is followed again.
        rest: How long they must be that small.
        blend: Time in which the torque goes over from one to the other.
    """

    steps: Annotated[int, Unit("steps"), whole(2, 4)] = 2
    intervals: Annotated[int, Unit("intervals"), whole(4, 60)] = 16
    every: Annotated[Second, POSITIVE] = 0.02
    delay: Annotated[Second, NOT_NEGATIVE] = 0.005
    iterations: Annotated[int, Unit("iterations"), whole(1, 100)] = 2
    torque: Annotated[float, Unit("1/(N.m)^2"), POSITIVE] = 4e-5
    angle: Annotated[float, Unit("rad"), POSITIVE] = 0.1
    speed: Annotated[float, Unit("rad/s"), POSITIVE] = 1.0
    last: Annotated[Ratio, POSITIVE] = 3.0
    height: Annotated[float, Unit("m"), POSITIVE] = 0.002
    force: Annotated[Newton, POSITIVE] = 10.0
    clearance: Annotated[float, Unit("m"), NOT_NEGATIVE] = 0.02
    spread: Annotated[Second, POSITIVE] = 0.1
    shortest: Annotated[Second, POSITIVE] = 0.15
    longest: Annotated[Second, POSITIVE] = 1.1
    push: Annotated[Newton, POSITIVE] = 12.0
    output: Annotated[float, Unit("rad"), POSITIVE] = 0.15
    rate: Annotated[float, Unit("rad/s"), POSITIVE] = 0.3
    calm: Annotated[Ratio, FRACTION] = 0.5
    rest: Annotated[Second, NOT_NEGATIVE] = 0.1
    blend: Annotated[Second, POSITIVE] = 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class FittingSettings:
    """Which gait the controller follows after an impact, by the speed measured there; speeds count from its own gait's.

    Attributes:
        enabled: Whether it follows another gait at all; needs a gait library beside the gait (cmpc gait library).
        share: Speed of the gait to follow for the speed measured; below 0 a walker too fast follows a slower gait.
        slower: Most that the gait followed may be slower.
        faster: Most that it may be faster.
        hysteresis: Changes below this are not made, and a gait nearer than this to the own one is not followed.
        most: Largest change at one impact.
    """

    enabled: bool = False
    share: Ratio = -1.0
    slower: Annotated[float, Unit("m/s"), NOT_NEGATIVE] = 0.25
    faster: Annotated[float, Unit("m/s"), NOT_NEGATIVE] = 0.0
    hysteresis: Annotated[float, Unit("m/s"), NOT_NEGATIVE] = 0.02
    most: Annotated[float, Unit("m/s"), POSITIVE] = 0.3

    def next(self, followed: float, measured: float) -> float:
        """Speed to follow after `followed` where `measured` is the walker's, all in [m/s]."""
        wish = min(max(self.share * measured, -self.slower), self.faster)
        if abs(wish) <= self.hysteresis:
            wish = 0.0  # its own gait to the bit, where nothing disturbs it
        elif abs(wish - followed) <= self.hysteresis:
            return followed
        return followed + min(max(wish - followed, -self.most), self.most)


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

    stages: Annotated[int, Unit("stages"), whole(1, 100)] = 10
    stage_time: Annotated[Second, Range(low=1e-4, high=0.1, words="between 1e-4 and 0.1")] = 5e-3
    output: Annotated[float, Unit("1/s^4"), Range(low=1.0, high=1e9, words="between 1 and 1e9")] = 3e7
    output_rate: Annotated[float, Unit("1/s^2"), Range(low=0.0, high=1e9, words="between 0 and 1e9")] = 3e4


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverSettings:
    """What the observer of pushes, loads and slopes makes of the momentum about the stance foot.

    Attributes:
        enabled: Whether it runs beside the controller, its estimates in the log; controllers that need it run their
            own in any case.
        lag: Time until nine tenths of a push that begins are seen.
        noise: Standard deviation of the angular momentum measured in one tick; the larger, the slower a load is learnt.
        load_doubt: Standard deviation of the load on the torso at the first touch-down; 0 believes in none, ever. What
            acts before that is taken for a push.
        load_walk: How fast the load may change.
        slope_memory: Share of the old slope kept at a touch-down.
    """

    enabled: bool = False
    lag: Annotated[Second, Range(low=5e-3, high=1.0, words="between 0.005 and 1")] = 0.045
    noise: Annotated[float, Unit("kg.m^2/s"), POSITIVE] = 0.2
    load_doubt: Annotated[float, Unit("kg"), NOT_NEGATIVE] = 0.5
    load_walk: Annotated[float, Unit("kg/s^0.5"), NOT_NEGATIVE] = 0.1
    slope_memory: Annotated[float, Unit("ratio"), FRACTION] = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """Which of a walker's properties beyond masses, lengths and damping its controller knows; the plant has them all.

    Attributes:
        rotor_inertia: Whether it knows the rotor inertia.
        com_across: Whether it knows how far the centres of mass are off their links' axes.
        springs: Whether it knows the springs in the joints.
        friction: Whether it knows the dry friction of the joints and feeds it forward.
    """

    rotor_inertia: bool = True
    com_across: bool = True
    springs: bool = True
    friction: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerSettings:
    """The controller and its beliefs; joint gains are ordered stance hip, swing hip, stance knee, swing knee.

    Attributes:
        kind: Control law: the paper's cascade (ZD+PD inside an MPC), ZD+PD alone, or a cascade with an MPC that
            linearises the closed loop through impacts and minds the clock's rate, alone or with a planner of whole
            steps beside it; or a rival: a control Lyapunov function held by a QP, or MPC of the linearised outputs;
            or one from outside, MODULE:FACTORY or FILE.py:FACTORY.
        kp: Proportional gains K_P of the outputs.
        kd: Derivative gains K_D of the outputs.
        horizon: Prediction horizon N.
        period: Sampling and hold period T.
        impact_time: How long after a landing joint rates are predicted by the impact map instead of measured, as an
            impact lasts; 0 takes what is measured in the midst of an impact for the state after it.
        friction: Friction coefficient the controller assumes.
        friction_rows: Whether the MPC, or the QP of clf-qp, bounds the stance contact force; output-mpc never does.
        normal_force_min: Lower bound on the stance foot's normal force.
        solver: QP solver: riccati, made for this problem, or any by its name in qpsolvers.
        weights: Cost of c-mpc.
        ltv: Prediction and cost of c-mpc-ltv.
        plan: Planner of c-mpc-plan.
        clf: Tuning of clf-qp.
        output_mpc: Tuning of output-mpc.
        gait_fitting: Which gait to follow.
        observer: What it makes of pushes, loads and slopes.
        knows: What of the walker it knows.
    """

    kind: Kind = BUILT_IN[0]
    kp: Annotated[Four, Unit("1/s^2"), NOT_NEGATIVE] = (60.0, 90.0, 90.0, 50.0)
    kd: Annotated[Four, Unit("1/s"), NOT_NEGATIVE] = (10.0, 20.0, 20.0, 10.0)
    horizon: Annotated[int, Unit("ticks"), whole(1, 10_000)] = 100
    period: Annotated[Second, POSITIVE] = 1e-3
    impact_time: Annotated[Second, NOT_NEGATIVE] = 0.012
    friction: Annotated[Ratio, NOT_NEGATIVE] = 0.6
    friction_rows: bool = True
    normal_force_min: Annotated[Newton, NOT_NEGATIVE] = 20.0
    solver: str = "riccati"
    weights: WeightSettings = dataclasses.field(default_factory=WeightSettings)
    ltv: LtvSettings = dataclasses.field(default_factory=LtvSettings)
    plan: PlanSettings = dataclasses.field(default_factory=PlanSettings)
    clf: ClfSettings = dataclasses.field(default_factory=ClfSettings)
    output_mpc: OutputMpcSettings = dataclasses.field(default_factory=OutputMpcSettings)
    gait_fitting: FittingSettings = dataclasses.field(default_factory=FittingSettings)
    observer: ObserverSettings = dataclasses.field(default_factory=ObserverSettings)
    knows: Known = dataclasses.field(default_factory=Known)

    @classmethod
    def read_as(cls, table: Mapping[str, Any]) -> tuple[type["ControllerSettings"], Mapping[str, Any]]:
        """The class for a table of settings: one with a table `settings` where the controller is from outside.

        Raises:
            UserError: the controller's code cannot be imported.
        """
        kind = table.get("kind", BUILT_IN[0])
        if not isinstance(kind, str) or kind in BUILT_IN or not outside.is_named(kind):
            return ControllerSettings, table
        if outside.is_inert():
            return _with(_as_it_stands("Settings", table.get("settings", {}))), table
        return _with(outside.find(kind).settings or NoSettings), table


@dataclass(frozen=True, slots=True, kw_only=True)
class NoSettings:
    """Of a controller from outside that takes none."""


@functools.lru_cache(maxsize=64)
def _with(own: type) -> type[ControllerSettings]:
    """The settings of a controller from outside: those of all controllers and, as `settings`, its own."""
    return dataclasses.make_dataclass(
        "ControllerSettings",
        [("settings", own, dataclasses.field(default_factory=own))],
        bases=(ControllerSettings,),
        namespace={"__doc__": "", "__reduce__": _reduce, "own": ("settings",)},
        frozen=True,
        slots=True,
        kw_only=True,
    )


def _as_it_stands(name: str, table: Any) -> type:
    """A settings class made from a table itself, where no code may be imported: names and types, no units."""
    fields: list[tuple[str, Any, Any]] = []
    kind: Any
    default: Any
    for key, value in table.items() if isinstance(table, Mapping) else ():
        kind, default = type(value), dataclasses.field(default=value)
        if isinstance(value, Mapping):
            kind = _as_it_stands(key, value)
            default = dataclasses.field(default_factory=kind)
        elif isinstance(value, list):
            kinds = {type(item) for item in value}
            kind = tuple[str, ...] if kinds == {str} else tuple[bool, ...] if kinds == {bool} else tuple[float, ...]
            default = dataclasses.field(default=())
        fields.append((str(key), kind, default))
    try:
        return dataclasses.make_dataclass(name, fields, frozen=True, slots=True, kw_only=True)
    except (TypeError, ValueError):  # names that Python cannot have
        return NoSettings


def _reduce(settings: Any) -> tuple[Any, ...]:
    """Pickle by name: the class is made anew where it is read, from the same file."""
    common = {f.name: getattr(settings, f.name) for f in dataclasses.fields(ControllerSettings)}
    _, text = outside.source_of(settings.kind)
    return _revived, (common, dataclasses.asdict(settings.settings), text)


def _revived(common: dict[str, Any], own: dict[str, Any], text: bytes) -> ControllerSettings:
    outside.remember(common["kind"], text)
    cls = outside.find(common["kind"]).settings or NoSettings
    made: Any = _with(cls)
    return made(**common, settings=_rebuilt(cls, own))


def _rebuilt(cls: Any, plain: Any) -> Any:
    """The inverse of `dataclasses.asdict`."""
    args = typing.get_args(cls)
    if typing.get_origin(cls) is tuple and args and dataclasses.is_dataclass(args[0]):
        return tuple(_rebuilt(args[0], item) for item in plain)
    if not dataclasses.is_dataclass(cls):
        return plain
    hints = typing.get_type_hints(cls)
    return cls(**{name: _rebuilt(hints[name], value) for name, value in plain.items()})  # type: ignore[operator]
