"""What the design commands need of the controller's side.

Beliefs only: nothing here touches a plant. That a designed gait walks in MuJoCo is for `cmpc run` to show.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from controller.belief import Gait, WalkerModel, load_gait
from controller.common import files
from controller.common.records import ROLES
from controller.common.toml import comment
from controller.design import gait_file
from controller.design.check import Report, check, requirements_of
from controller.design.compare import Comparison, compare
from controller.design.optimise import COST_UNIT, Design, design
from controller.design.orbit import periodic_orbit
from controller.design.plot import plot
from controller.design.plot_compare import plot_comparison
from controller.design.polish import polish
from controller.design.requirements import Requirements
from controller.fitting import library
from sim.errors import UserError
from sim.runner import Ended, Pool
from sim.walkers import WalkerFolder

__all__ = [
    "COST_UNIT",
    "ROLES",
    "Report",
    "Requirements",
    "belief",
    "beliefs",
    "check_gait",
    "compare_gaits",
    "design_gait",
    "library_gaits",
    "plot_gait",
    "plot_gaits",
    "polish_gait",
]

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Belief:
    """A walker and one of its gaits.

    Attributes:
        model: Analytic model.
        gait: The gait.
        path: Its file.
    """

    model: WalkerModel
    gait: Gait
    path: Path


def belief(gait: str, walker: str | None) -> Belief:
    """Read a gait and its walker.

    Args:
        gait: Name in the walker's gaits/, or a path.
        walker: Name or folder; where it is not given, the folder above the gait's own, or RABBIT.

    Raises:
        UserError: a file is missing or not legal.
    """
    if walker is None:
        above = Path(gait).resolve().parent.parent
        walker = str(above) if gait.endswith(".toml") and (above / f"{above.name}.urdf").is_file() else "rabbit"
    folder = WalkerFolder.find(walker)
    model = WalkerModel(folder.urdf)
    path = folder.gait(gait)
    return Belief(model=model, gait=load_gait(path, model), path=path)


def beliefs(gaits: Sequence[str], walker: str | None) -> list[Belief]:
    """Read gaits of one walker: the one given, or that of the first gait.

    Raises:
        UserError: a file is missing or not legal, or a gait is for another walker.
    """
    first = belief(gaits[0], walker)
    return [first, *(belief(gait, walker or str(first.model.path.parent)) for gait in gaits[1:])]


def compare_gaits(first: Belief, second: Belief) -> Comparison:
    """Two gaits of one walker side by side."""
    return compare(first.model, first.gait, second.gait)


def plot_gaits(path: Path, model: WalkerModel, found: Comparison) -> None:
    """Write a picture of two gaits."""
    plot_comparison(path, model, found)


def check_gait(found: Belief, changes: Mapping[str, Any]) -> Report:
    """Check a gait against the default requirements, some of them changed."""
    return check(found.model, found.gait, requirements_of(found.model, found.gait, **changes))


def plot_gait(path: Path, found: Belief) -> None:
    """Write a picture of a gait."""
    plot(path, found.model, found.gait, periodic_orbit(found.model, found.gait))


def polish_gait(found: Belief, out: Path, *, force: bool) -> Belief:
    """Write the exactly periodic gait nearest to a gait, over a file that is there if forced; returns it."""
    remark = f"The exactly periodic gait nearest to {found.gait.name}. Made by: cmpc gait polish {found.path.name}"
    check_new_file(out, remark, force=force)
    gait = polish(found.model, found.gait)
    orbit = periodic_orbit(found.model, gait)
    files.write(out, gait_file.to_toml(found.model, gait, orbit, (remark,)))
    return Belief(model=found.model, gait=load_gait(out, found.model), path=out)


def design_gait(
    walker: str,
    request: Mapping[str, Any],
    *,
    degree: int,
    cost: str,
    warm: str | None,
    starts: int,
    name: str | None,
    out: Path | None,
    force: bool,
    say: Say,
) -> tuple[Belief, Design]:
    """Design a gait and write it.

    Args:
        walker: Name or folder.
        request: Fields of `Requirements`.
        degree: Of the Bezier polynomials.
        cost: "torque" or "work".
        warm: Gait to start from, by name or path.
        starts: How many starts must succeed.
        name: Of the gait; the file's stem if not given.
        out: File to write; in the walker's gaits/ if not given.
        force: Whether to write over a file that is there.
        say: Told what happens.

    Raises:
        UserError: infeasible, or a file is not legal.
    """
    folder = WalkerFolder.find(walker)
    model = WalkerModel(folder.urdf)
    need = Requirements(**request)
    start = load_gait(folder.gait(warm), model) if warm else None
    out = out or folder.gaits / library.file_name(need.step_length, need.speed)
    remark = _remark(folder, need, degree, cost, starts)
    check_new_file(out, None if warm else remark, force=force)
    found = design(
        model,
        need,
        degree=degree,
        cost=cost,  # type: ignore[arg-type]
        warm=start,
        starts=starts,
        say=say,
        name=name or out.stem,
    )
    files.write(out, gait_file.to_toml(model, found.gait, found.orbit, (remark,)))
    return Belief(model=model, gait=load_gait(out, model), path=out), found


def library_gaits(
    walker: str,
    lengths: Sequence[float],
    speeds: Sequence[float],
    changes: Mapping[str, Any],
    *,
    degree: int,
    starts: int,
    workers: int,
    fresh: bool,
    say: Say,
) -> list[Path]:
    """Design all gaits of a grid that are not there yet, in parallel; returns their files.

    Args:
        walker: Name or folder.
        lengths: Step lengths in [m].
        speeds: In [m/s].
        changes: Further fields of `Requirements`.
        degree: Of the Bezier polynomials.
        starts: How many starts must succeed for each.
        workers: Processes.
        fresh: Whether to design those again that are there.
        say: Told a line for each gait.

    Raises:
        UserError: a value is between those that file names can tell, a gait is infeasible, or a file is not legal.
    """
    library.check_grid("--step-lengths", "m", lengths)
    library.check_grid("--speeds", "m/s", speeds)
    folder = WalkerFolder.find(walker)
    jobs = []
    for length in lengths:
        for speed in speeds:
            path = folder.gaits / library.file_name(length, speed)
            if fresh or not path.is_file():
                request = {**changes, "step_length": length, "speed": speed}
                jobs.append((str(folder.urdf.parent), request, degree, starts))
            else:
                say(f"{path.name}: is there")
    with Pool(_library_job, workers=workers) as pool:
        for end in pool.run(jobs):
            if end.how is not Ended.DONE:
                raise RuntimeError(f"gait of {end.argument[1]}: {end.message}\n{end.detail}")
            say(end.value)
    return [folder.gaits / library.file_name(length, speed) for length in lengths for speed in speeds]


def _library_job(_: None, job: tuple[str, dict[str, Any], int, int]) -> str:
    walker, request, degree, starts = job
    found, made = design_gait(
        walker,
        request,
        degree=degree,
        cost="torque",
        warm=None,
        starts=starts,
        name=None,
        out=None,
        force=True,
        say=lambda line: None,
    )
    return f"{found.path.name}: cost {made.orbit.cost:.0f} {COST_UNIT['torque']}, delta^2 {made.orbit.delta**2:.3f}"


def _remark(folder: WalkerFolder, need: Requirements, degree: int, cost: str, starts: int) -> str:
    """The command that makes a gait again, but for a warm start."""
    usual = Requirements(step_length=need.step_length, speed=need.speed)
    words = [f"--walker {folder.name} --step-length {need.step_length:g} --speed {need.speed:g}"]
    words.append(f"--degree {degree} --cost {cost} --starts {starts}")
    for field in fields(Requirements):
        value = getattr(need, field.name)
        if value != getattr(usual, field.name):
            numbers = value if isinstance(value, tuple) else (value,)
            words.append(f"--{field.name.replace('_', '-')} {' '.join(f'{number:g}' for number in numbers)}")
    return f"Made by: cmpc gait design {' '.join(words)}"


def check_new_file(out: Path, remark: str | None, *, force: bool) -> None:
    """Refuse, before any work is done for it, to write where there is no folder, or over a file of another making.

    Args:
        out: The file.
        remark: First comment of the file to come, which says what makes it; one that begins with the same is the
            same gait and is made again. None where that does not tell all.
        force: Whether to write over any file.

    Raises:
        UserError: refused.
    """
    if out.exists() and not force:
        try:
            first = out.read_text(encoding="utf-8").partition("\n")[0]
        except (OSError, UnicodeDecodeError):
            first = ""
        if remark is None or first != comment(remark):
            raise UserError(f"{out}: another file is there; choose another --out, or write over it with --force")
    if not out.parent.is_dir():
        raise UserError(f"--out {out}: {out.parent} is no folder; make it first or choose another path")
