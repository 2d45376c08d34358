"""A run put together from a scenario: plant, controller, sensors, log; the one starter of runs."""

import contextlib
import os
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import mujoco
import numpy as np

from controller.common import outside
from controller.common.settings import BUILT_IN
from controller.guard import guarded, hangs_end
from controller.qp import Solver, make_solver
from controller.qp.compare import ComparingSolver, compare_solvers, exact_clarabel
from sim.bridge import kernels
from sim.bridge.controllers import Belief, build_controller, known_belief, load_belief
from sim.interface import LEGS, OBSERVATION, STEP, Controller, Observation, Plant, RowController, Vector
from sim.log import provenance
from sim.log.write import Recorder, RunHeader
from sim.loop import Course, FallCriteria, Loop, NoTape, Progress, RunSummary, Stop, Tape, Tapes
from sim.plant import MujocoPlant, RigidPlant, Walker
from sim.plant.actuation import Actuation
from sim.plant.build import compiled_model
from sim.plant.instruments import InstrumentedPlant
from sim.plant.sensors import Sensors
from sim.plant.terrain import Terrain
from sim.scenario import ActuationSettings, Scenario, SensorSettings, to_toml
from sim.stability.rig import Rig
from sim.stability.sections import Surface
from sim.terminal.viewer import check_display, viewer
from sim.walkers import ModelFiles
from sim.walkers.model_files import LAW, LIBRARY, library_json

__all__ = [
    "Belief",
    "ComparingSolver",
    "build_controller",
    "build_plant",
    "build_rig",
    "compare_solvers",
    "exact_clarabel",
    "known_belief",
    "load_belief",
    "make_solver",
    "run_scenario",
    "start_state",
    "warm_up",
]
"""The solver parts are handed on to the benchmark, which must not know the controller itself."""

RUN_UP = 2.0  # [m] of rough ground beyond what the steps need
LONGEST_STEP = 0.6  # [m] a step may take on rough ground; the gait's are 0.4 m

Announce = Callable[[str], None]
"""Takes one line for the user."""


def build_plant(scenario: Scenario, files: ModelFiles | None = None, *, pictures: bool = False) -> Walker:
    """The plant a scenario asks for, not yet reset.

    Args:
        scenario: What happens.
        files: Model files to use instead of those the scenario names.
        pictures: Whether its model has its textures, for a viewer.

    Raises:
        UserError: a model file or a setting is not legal.
    """
    files = files or ModelFiles.of(scenario)
    plant: type[RigidPlant | MujocoPlant] = RigidPlant if scenario.plant.kind == "rigid" else MujocoPlant
    return plant(
        scenario.plant,
        files.mjcf,
        scenario.controller.period,
        seed=scenario.seed,
        walk_length=_walk_length(scenario),
        pictures=pictures,
    )


def plant_model(scenario: Scenario) -> mujoco.MjModel:
    """MuJoCo's model of the plant that a scenario asks for, modelling errors applied, without textures.

    Raises:
        UserError: a model file or a setting is not legal.
    """
    files, length = ModelFiles.of(scenario), _walk_length(scenario)
    terrain = Terrain(scenario.plant.ground, seed=scenario.seed, length=length)
    return compiled_model(scenario.plant, files.mjcf, terrain, seed=scenario.seed, length=length)


def _walk_length(scenario: Scenario) -> float:
    """How far rough ground has to reach in [m]."""
    return RUN_UP + LONGEST_STEP * scenario.steps


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
    q, dq = q + np.array(scenario.start.q_change), dq + np.array(scenario.start.dq_offset)
    q[-1] += scenario.start.torso_offset
    return q, dq


def _course(scenario: Scenario, belief: Belief, plant: Walker) -> Course:
    """What a scenario puts its walker through."""
    q, dq = start_state(scenario, belief)
    length = plant.legs.nominal_length(scenario.plant.length_factor)  # whatever errors the plant is given
    return Course(
        q=q,
        dq=dq,
        steps=scenario.steps,
        end_time=scenario.end_time,
        pushes=scenario.pushes,
        criteria=FallCriteria.of_leg(length, trips=scenario.plant.scuff == "trip"),
        period=scenario.controller.period,
    )


def build_rig(scenario: Scenario) -> Rig:
    """Plant and controller of a scenario for many runs.

    Raises:
        UserError: a file or a setting is not legal.
    """
    belief = load_belief(scenario)
    plant = build_plant(scenario)
    q, _ = belief.gait.post_impact(belief.model)
    return Rig(
        scenario=scenario,
        plant=plant,
        walker=lambda: instrument(plant, scenario),
        controller=build_controller(scenario.controller, belief),
        q_start=q,
        course=_course(scenario, belief, plant),
        x_gait=np.concatenate((belief.gait.q_minus, belief.gait.dq_minus)),
        surface=Surface(plant.legs, scenario.plant.ground.slope),
    )


def warm_up(controller: Controller, observation: Observation) -> None:
    """Load the controller's kernels from disk, or compile them, so that no tick pays for it.

    Args:
        controller: To be warmed; reset it afterwards.
        observation: Anything legal.
    """
    if guarded(controller):  # one from outside may count its ticks
        return
    if not isinstance(controller, RowController):
        controller.step(observation)
        return
    seen, step = np.zeros(2, OBSERVATION), np.zeros(2, STEP)
    seen["t"], seen["q"], seen["dq"] = observation.t + 1.0, observation.q, observation.dq
    seen["t"][1], seen["contact"][1] = observation.t + 1.001, 1  # the swing foot lands, so that an impact lasts
    for row in range(len(seen)):
        controller.decide(seen, step, row)


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
    prepared: bool = False,
) -> RunSummary:
    """Run a scenario from start to end.

    Args:
        scenario: What happens.
        log: MCAP file to write; None for no log. An existing file is never overwritten.
        progress: Told now and then the completed steps and the simulated time in [s].
        stop: Asked every tick, or as `Patient` says, and all the time while kernels are compiled; a reason ends the
            run as interrupted, its log complete.
        files: Model files to use instead of those the scenario names, such as those of a log.
        view: Whether to show it in MuJoCo's window, no faster than real time.
        announce: Told a line for the user before something long.
        solver: Used instead of the one the scenario names.
        tape: Takes ticks and events, beside the log if one is written.
        belief: The controller's model and gait if they have been loaded before; read from their files if not.
        prepared: Whether to compile what is missing here and now, not in processes beside this one; `stop` is then
            asked once a tick and at no other time.

    Raises:
        KeyboardInterrupt: stopped while kernels were compiled, before the run began.
        UserError: a file or a setting is not legal, the log cannot be written, or there is no display.
    """
    if view:
        check_display()
    files = files or ModelFiles.of(scenario)
    if not prepared:
        prepare(scenario, stop=stop, announce=announce)
    belief = belief or load_belief(scenario, files)
    controller = build_controller(scenario.controller, belief, solver=solver)
    plant = build_plant(scenario, files, pictures=view)
    course = _course(scenario, belief, plant)
    plant.reset(course.q, course.dq, course.stance)
    warm_up(controller, plant.observe())

    def loop(tape: Tape) -> RunSummary:
        walker = instrument(plant, scenario)
        with viewer(plant, scenario.controller.period, stop) if view else contextlib.nullcontext(stop) as ask:
            with hangs_end(controller):
                run = Loop(plant=walker, controller=controller, course=course, tape=tape)
                return run.run(progress=progress, stop=ask, log=_text(log) if log else "")

    if log is None:
        return loop(tape or NoTape())
    with Recorder(log, _header(scenario, belief, plant, files), scenario.controller.period) as recorder:
        summary = loop(Tapes(recorder, tape) if tape else recorder)
        recorder.result(summary)
    return summary


def prepare(scenario: Scenario, *, stop: Stop | None = None, announce: Announce | None = None) -> None:
    """Compile the kernels of a run that are not on disk yet.

    Args:
        scenario: Of the run.
        stop: Asked all the time.
        announce: Told a line for the user if it takes long.

    Raises:
        KeyboardInterrupt: stopped.
    """
    kind, plant = scenario.controller.kind, scenario.plant.kind
    if kernels.ready(kind, plant):
        return
    if announce:
        announce(kernels.ONCE)
    kernels.prepare(kind, plant, stop=stop or (lambda: None))
    if stop and stop():
        raise KeyboardInterrupt


def _text(path: Path) -> str:
    """A path as text, with escapes where it is none."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")


def _header(scenario: Scenario, belief: Belief, plant: Walker, files: ModelFiles) -> RunHeader:
    """What the log says before the first tick; attachments are enough to run it again."""
    lengths = {
        f"{leg}_{part}": length
        for leg, both in zip(LEGS, plant.legs.lengths, strict=True)
        for part, length in zip(("femur", "tibia"), both, strict=True)
    }
    walk_length = _walk_length(scenario)
    terrain = Terrain(scenario.plant.ground, seed=scenario.seed, length=walk_length)
    git = provenance.git_state()
    fits, kind = scenario.controller.gait_fitting.enabled, scenario.controller.kind
    law = outside.find(kind).text if kind not in BUILT_IN else b""
    return RunHeader(
        scenario_name=scenario.name,
        scenario_toml=to_toml(scenario),
        seed=scenario.seed,
        versions=provenance.package_versions(),
        git_revision=git.revision,
        git_dirty=git.dirty,
        platform=provenance.platform_name(),
        machine=provenance.machine(),
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        link_lengths={"torso": 2.0 * belief.model.torso.com, **lengths},
        ground=terrain.outline(-RUN_UP, walk_length + RUN_UP),
        attachments={
            files.mjcf.name: ("application/xml", files.mjcf.read_bytes()),
            files.urdf.name: ("application/xml", files.urdf.read_bytes()),
            files.gait.name: ("application/toml", files.gait.read_bytes()),
            **({LIBRARY: ("application/json", library_json(files.library))} if fits else {}),
            **({LAW: ("text/x-python", law)} if law else {}),
        },
    )
