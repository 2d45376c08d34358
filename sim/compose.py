"""The composition root: the one module of `sim/` that knows both worlds and puts a run together."""

import contextlib
import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller import kernels
from controller.cascade import CascadedMpc, Friction, Weights
from controller.comparison import ComparingSolver, compare_solvers, exact_clarabel
from controller.errors import ControllerInputError
from controller.gait import Gait, load_gait
from controller.model import WalkerModel
from controller.qp import ROWS, Solver
from controller.solvers import make_solver
from controller.zero_dynamics import ZeroDynamicsController
from sim import provenance
from sim.actuation import Actuation
from sim.errors import UserError
from sim.instruments import InstrumentedPlant
from sim.interface import Controller, Observation, Plant, Vector
from sim.kinematics import LEGS
from sim.loop import Loop, NoTape, Progress, Stop, Tape
from sim.models import LIBRARY, ModelFiles, library_json
from sim.outcome import RunSummary
from sim.plant import MujocoPlant
from sim.recorder import Recorder, RunHeader
from sim.rig import Rig
from sim.rigid import RigidPlant
from sim.scenario import ActuationSettings, ControllerSettings, Scenario, SensorSettings, to_toml
from sim.sections import Surface
from sim.sensors import Sensors
from sim.terrain import Terrain
from sim.viewer import check_display, viewer

if TYPE_CHECKING:
    from controller.family import GaitFamily
    from controller.fitting import Follower

__all__ = [
    "Belief",
    "ComparingSolver",
    "build_controller",
    "build_plant",
    "build_rig",
    "compare_solvers",
    "exact_clarabel",
    "load_belief",
    "make_solver",
    "run_scenario",
    "start_state",
    "warm_up",
]
"""The solver parts are handed on to the benchmark, which must not know the controller itself."""

FIRST_STANCE = "left"
RUN_UP = 2.0  # [m] of rough ground beyond what the steps need
LONGEST_STEP = 0.6  # [m] a step may take on rough ground; the gait's are 0.4 m

Announce = Callable[[str], None]
"""Takes one line for the user."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """What the controller knows about the walker.

    Attributes:
        model: Analytic model.
        gait: The gait to follow.
        library: Folder of the gait library.
    """

    model: WalkerModel
    gait: Gait
    library: Path


@contextlib.contextmanager
def _as_user_errors() -> Iterator[None]:
    try:
        yield
    except ControllerInputError as error:
        raise UserError(str(error)) from error


def load_belief(scenario: Scenario, files: ModelFiles | None = None) -> Belief:
    """The controller's model and gait.

    Args:
        scenario: What happens.
        files: Model files to use instead of those the scenario names.

    Raises:
        UserError: a file is missing, unreadable or not legal.
    """
    files = files or ModelFiles.of(scenario)
    with _as_user_errors():
        model = WalkerModel(files.urdf)
        return Belief(model=model, gait=load_gait(files.gait, model), library=files.library)


@functools.lru_cache(maxsize=4)
def known_belief(walker: str, gait: str) -> Belief:
    """The controller's model and gait, read once a process: a campaign runs thousands of scenarios."""
    return load_belief(Scenario(walker=walker, gait=gait))


def build_controller(settings: ControllerSettings, belief: Belief, *, solver: Solver | None = None) -> Controller:
    """The controller a scenario asks for.

    Args:
        settings: Its settings.
        belief: What it knows about the walker.
        solver: Used instead of the one the settings name.

    Raises:
        UserError: unknown solver, or no gait library where gaits are fitted.
    """
    law = _law(settings, belief, solver)
    fitting = settings.gait_fitting
    if not fitting.enabled:
        return law
    from controller.fitting import FittingRule, GaitFitting

    rule = FittingRule(
        share=fitting.share,
        slower=fitting.slower,
        faster=fitting.faster,
        hysteresis=fitting.hysteresis,
        most=fitting.most,
    )
    with _as_user_errors():
        return GaitFitting(law, belief.model, _family(belief), rule)


@functools.lru_cache(maxsize=4)
def _family(belief: Belief) -> "GaitFamily":
    from controller.family import GaitFamily
    from controller.library import GaitLibrary  # only where gaits are fitted

    return GaitFamily.around(belief.gait, GaitLibrary.load(belief.library, belief.model))


def _law(settings: ControllerSettings, belief: Belief, solver: Solver | None) -> "Follower":
    gains = kernels.Gains(kp=np.array(settings.kp), kd=np.array(settings.kd))
    if settings.kind == "zd-pd":
        return ZeroDynamicsController(belief.model, belief.gait, gains)
    if settings.kind == "c-mpc-ltv":
        return _ltv_cascade(settings, belief, gains)
    friction = Friction(mu=settings.friction, normal_min=settings.normal_force_min)
    with _as_user_errors():
        return CascadedMpc(
            belief.model,
            belief.gait,
            gains,
            N=settings.horizon,
            T=settings.period,
            weights=Weights.of_paper(gains, settings.period),
            friction=friction if settings.friction_rows else None,
            solver=solver or make_solver(settings.solver, settings.horizon, ROWS if settings.friction_rows else 0),
        )


def _ltv_cascade(settings: ControllerSettings, belief: Belief, gains: kernels.Gains) -> "Follower":
    from controller.ltv.cascade import LtvCascade, LtvWeights  # compiled only where it is used

    ltv = settings.ltv
    friction = Friction(mu=settings.friction, normal_min=settings.normal_force_min, penalty=ltv.force_penalty)
    return LtvCascade(
        belief.model,
        belief.gait,
        gains,
        period=settings.period,
        stages=ltv.stages,
        stage_time=ltv.stage_time,
        substeps=ltv.substeps,
        weights=LtvWeights(
            output=ltv.output,
            output_calm=ltv.output_calm,
            calm=ltv.calm,
            output_rate=ltv.output_rate,
            clock_rate=ltv.clock_rate,
            torque=ltv.torque,
            last=ltv.last,
            torque_penalty=ltv.torque_penalty,
        ),
        friction=friction if settings.friction_rows else None,
        slope_memory=ltv.slope_memory,
    )


def build_plant(scenario: Scenario, files: ModelFiles | None = None) -> MujocoPlant | RigidPlant:
    """The plant a scenario asks for, not yet reset.

    Args:
        scenario: What happens.
        files: Model files to use instead of those the scenario names.

    Raises:
        UserError: a model file or a setting is not legal.
    """
    files = files or ModelFiles.of(scenario)
    plant = RigidPlant if scenario.plant.kind == "rigid" else MujocoPlant
    return plant(
        scenario.plant,
        files.mjcf,
        scenario.controller.period,
        seed=scenario.seed,
        walk_length=RUN_UP + LONGEST_STEP * scenario.steps,
    )


def instrument(plant: Plant, scenario: Scenario) -> Plant:
    """The plant behind the sensors and motors a scenario asks for; the plant itself if they do not err."""
    if scenario.sensors == SensorSettings() and scenario.actuation == ActuationSettings():
        return plant
    period, seed = scenario.controller.period, scenario.seed
    return InstrumentedPlant(
        plant, Sensors(scenario.sensors, period, seed), Actuation(scenario.actuation, period, seed)
    )


def start_state(scenario: Scenario, belief: Belief) -> tuple[Vector, Vector]:
    """First state in body order: the gait's state after impact, with the scenario's offsets.

    Returns:
        q in [rad] and dq in [rad/s], (5,) each; the left leg stands.
    """
    q, dq = belief.gait.post_impact(belief.model)
    q, dq = q + np.array(scenario.start.q_offset), dq + np.array(scenario.start.dq_offset)
    q[-1] += scenario.start.torso_offset
    return q, dq


def build_rig(scenario: Scenario) -> Rig:
    """Plant and controller of a scenario for many runs.

    Raises:
        UserError: a file or a setting is not legal.
    """
    belief = load_belief(scenario)
    plant = build_plant(scenario)
    q, dq = belief.gait.post_impact(belief.model)
    return Rig(
        scenario=scenario,
        plant=plant,
        walker=lambda: instrument(plant, scenario),
        controller=build_controller(scenario.controller, belief),
        com=plant.com,
        torque_limits=plant.torque_limits,
        q_start=q,
        dq_start=dq,
        x_gait=np.concatenate((belief.gait.q_minus, belief.gait.dq_minus)),
        surface=Surface(plant.legs, scenario.plant.ground.slope),
    )


def warm_up(controller: Controller, observation: Observation, announce: Announce | None = None) -> None:
    """Compile the controller's kernels, or load them from disk, so that no tick pays for it.

    Args:
        controller: To be warmed; reset it afterwards.
        observation: Anything legal.
        announce: Told a line for the user where compiling will take long.
    """
    if announce and not kernels.on_disk():
        announce("compiling kernels, once, about 20 s")
    controller.step(observation)


def run_scenario(
    scenario: Scenario,
    *,
    log: Path | None = None,
    progress: Progress | None = None,
    stop: Stop | None = None,
    files: ModelFiles | None = None,
    view: bool = False,
    announce: Announce | None = None,
    solver: Solver | None = None,
    tape: Tape | None = None,
    belief: Belief | None = None,
) -> RunSummary:
    """Run a scenario from start to end.

    Args:
        scenario: What happens.
        log: MCAP file to write; None for no log. An existing file is never overwritten.
        progress: Told now and then the completed steps and the simulated time in [s].
        stop: Asked every tick; a reason ends the run as interrupted, its log complete.
        files: Model files to use instead of those the scenario names, such as those of a log.
        view: Whether to show it in MuJoCo's window, no faster than real time.
        announce: Told a line for the user before something long.
        solver: Used instead of the one the scenario names.
        tape: Takes ticks and events where no log is written.
        belief: The controller's model and gait if they have been loaded before; read from their files if not.

    Raises:
        UserError: a file or a setting is not legal, the log can not be written, or there is no display.
    """
    if view:
        check_display()
    files = files or ModelFiles.of(scenario)
    belief = belief or load_belief(scenario, files)
    controller = build_controller(scenario.controller, belief, solver=solver)
    plant = build_plant(scenario, files)
    q, dq = start_state(scenario, belief)
    walker = instrument(plant, scenario)
    walker.reset(q, dq, FIRST_STANCE)
    controller.reset(FIRST_STANCE)
    warm_up(controller, plant.observe(), announce)
    controller.reset(FIRST_STANCE)

    def loop(tape: Tape) -> RunSummary:
        with viewer(plant, scenario.controller.period, stop) if view else contextlib.nullcontext(stop) as ask:
            return Loop(
                plant=walker,
                controller=controller,
                pushes=scenario.pushes,
                com=plant.com,
                stance=FIRST_STANCE,
                steps=scenario.steps,
                end_time=scenario.end_time,
                tape=tape,
                torque_limits=plant.torque_limits,
                period=scenario.controller.period,
            ).run(progress=progress, stop=ask, log=str(log) if log else "")

    if log is None:
        return loop(tape or NoTape())
    with Recorder(log, _header(scenario, belief, plant, files), scenario.controller.period) as recorder:
        summary = loop(recorder)
        recorder.result(summary)
    return summary


def _header(scenario: Scenario, belief: Belief, plant: MujocoPlant | RigidPlant, files: ModelFiles) -> RunHeader:
    """What the log says before the first tick; attachments are enough to run it again."""
    lengths = {
        f"{leg}_{part}": length
        for leg, both in zip(LEGS, plant.legs.lengths, strict=True)
        for part, length in zip(("femur", "tibia"), both, strict=True)
    }
    walk_length = RUN_UP + LONGEST_STEP * scenario.steps
    terrain = Terrain(scenario.plant.ground, seed=scenario.seed, length=walk_length)
    git = provenance.git_state()
    fits = scenario.controller.gait_fitting.enabled
    return RunHeader(
        scenario_name=scenario.name,
        scenario_toml=to_toml(scenario),
        seed=scenario.seed,
        versions=provenance.package_versions(),
        git_revision=git.revision,
        git_dirty=git.dirty,
        platform=provenance.platform_name(),
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        link_lengths={"torso": 2.0 * belief.model.torso.com, **lengths},
        ground=terrain.outline(-RUN_UP, walk_length + RUN_UP),
        attachments={
            files.mjcf.name: ("application/xml", files.mjcf.read_bytes()),
            files.urdf.name: ("application/xml", files.urdf.read_bytes()),
            files.gait.name: ("application/toml", files.gait.read_bytes()),
            **({LIBRARY: ("application/json", library_json(files.library))} if fits else {}),
        },
    )
