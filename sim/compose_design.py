"""The second composition root: what the design commands need of the controller's side.

Beliefs only: nothing here touches a plant. That a designed gait walks in MuJoCo is for `cmpc run` to show.
"""

import contextlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controller import library
from controller.design import gains as gain_search
from controller.design import gait_file
from controller.design.check import Report, check, requirements_of
from controller.design.optimise import COST_UNIT, Design, design
from controller.design.orbit import periodic_orbit
from controller.design.plot import plot
from controller.design.polish import polish
from controller.design.requirements import Requirements
from controller.errors import ControllerInputError
from controller.gait import Gait, load_gait
from controller.kernels import Gains
from controller.model import WalkerModel
from sim.errors import UserError
from sim.walkers import WalkerFolder

__all__ = [
    "COST_UNIT",
    "Report",
    "belief",
    "check_gait",
    "design_gait",
    "library_gaits",
    "plot_gait",
    "polish_gait",
    "search_gains",
]

Say = Callable[[str], None]


@contextlib.contextmanager
def as_user_errors() -> Iterator[None]:
    """What the controller's side refuses is a user's error here."""
    try:
        yield
    except ControllerInputError as error:
        raise UserError(str(error)) from error


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
    with as_user_errors():
        model = WalkerModel(folder.urdf)
        path = folder.gait(gait)
        return Belief(model=model, gait=load_gait(path, model), path=path)


def check_gait(found: Belief, changes: Mapping[str, Any]) -> Report:
    """Check a gait against the default requirements, some of them changed."""
    with as_user_errors():
        return check(found.model, found.gait, requirements_of(found.model, found.gait, **changes))


def plot_gait(path: Path, found: Belief) -> None:
    """Write a picture of a gait."""
    with as_user_errors():
        plot(path, found.model, found.gait, periodic_orbit(found.model, found.gait))


def polish_gait(found: Belief, out: Path) -> Belief:
    """Write the exactly periodic gait nearest to a gait; returns it."""
    gait = polish(found.model, found.gait)
    orbit = periodic_orbit(found.model, gait)
    remark = f"The exactly periodic gait nearest to {found.gait.name}. Made by: cmpc gait polish {found.path.name}"
    with as_user_errors():
        gait_file.write(out, gait_file.to_toml(found.model, gait, orbit, (remark,)))
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
        say: Told what happens.

    Raises:
        UserError: infeasible, or a file is not legal.
    """
    folder = WalkerFolder.find(walker)
    with as_user_errors():
        model = WalkerModel(folder.urdf)
        need = Requirements(**request)
        start = load_gait(folder.gait(warm), model) if warm else None
        out = out or folder.gaits / library.file_name(need.step_length, need.speed)
        _check_folder(out)
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
        gait_file.write(out, gait_file.to_toml(model, found.gait, found.orbit, (_remark(folder, need, degree, cost),)))
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
        UserError: one of them is infeasible, or a file is not legal.
    """
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
    with ProcessPoolExecutor(workers) as pool:
        for line in pool.map(_library_job, jobs):
            say(line)
    return [folder.gaits / library.file_name(length, speed) for length in lengths for speed in speeds]


def _library_job(job: tuple[str, dict[str, Any], int, int]) -> str:
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
        say=lambda line: None,
    )
    return f"{found.path.name}: cost {made.orbit.cost:.0f} {COST_UNIT['torque']}, delta^2 {made.orbit.delta**2:.3f}"


def _remark(folder: WalkerFolder, need: Requirements, degree: int, cost: str) -> str:
    return (
        f"Made by: cmpc gait design --walker {folder.name} --step-length {need.step_length:g} --speed {need.speed:g} "
        f"--degree {degree} --cost {cost}"
    )


def _check_folder(out: Path) -> None:
    if not out.parent.is_dir():
        raise UserError(f"--out {out}: {out.parent} is no folder; make it first or choose another path")


PAPER = ((60.0, 90.0, 90.0, 50.0), (10.0, 20.0, 20.0, 10.0))
"""K_P [1/s^2] and K_D [1/s] of the paper, to compare with."""


def search_gains(
    walker: str,
    gait: str,
    *,
    kp: Sequence[float],
    kd: Sequence[float],
    period: float,
    evaluations: int,
    seed: int,
    out: Path,
    say: Say,
) -> dict[str, Any]:
    """Search gains, write the best as a scenario with its evidence, and each evaluation beside it.

    Args:
        walker: Name or folder.
        gait: Name or path.
        kp: Start in [1/s^2], (4,).
        kd: Start in [1/s], (4,).
        period: Sampling period in [s].
        evaluations: In all, those of an interrupted search included.
        seed: Of the search.
        out: Scenario to write; `.jsonl` instead of `.toml` for the evaluations.
        say: Told of every improvement.

    Returns:
        Scores of the start, the paper's gains and the best.

    Raises:
        UserError: a file is not legal, or the optimiser is not installed.
    """
    _check_folder(out)
    known_belief = belief(gait, walker)
    model, record = known_belief.model, out.with_suffix(".jsonl")
    head = {"fingerprint": model.fingerprint, "gait": known_belief.gait.name, "period": period, "seed": seed}
    head |= {"kp": list(kp), "kd": list(kd)}
    known = _resume(record, head)
    best = min((value for _, value in known), default=float("inf"))
    if known:
        say(f"{record}: goes on after {len(known)} evaluations")
    count = len(known)
    with open(record, "a", encoding="utf-8") as file:

        def keep(evaluation: gain_search.Evaluation) -> None:
            nonlocal best, count
            gains, value = evaluation
            count += 1
            file.write(json.dumps({"gains": gains, "value": value}) + "\n")
            file.flush()
            if value < best:
                best = value
                say(f"evaluation {count}: score {value:.5f}")

        with as_user_errors():
            found, _ = gain_search.search(
                lambda gains: gain_search.score(model, known_belief.gait, gains, period).value,
                Gains(kp=_array(kp), kd=_array(kd)),
                seed=seed,
                evaluations=evaluations,
                known=known,
                keep=keep,
            )
    result: dict[str, Any] = {"evaluations": max(count, len(known)), "seed": seed}
    for name, (some_kp, some_kd) in (("start", (kp, kd)), ("paper", PAPER), ("found", (found[:4], found[4:]))):
        score = gain_search.score(model, known_belief.gait, Gains(kp=_array(some_kp), kd=_array(some_kd)), period)
        result[name] = {
            "kp": list(some_kp),
            "kd": list(some_kd),
            "score": score.value,
            "largest": score.largest,
            "eigenvalues": list(score.eigenvalues),
            "torque_excess": score.torque_excess,
        }
    with as_user_errors():
        gait_file.write(out, _scenario(WalkerFolder.find(walker), known_belief.path, result, period))
    return result


def _resume(record: Path, head: dict[str, Any]) -> list[gain_search.Evaluation]:
    """Evaluations of an interrupted search; writes the head of a new one."""
    try:
        if not record.exists():
            record.write_text(json.dumps(head) + "\n", encoding="utf-8")
            return []
        first, *lines = record.read_text(encoding="utf-8").splitlines()
        if json.loads(first) != head:
            raise UserError(f"{record}: is of another search ({first}); choose another --out or remove it")
        rows = []
        for line in lines:
            try:
                row = json.loads(line)
            except json.JSONDecodeError:
                break  # the search was stopped while it wrote this line
            rows.append((tuple(row["gains"]), float(row["value"])))
        whole = "\n".join([first, *lines[: len(rows)]]) + "\n"
        record.write_text(whole, encoding="utf-8")
        return rows
    except UserError:
        raise
    except OSError as error:
        raise UserError(f"{record}: cannot be read or written: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise UserError(f"{record}: is not the record of a gain search; choose another --out") from error


def _scenario(folder: WalkerFolder, gait: Path, result: Mapping[str, Any], period: float) -> str:
    """The best gains as a scenario, with the evidence as comments."""

    def line(name: str) -> str:
        row = result[name]
        sizes = ", ".join(f"{x:.4f}" for x in row["eigenvalues"]) or "none, it does not walk"
        return f"# {name}: eigenvalues {sizes}; torque beyond its limit {row['torque_excess']:.1%}"

    found = result["found"]
    shipped = gait.parent == folder.gaits
    return "\n".join(
        [
            f"# Gains by cmpc gains search, {result['evaluations']} evaluations of CMA-ES, seed {result['seed']}.",
            f"# Magnitudes of the eigenvalues of the Poincare map, torque held for {period:g} s:",
            *(line(name) for name in ("start", "paper", "found")),
            'description = "Gains found by cmpc gains search"',
            f"walker = {json.dumps(folder.name if folder.is_shipped else str(folder.urdf.parent))}",
            f"gait = {json.dumps(gait.stem if shipped else os.path.abspath(gait))}",
            "",
            "[controller]",
            f"kp = {[round(x, 6) for x in found['kp']]}  # [1/s^2]",
            f"kd = {[round(x, 6) for x in found['kd']]}  # [1/s]",
            f"period = {period!r}  # [s]",
            "",
        ]
    )


def _array(values: Sequence[float]) -> Any:
    return np.array(values, dtype=float)
