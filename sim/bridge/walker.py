"""The check of a walker, from its files to its walk."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.belief import WalkerModel, load_gait
from controller.design.check import check, requirements_of
from sim.bridge.convert import STATES as CONVERSION_STATES
from sim.bridge.convert import complaint_of, proof_of
from sim.bridge.run import run_scenario
from sim.errors import UserError
from sim.interface import Vector
from sim.loop import Outcome
from sim.plant.mechanics import Mechanics
from sim.scenario import PlantSettings, Scenario, with_values
from sim.walkers import WalkerFolder

STATES = 50
AGREEMENT = 1e-6  # relative
STEPS = 30
FIRST_CAUSE = "first cause of it"


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """One line of a walker's check.

    Attributes:
        name: What was looked at.
        found: What was found.
        holds: Whether it is as it should be.
    """

    name: str
    found: str
    holds: bool


def check_walker(walker: str, *, steps: int = STEPS, say: Callable[[Stage], None]) -> bool:
    """Check a walker from its files to its walk; returns whether all of it is right.

    Args:
        walker: Name or folder.
        steps: Steps each gait must walk in MuJoCo under each controller.
        say: Told each line as it is known.

    Raises:
        UserError: a file is missing or not a walker at all.
    """
    folder = WalkerFolder.find(walker)
    passed = True
    for stage in _stages(folder, steps):
        say(stage)
        passed = passed and stage.holds
    return passed


def _stages(folder: WalkerFolder, steps: int) -> Iterator[Stage]:
    model = WalkerModel(folder.urdf)
    yield Stage(name="topology", found="five links, four hinges about (0, -1, 0), equal legs, point feet", holds=True)
    yield from _plausible(model)
    yield from _conversion(folder, model)
    yield from _agreement(folder, model)
    gaits = sorted(folder.gaits.glob("*.toml"))
    if not gaits:
        yield Stage(name="gaits", found=f"none in {folder.gaits}; make one: cmpc gait design --walker ...", holds=False)
    for path in gaits:
        yield from _gait(folder, model, path, steps)


def _plausible(model: WalkerModel) -> Iterator[Stage]:
    for name, link in (("torso", model.torso), ("femur", model.femur), ("tibia", model.tibia)):
        complaint = complaint_of(link)
        found = f"{link.mass:g} kg, {link.inertia:g} kg m^2, centre of mass at {link.com:g} m"
        found += f", {link.length:g} m long" if link.length else ""
        yield Stage(name=f"{name} plausible", found=complaint or found, holds=not complaint)


def _agreement(folder: WalkerFolder, model: WalkerModel) -> Iterator[Stage]:
    """The URDF's mass matrix, bias and feet against the MJCF's, at random states."""
    plant = Mechanics(folder.mjcf)
    rng = np.random.default_rng(0)
    worst = {"mass matrix": 0.0, "Coriolis, centrifugal and gravity terms": 0.0, "feet": 0.0}
    for _ in range(STATES):
        q, dq = rng.uniform(-1.0, 1.0, 7), rng.uniform(-3.0, 3.0, 7)
        D, bias, tips = model.unpinned(q, dq)
        there = plant.at(q, dq)
        for name, mine, its in (
            ("mass matrix", D, there.inertia),
            ("Coriolis, centrifugal and gravity terms", bias, there.bias),
            ("feet", tips, there.feet),
        ):
            worst[name] = max(worst[name], float(np.abs(mine - its).max() / np.abs(its).max()))
    for name, value in worst.items():
        yield Stage(
            name=f"MJCF and URDF agree: {name}",
            found=f"within {value:.1e} of it at {STATES} states (must be within {AGREEMENT:g})",
            holds=value <= AGREEMENT,
        )
    if any(value > AGREEMENT for value in worst.values()):
        yield Stage(name=FIRST_CAUSE, found=_first_cause(model, plant), holds=False)
    yield from _joints(model, plant)


def _joints(model: WalkerModel, plant: Mechanics) -> Iterator[Stage]:
    """What acts in the joints, one line each; the order is that of what changes a walk most."""
    mine, its = model.joints, plant.joints
    for name, belief, truth, unit in (
        ("torque limits", model.torque_limits, its.torque_limits, "N.m"),
        ("gears", np.ones(4), its.gear, ""),
        ("rotor inertia (armature)", mine.rotor, its.rotor, "kg m^2"),
        ("dry friction (frictionloss)", mine.friction, its.friction, "N.m"),
        ("damping", mine.damping, its.damping, "N.m.s/rad"),
        ("springs (stiffness)", mine.stiffness, its.stiffness, "N.m/rad"),
        ("slack angles of springs", mine.rest * (mine.stiffness > 0), its.rest * (its.stiffness > 0), "rad"),
        ("lower stops (range)", model.low, its.low, "rad"),
        ("upper stops (range)", model.high, its.high, "rad"),
    ):
        yield Stage(
            name=f"MJCF and URDF agree: {name}",
            found=f"{_joints_of(belief, truth)} {unit}".rstrip(),
            holds=bool(np.allclose(belief, truth, rtol=AGREEMENT, atol=AGREEMENT)),
        )
    usual = PlantSettings().timestep
    yield Stage(
        name="MJCF's timestep",
        found=f"{plant.timestep:g} s; runs take plant.timestep = {usual:g} s",
        holds=bool(np.isclose(plant.timestep, usual)),
    )
    if plant.base:
        words = ", ".join(f"{what} {value:g}" for what, value in plant.base.items())
        yield Stage(name="MJCF's base is free", found=words, holds=False)


def _joints_of(belief: Vector, truth: Vector) -> str:
    """What stands in the URDF and in the MJCF, hips and knees, (4,) each."""
    hips, knees = (f"{_pair(belief[k : k + 2])} and {_pair(truth[k : k + 2])}" for k in (0, 2))
    return f"hips {hips}, knees {knees}"


def _pair(values: Vector) -> str:
    """One number where left and right agree."""
    return f"{values[0]:g}" if values[0] == values[1] else f"{values[0]:g}/{values[1]:g}"


def _first_cause(model: WalkerModel, plant: Mechanics) -> str:
    """The first number in which MJCF and URDF differ, from the torso down."""
    for name, link in plant.links.items():
        mine = {"torso": model.torso, "femur": model.femur, "tibia": model.tibia}[name.rpartition("_")[2]]
        below = (0.0, model.femur.length) if name.endswith("tibia") else (0.0, 0.0)
        for what, belief, truth, unit in (
            ("mass", mine.mass, link.mass, "kg"),
            ("centre of mass along", mine.com, link.com, "m"),
            ("centre of mass across", mine.com_across, link.com_across, "m"),
            ("inertia", mine.inertia, link.inertia, "kg m^2"),
            ("joint's x", below[0], link.joint[0], "m"),
            ("joint's z", below[1], link.joint[1], "m"),
        ):
            if abs(belief - truth) > AGREEMENT * max(abs(belief), abs(truth)) + 1e-12:
                return f"{name}: {what} {belief:g} {unit} in the URDF, {truth:g} {unit} in the MJCF"
    if not np.allclose(model.joints.rotor, plant.joints.rotor, rtol=AGREEMENT):
        return f"rotor inertia (armature): {_joints_of(model.joints.rotor, plant.joints.rotor)} kg m^2"
    return "an axis, a frame's rotation or a foot's place"


def _conversion(folder: WalkerFolder, model: WalkerModel) -> Iterator[Stage]:
    """The made walker against the file as published, where there is one."""
    name = "as published"
    try:
        found = proof_of(folder.urdf.parent, model)
    except UserError as error:
        yield Stage(name=name, found=str(error), holds=False)
        return
    if found is None:
        return
    worst, legal = found
    for what, value in worst.items():
        yield Stage(
            name=f"{name}: {what}",
            found=f"within {value:.1e} of it at {CONVERSION_STATES} states (must be within {legal:.1e})",
            holds=value <= legal,
        )


def _gait(folder: WalkerFolder, model: WalkerModel, path: Path, steps: int) -> Iterator[Stage]:
    try:
        gait = load_gait(path, model)
    except UserError as error:
        yield Stage(name=f"gait {path.stem}", found=str(error), holds=False)
        return
    report = check(model, gait, requirements_of(model, gait))
    violated = [finding.name for finding in report.findings if finding.holds is False]
    found = f"{report.orbit.step_length:.3f} m at {report.orbit.speed:.3f} m/s, delta^2 = {report.orbit.delta**2:.3f}"
    found += f"; violated: {', '.join(violated)}" if violated else ", keeps every requirement"
    yield Stage(name=f"gait {path.stem}", found=found, holds=report.passed)
    for kind in ("zd-pd", "c-mpc"):
        scenario = with_values(
            Scenario(),
            {"walker": str(folder.urdf.parent), "gait": str(path), "steps": steps, "controller.kind": kind},
        )
        run = run_scenario(scenario)
        peak = max(run.peak_torque_Nm.values())
        end = f"peak torque {peak:.1f} N.m" if run.outcome == Outcome.COMPLETED.value else run.fall_reason
        yield Stage(
            name=f"gait {path.stem} walks in MuJoCo, {kind}",
            found=f"{run.outcome}, {run.steps} of {steps} steps, {end}",
            holds=run.outcome == Outcome.COMPLETED.value,
        )
