"""The composition root of `cmpc walker`: a folder from a URDF, and its check from the files to the walk."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.belief import WalkerModel, load_gait
from controller.belief.model import Link
from controller.design.check import check, requirements_of
from sim.bridge.run import run_scenario
from sim.errors import UserError
from sim.loop import Outcome
from sim.plant.mechanics import Mechanics
from sim.scenario import Scenario, with_values
from sim.walkers import WalkerFolder
from sim.walkers import new as walker_files

MASS = (0.05, 200.0)  # [kg] of a link
LENGTH = (0.05, 3.0)  # [m]
GYRATION = 2.0  # largest radius of gyration by the link's length; reflected rotors make 1.35 of rabbit-tac's tibia
STATES = 50
AGREEMENT = 1e-6  # relative
STEPS = 30


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


def new_walker(folder: Path, urdf: Path) -> WalkerModel:
    """Make a walker's folder from its URDF.

    Raises:
        UserError: the URDF is of another topology or implausible, or the folder can not be made.
    """
    model = WalkerModel(urdf)
    for stage in _plausible(model):
        if not stage.holds:
            raise UserError(f"{urdf}: {stage.name}: {stage.found}")
    numbers = {
        f"{name}_{key}": getattr(link, key)
        for name, link in (("torso", model.torso), ("femur", model.femur), ("tibia", model.tibia))
        for key in ("mass", "length", "com", "inertia")
    }
    numbers |= {"hip_torque": model.torque_limits[0], "knee_torque": model.torque_limits[2]}
    numbers |= {"hip_damping": model.damping[0], "knee_damping": model.damping[2]}
    walker_files.create(folder, urdf, numbers)
    return model


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
    yield from _agreement(folder, model)
    gaits = sorted(folder.gaits.glob("*.toml"))
    if not gaits:
        yield Stage(name="gaits", found=f"none in {folder.gaits}; make one: cmpc gait design --walker ...", holds=False)
    for path in gaits:
        yield from _gait(folder, model, path, steps)


def _plausible(model: WalkerModel) -> Iterator[Stage]:
    for name, link in (("torso", model.torso), ("femur", model.femur), ("tibia", model.tibia)):
        complaint = _complaint(link)
        found = f"{link.mass:g} kg, {link.inertia:g} kg m^2, centre of mass at {link.com:g} m"
        found += f", {link.length:g} m long" if link.length else ""
        yield Stage(name=f"{name} plausible", found=complaint or found, holds=not complaint)


def _complaint(link: Link) -> str:
    if not MASS[0] <= link.mass <= MASS[1]:
        unit = "; is that in grams?" if link.mass > MASS[1] else ""
        return f"mass = {link.mass:g} kg; legal: {MASS[0]:g} to {MASS[1]:g} kg{unit}"
    for what, value in (("length", link.length), ("centre of mass", link.com)):
        if value and not value <= LENGTH[1]:
            return f"{what} = {value:g} m; legal: up to {LENGTH[1]:g} m; is that in millimetres?"
    if link.length and link.length < LENGTH[0]:
        return f"length = {link.length:g} m; legal: {LENGTH[0]:g} m or more"
    size = link.length or 2.0 * link.com
    gyration = float(np.sqrt(link.inertia / link.mass))
    if gyration > GYRATION * size:
        return (
            f"inertia = {link.inertia:g} kg m^2: a radius of gyration of {gyration:.3g} m in a link of {size:.3g} m; "
            f"legal: up to {GYRATION:g} times the link"
        )
    return ""


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
            found=f"within {value:.1e} of it at {STATES} states (legal: {AGREEMENT:g})",
            holds=value <= AGREEMENT,
        )
    for name, mine, its, unit in (
        ("torque limits", model.torque_limits, plant.torque_limits, "N.m"),
        ("damping", model.damping, plant.damping, "N.m.s/rad"),
    ):
        yield Stage(
            name=f"MJCF and URDF agree: {name}",
            found=f"hips {mine[0]:g} and {its[0]:g}, knees {mine[2]:g} and {its[2]:g} {unit}",
            holds=bool(np.allclose(mine, its, rtol=AGREEMENT)),
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
