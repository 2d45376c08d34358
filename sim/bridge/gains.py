"""`cmpc gains`: a search on the controller's belief, its record, its result as a scenario."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from controller.belief import Gains
from controller.common import files
from controller.common.toml import quoted
from controller.design import gains as gain_search
from sim import search
from sim.bridge.gaits import belief
from sim.walkers import WalkerFolder

PAPER = (60.0, 90.0, 90.0, 50.0, 10.0, 20.0, 20.0, 10.0)
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
    say: search.Say,
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
    record = search.check_out(out)
    known_belief = belief(gait, walker)
    model = known_belief.model

    def score(gains: Sequence[float]) -> gain_search.Score:
        return gain_search.score(model, known_belief.gait, _gains(gains), period)

    found, count = search.recorded(
        lambda point: score(point).value,
        search.Space(
            start=(*kp, *kd), low=tuple(gain_search.LOWEST.tolist()), high=tuple(gain_search.HIGHEST.tolist())
        ),
        record,
        {"fingerprint": model.fingerprint, "gait": known_belief.gait.name, "period": period},
        seed=seed,
        evaluations=evaluations,
        measure="score",
        say=say,
    )
    result: dict[str, Any] = {"evaluations": count, "seed": seed}
    for name, gains in (("start", (*kp, *kd)), ("paper", PAPER), ("found", found.point)):
        its = score(gains)
        result[name] = {
            "kp": list(gains[:4]),
            "kd": list(gains[4:]),
            "score": its.value,
            "largest": its.largest,
            "eigenvalues": list(its.eigenvalues),
            "torque_excess": its.torque_excess,
        }
    if result["found"]["score"] > result["start"]["score"]:  # a start outside the bounds that was moved into them
        say("nothing better than the start was found: the start is kept")
        result["found"] = result["start"]
    files.write(out, _scenario(WalkerFolder.find(walker), known_belief.path, result, period))
    return result


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
            f"walker = {quoted(folder.name if folder.is_shipped else str(folder.urdf.parent))}",
            f"gait = {quoted(gait.stem if shipped else os.path.abspath(gait))}",
            "",
            "[controller]",
            f"kp = {[round(x, 6) for x in found['kp']]}  # [1/s^2]",
            f"kd = {[round(x, 6) for x in found['kd']]}  # [1/s]",
            f"period = {period!r}  # [s]",
            "",
        ]
    )


def _gains(numbers: Sequence[float]) -> Gains:
    return Gains(kp=np.array(numbers[:4], dtype=float), kd=np.array(numbers[4:], dtype=float))
