"""Seeded search by CMA-ES over numbers above 0, resumable: every evaluation is a line of a file beside the result.

The search is the list of its evaluations. Replaying a saved list brings the optimiser back to where it was, so an
interrupted search goes on as if it had not been.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim.errors import UserError
from sim.interface import Vector

SPREAD = 0.35  # first standard deviation, in natural logarithms of the numbers

Point = tuple[float, ...]
Evaluate = Callable[[Point], float]
"""Value of a point; smaller is better."""

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """A point that was tried.

    Attributes:
        point: The numbers.
        value: Smaller is better.
    """

    point: Point
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """Where to search.

    Attributes:
        start: The first point evaluated; moved into the bounds if it lies outside.
        low: Lower bounds, above 0.
        high: Upper bounds.
    """

    start: Point
    low: Point
    high: Point


def check_out(out: Path) -> Path:
    """The record beside a result file, `.jsonl` for its `.toml`.

    Raises:
        UserError: another ending, no such folder, or the file is there and was not made by a search.
    """
    if out.suffix != ".toml":
        raise UserError(f"--out {out}: must be a name that ends in .toml")
    record = out.with_suffix(".jsonl")
    if not out.parent.is_dir():
        raise UserError(f"--out {out}: {out.parent} is no folder; make it first or choose another path")
    if out.exists() and not record.exists():
        raise UserError(
            f"--out {out}: is there already, and no search's record {record.name} beside it; choose another"
        )
    return record


def recorded(
    evaluate: Evaluate,
    space: Space,
    record: Path,
    head: Mapping[str, Any],
    *,
    seed: int,
    evaluations: int,
    measure: str,
    say: Say,
) -> tuple[Evaluation, int]:
    """Search, or go on with a search, and keep every evaluation.

    Args:
        evaluate: Value of a point.
        space: Where.
        record: File of the evaluations, a JSON object a line.
        head: Its first line: what the search is of, seed and start aside.
        seed: Of CMA-ES.
        evaluations: In all, those in the record included.
        measure: What a value is, in words for the user.
        say: Told of every improvement.

    Returns:
        The best, and how many evaluations the record holds.

    Raises:
        UserError: the record is of another search or cannot be used, or the optimiser is not installed.
    """
    _cma()  # before a record is begun
    known = _resume(record, {**head, "seed": seed, "start": list(space.start)})
    best = min((evaluation.value for evaluation in known), default=float("inf"))
    count = len(known)
    if known:
        say(f"{record}: goes on after {count} evaluations, {measure} {best:.5f} so far")
    with open(record, "a", encoding="utf-8") as file:

        def keep(evaluation: Evaluation) -> None:
            nonlocal best, count
            count += 1
            file.write(json.dumps({"point": evaluation.point, "value": evaluation.value}) + "\n")
            file.flush()
            if evaluation.value < best:
                best = evaluation.value
                say(f"evaluation {count}: {measure} {best:.5f}")

        found = search(evaluate, space, seed=seed, evaluations=evaluations, known=known, keep=keep)
    return found, count


def search(
    evaluate: Evaluate,
    space: Space,
    *,
    seed: int,
    evaluations: int,
    known: Sequence[Evaluation] = (),
    keep: Callable[[Evaluation], None] = lambda evaluation: None,
) -> Evaluation:
    """The best point within a number of evaluations.

    Args:
        evaluate: Value of a point.
        space: Where to search.
        seed: Of CMA-ES.
        evaluations: How many, those already known included.
        known: Evaluations of an interrupted search with the same seed and space: taken instead of evaluating.
        keep: Told each new evaluation.

    Raises:
        UserError: the optimiser is not installed, or `known` is of another search.
    """
    low, high = np.array(space.low), np.array(space.high)
    first = np.clip(np.array(space.start), low, high)
    bounds = np.log(np.column_stack([low, high]))
    optimiser = _cma()(mean=np.log(first), sigma=SPREAD, bounds=bounds, seed=seed)
    done: list[Evaluation] = []

    def value_of(x: Vector) -> float:
        point = tuple(float(number) for number in x)
        if len(done) < len(known):
            evaluation = known[len(done)]
            if not np.allclose(evaluation.point, point, rtol=1e-9):
                raise UserError(
                    f"evaluation {len(done) + 1} of the search to resume is of another point; must be the same request,"
                    " start and seed, or a new file"
                )
        else:
            evaluation = Evaluation(point=point, value=evaluate(point))
            keep(evaluation)
        done.append(evaluation)
        return evaluation.value

    value_of(first)
    while len(done) < evaluations:
        generation = [optimiser.ask() for _ in range(optimiser.population_size)]
        wanted = generation[: evaluations - len(done)]
        values = [(x, value_of(np.exp(x))) for x in wanted]
        if len(wanted) == len(generation):
            optimiser.tell(values)
    return min(done, key=lambda evaluation: evaluation.value)


def _cma() -> Any:
    try:
        from cmaes import CMA
    except ImportError as error:
        raise UserError(
            "the search needs the optimiser cmaes; install it with pip install 'cmpc-walker[design]'"
        ) from error
    return CMA


def _resume(record: Path, head: dict[str, Any]) -> list[Evaluation]:
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
            rows.append(Evaluation(point=tuple(row["point"]), value=float(row["value"])))
        record.write_text("\n".join([first, *lines[: len(rows)]]) + "\n", encoding="utf-8")
        return rows
    except UserError:
        raise
    except OSError as error:
        raise UserError(f"{record}: cannot be read or written: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise UserError(f"{record}: is not the record of a search; choose another --out") from error
