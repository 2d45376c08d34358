"""What worker processes do: run scenarios and bring back plain arrays."""

import functools
import math
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.interface import JOINTS, Vector
from sim.loop import FallCriteria, NoTape, Outcome, Ticks
from sim.scenario import Scenario, from_toml, with_values
from sim.stability.rig import Rig
from sim.trials.plan.margin import between, bracket
from sim.walkers import ModelFiles

_SWAPPED = np.array([1, 0, 3, 2])
TRIP_DEPTH = FallCriteria.of_leg(0.8, trips=True).scuff_depth  # [m] of RABBIT, whose leg is 0.8 m
SEEN_DEPTH = 2e-4  # [m] below which a swing foot in the ground is no more than what contact itself gives way
OUTCOMES = tuple(outcome.value for outcome in Outcome)


class Record(NoTape):
    """A tape in memory: what the figures are made of; joints in stance order."""

    def __init__(self, limits: Vector) -> None:
        """Args: limits: torque limits in [N.m], (4,), body order."""
        self._limits = limits
        self._parts: list[tuple[NDArray[Any], ...]] = []
        self._landed: list[int] = []

    def ticks(self, ticks: Ticks) -> None:
        """Keep ticks."""
        state, step = ticks.state, ticks.step
        self._parts.append(
            tuple(
                column.copy()
                for column in (
                    state["q"], step["y"], step["dy"], step["u_zd"], step["u_mpc"], step["u_total"], state["hip"],
                    state["foot"].reshape(-1, 4), state["contact_force"], state["clearance"], step["slack"],
                    step["impact_in"], step["stance"], step["contact_force"],
                )
            )
        )  # fmt: skip

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Keep when a foot lands."""
        if name == "impact":
            self._landed.append(k)

    def arrays(self, period: float) -> dict[str, NDArray[Any]]:
        """Time histories in SI units.

        "t" (n,), "q" (n, 5) body order, "y", "dy", "u_zd", "u_mpc", "u", "torque" (n, 4) stance order, "hip"
        (n, 2), "foot" (n, 4), "force" (n, 2) tangential and normal force on the stance foot over each hold,
        "stance" (n,) 0 left, "force_now" (n, 2) what the controller's model
        says of that force at the tick itself, where its constraint acts, "slack" (n,) [N] by which friction rows were
        softened anywhere in the horizon, "clearance" (n,) of the swing foot over the ground, "impact_in" (n,) ticks to
        the impact the controller expects, -1 for none, "landed" ticks of the touch-downs.
        """
        columns = [np.concatenate(parts) for parts in zip(*self._parts, strict=True)]
        q, y, dy, u_zd, u_mpc, u, hip, foot, forces, clearances, slack, impact_in, stance, force_now = columns
        rows = np.arange(len(stance))
        order = np.where(stance[:, None] == 0, np.arange(4), _SWAPPED)
        joints = {"u_zd": u_zd, "u_mpc": u_mpc, "u": u, "torque": np.clip(u, -self._limits, self._limits)}
        # The state of tick k + 1 carries the mean force over hold k.
        over_hold = np.concatenate((forces[1:], np.full((1, 2, 2), np.nan)))
        return {
            "t": rows * period,
            "q": q,
            "y": y,
            "dy": dy,
            **{name: values[rows[:, None], order] for name, values in joints.items()},
            "hip": hip,
            "foot": foot,
            "force": over_hold[rows, stance],
            "force_now": force_now,
            "stance": stance,
            "slack": slack,
            "clearance": clearances[rows, 1 - stance],
            "impact_in": impact_in,
            "landed": np.array(self._landed, dtype=int),
        }


@functools.lru_cache(maxsize=4)
def _rig(scenario: str) -> Rig:
    from sim.bridge.run import build_rig

    return build_rig(from_toml(scenario))


def walk(scenario: str) -> dict[str, NDArray[Any]]:
    """One run: its time histories (`Record.arrays`), and what it was judged and drawn by.

    "outcome" as an index of `OUTCOMES`, "steps" completed, "torque_limit" (4,) in [N.m], the lower one of both legs,
    infinite where there is none, "femur" (2,) their lengths in [m].
    """
    rig = _rig(scenario)
    record = Record(rig.plant.torque_limits)
    summary = rig.run(record)
    limits = np.array([summary.torque_limit_Nm.get(joint, math.inf) for joint in JOINTS])
    return {
        **record.arrays(rig.scenario.controller.period),
        "outcome": np.array(OUTCOMES.index(summary.outcome)),
        "steps": np.array(summary.steps),
        "tick_ms": np.array(summary.tick_ms["median"]),
        "torque_limit": np.minimum(limits, limits[_SWAPPED]),
        "femur": np.array(rig.surface.legs.lengths)[:, 0],
    }


def _fate(scenario: Scenario) -> tuple[bool, float]:
    """Whether a scenario's steps are completed, and the depth of the swing foot below the ground in [m]."""
    from sim.bridge.run import build_rig

    found = build_rig(scenario).run(NoTape())
    return found.outcome == Outcome.COMPLETED.value, found.scuff_depth_m


def pushed(scenario: str, forces: list[float], undamped: bool = False) -> dict[str, NDArray[Any]]:
    """What becomes of a scenario whose first push has one force after the other.

    Args:
        scenario: The scenario as TOML.
        forces: In [N].
        undamped: Whether the joints have no damping, neither in the plant nor in the controller's belief.

    Returns:
        "walked" (n,), "steps" (n,) completed, "scuff" (n,) the depth of the swing foot below the ground in [m].
    """
    from sim.bridge.run import build_rig

    base = from_toml(scenario)
    with tempfile.TemporaryDirectory() as folder:
        if undamped:
            base = with_values(base, {"walker": _undamped(ModelFiles.of(base), Path(folder))})
        runs = [build_rig(with_values(base, {"pushes.0.force": force})).run(NoTape()) for force in forces]
    return {
        "walked": np.array([run.outcome == Outcome.COMPLETED.value for run in runs]),
        "steps": np.array([run.steps for run in runs]),
        "scuff": np.array([run.scuff_depth_m for run in runs]),
    }


def _undamped(files: ModelFiles, folder: Path) -> str:
    """A copy of a walker without joint damping; its path."""
    there = folder / files.mjcf.stem
    shutil.copytree(files.mjcf.parent, there)
    for file in (files.mjcf, files.urdf):
        copy = there / file.name
        copy.write_text(re.sub(r'damping="[^"]*"', 'damping="0"', file.read_text(encoding="utf-8")), encoding="utf-8")
    return str(there)


def largest_survived(
    scenario: str, path: str, sign: float, stride: float, resolution: float, limit: float
) -> dict[str, NDArray[Any]]:
    """The largest value of a setting that is survived, before the first that is not.

    Args:
        scenario: The scenario as TOML.
        path: Dotted path of the setting.
        sign: 1 for values above 0, -1 for values below.
        stride: Magnitudes are tried upwards in this stride, a whole number of resolutions, until the walker falls;
            then the bracket is halved as that of a margin study is (`sim.trials.plan.margin`).
        resolution: Width of the last bracket.
        limit: Largest magnitude tried.

    Returns:
        "value", a magnitude: survived, while `resolution` more is not (0 if not even the stride is survived);
        "tripping", the same where a swing foot deeper than `TRIP_DEPTH` in the ground is a fall; "tried", "survived"
        and "scuff", the depth of the swing foot below the ground in [m], in the order tried.
    """
    base = from_toml(scenario)
    fates: dict[float, tuple[bool, float]] = {}

    def search(trips: bool) -> float:
        def survived(magnitude: float) -> bool:
            if magnitude not in fates:
                fates[magnitude] = _fate(with_values(base, {path: sign * magnitude}))
            walked, depth = fates[magnitude]
            return walked and not (trips and depth > TRIP_DEPTH)

        known = {0: True}  # by number of resolutions
        wide, last = round(stride / resolution), math.floor(limit / resolution + 1e-9)
        for position in range(wide, last + 1, wide):
            known[position] = survived(position * resolution)
            if not known[position]:
                break
        while (middle := between(1, known)) is not None:
            known[middle] = survived(middle * resolution)
        held, _ = bracket(1, known)
        return (held or 0) * resolution

    value, tripping = search(False), search(True)
    return {
        "value": np.array(value),
        "tripping": np.array(tripping),
        "tried": np.array(list(fates)),
        "survived": np.array([walked for walked, _ in fates.values()]),
        "scuff": np.array([depth for _, depth in fates.values()]),
    }


def noise(scenario: str, paths: list[str], ladder: list[float], same: float, seeds: int) -> dict[str, NDArray[Any]]:
    """The largest standard deviation of a ladder at which every seed is survived, and tracking on one rung.

    Args:
        scenario: The scenario as TOML.
        paths: Settings that take the standard deviation.
        ladder: Standard deviations, ascending.
        same: The rung on which tracking is measured; the bisection starts from it.
        seeds: Number of seeds, from 0.

    Returns:
        "value" (0 if not even the first rung is survived), "tried" and "survived" (number of seeds before the first
        fall), in the order tried, "scuff", the deepest that the swing foot of a survivor at "value" was below the
        ground in [m], and "rms" (seeds,) of the outputs at `same` in [rad], NaN where the walker falls.
    """
    from sim.bridge.run import build_rig

    base = from_toml(scenario)
    counts: dict[float, int] = {}
    depths: dict[float, float] = {}
    rms = np.full(seeds, np.nan)

    def survived(sd: float) -> bool:
        settings = with_values(base, dict.fromkeys(paths, sd))
        counts[sd], depths[sd] = seeds, 0.0
        for seed in range(seeds):
            run = build_rig(with_values(settings, {"seed": seed})).run(NoTape())
            if run.outcome == Outcome.COMPLETED.value:
                depths[sd] = max(depths[sd], run.scuff_depth_m)
                if sd == same and run.output_error_rms_rad is not None:
                    rms[seed] = run.output_error_rms_rad
            else:
                counts[sd] = min(counts[sd], seed)
                if sd != same:
                    break
        return counts[sd] == seeds

    low, high, middle = -1, len(ladder), ladder.index(same)  # rungs
    while high - low > 1:
        low, high = (middle, high) if survived(ladder[middle]) else (low, middle)
        middle = (low + high) // 2
    value = ladder[low] if low >= 0 else 0.0
    return {
        "value": np.array(value),
        "tried": np.array(list(counts)),
        "survived": np.array(list(counts.values())),
        "scuff": np.array(depths.get(value, 0.0)),
        "rms": rms,
    }


def stability(scenario: str, step_sizes: list[float], repeats: int) -> dict[str, NDArray[Any]]:
    """Fixed point and eigenvalues of the step map (`sim.stability.poincare`).

    Returns:
        "converged", "fell_in_step" (0 if the undisturbed walk does not fall within 15 steps), and if 0 "residual",
        "scatter" of the walk on the map, "x", and, if converged, "largest", "eigenvalues" (magnitudes), "h",
        "noise", "roughness", "study_h", "study_largest", "study_jumps".
    """
    from sim.stability import poincare
    from sim.stability.fixed_point import find_fixed_point
    from sim.stability.step_map import Fell

    rig = _rig(scenario)
    summary = rig.run(NoTape(), steps=15)
    fell = 0 if summary.outcome == Outcome.COMPLETED.value else summary.steps + 1
    if fell:
        return {"fell_in_step": np.array(fell), "converged": np.array(False)}
    point = find_fixed_point(rig.step_map, rig.surface, rig.x_gait)
    found = {
        "converged": np.array(point.converged),
        "residual": np.array(point.residual),
        "scatter": np.array(point.scatter),
        "fell_in_step": np.array(fell),
        "x": point.x,
    }
    if not point.converged:
        return found
    try:
        s = poincare.analyse(rig.step_map, rig.surface, point.x, step_sizes=tuple(step_sizes), repeats=repeats)
    except Fell:
        return found
    return found | {
        "largest": np.array(s.largest),
        "eigenvalues": np.abs(s.eigenvalues),
        "h": np.array(s.h),
        "noise": np.array(s.noise),
        "roughness": np.array(s.roughness),
        "study_h": np.array([row.h for row in s.study]),
        "study_largest": np.array([np.nan if row.largest is None else row.largest for row in s.study]),
        "study_jumps": np.array([row.jumps for row in s.study]),
    }
