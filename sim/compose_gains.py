"""The composition root of `cmpc gains`: a search on the controller's belief, its record, its result as a scenario."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from controller.design import gains as gain_search
from controller.design import gait_file
from controller.kernels import Gains
from sim.compose_design import as_user_errors, belief, check_folder
from sim.errors import UserError
from sim.walkers import WalkerFolder

Say = Callable[[str], None]

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
    check_folder(out)
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
