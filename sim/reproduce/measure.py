"""What worker processes do: run scenarios and bring back plain arrays."""

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.interface import Vector
from sim.loop import NoTape, Outcome, Ticks
from sim.scenario import Scenario, from_toml, with_values
from sim.stability.rig import Rig

_SWAPPED = np.array([1, 0, 3, 2])
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
                    step["impact_in"], step["stance"],
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
        "stance" (n,) 0 left, "slack" (n,) [N] by which friction rows were softened anywhere in the horizon,
        "clearance" (n,) of the swing foot over the ground, "impact_in" (n,) ticks to the impact the controller
        expects, -1 for none, "landed" ticks of the touch-downs.
        """
        columns = [np.concatenate(parts) for parts in zip(*self._parts, strict=True)]
        q, y, dy, u_zd, u_mpc, u, hip, foot, forces, clearances, slack, impact_in, stance = columns
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
    """One run: its time histories (`Record.arrays`), "outcome" as an index of `OUTCOMES`, "steps" completed."""
    rig = _rig(scenario)
    record = Record(rig.plant.torque_limits)
    summary = rig.run(record)
    return {
        **record.arrays(rig.scenario.controller.period),
        "outcome": np.array(OUTCOMES.index(summary.outcome)),
        "steps": np.array(summary.steps),
        "tick_ms": np.array(summary.tick_ms["median"]),
    }


def _survives(scenario: Scenario) -> bool:
    from sim.bridge.run import build_rig

    return build_rig(scenario).run(NoTape()).outcome == Outcome.COMPLETED.value


def largest_survived(
    scenario: str, path: str, sign: float, stride: float, resolution: float, limit: float
) -> dict[str, NDArray[Any]]:
    """The largest value of a setting that is survived, before the first that is not.

    Args:
        scenario: The scenario as TOML.
        path: Dotted path of the setting.
        sign: 1 for values above 0, -1 for values below.
        stride: Magnitudes are tried upwards in this stride until the walker falls, then bisected.
        resolution: Width of the last bracket.
        limit: Largest magnitude tried.

    Returns:
        "value", a magnitude: survived, while `resolution` more is not (0 if not even the stride is survived);
        "tried" and "survived", in the order tried.
    """
    base = from_toml(scenario)
    tried: list[float] = []
    fates: list[bool] = []

    def survived(magnitude: float) -> bool:
        tried.append(magnitude)
        fates.append(_survives(with_values(base, {path: sign * magnitude})))
        return fates[-1]

    low, high = 0.0, stride
    while high <= limit and survived(high):
        low, high = high, high + stride
    while high <= limit and high - low > resolution * (1.0 + 1e-9):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if survived(middle) else (low, middle)
    return {"value": np.array(low), "tried": np.array(tried), "survived": np.array(fates)}


def largest_noise(scenario: str, paths: list[str], ladder: list[float], seeds: int) -> dict[str, NDArray[Any]]:
    """The largest standard deviation of a ladder at which every seed is survived, by bisection.

    Args:
        scenario: The scenario as TOML.
        paths: Settings that take the standard deviation.
        ladder: Standard deviations, ascending.
        seeds: Number of seeds, from 0.

    Returns:
        "value" (0 if not even the first rung is survived), "tried" and "survived" (number of seeds before the first
        fall), in the order tried.
    """
    base = from_toml(scenario)
    tried: list[float] = []
    counts: list[int] = []

    def survived(sd: float) -> bool:
        settings = with_values(base, dict.fromkeys(paths, sd))
        seed = 0
        while seed < seeds and _survives(with_values(settings, {"seed": seed})):
            seed += 1
        tried.append(sd)
        counts.append(seed)
        return seed == seeds

    low, high = -1, len(ladder)  # rungs
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if survived(ladder[middle]) else (low, middle)
    value = ladder[low] if low >= 0 else 0.0
    return {"value": np.array(value), "tried": np.array(tried), "survived": np.array(counts)}


def stability(scenario: str, step_sizes: list[float], repeats: int) -> dict[str, NDArray[Any]]:
    """Fixed point and eigenvalues of the step map (`sim.stability.poincare`).

    Returns:
        "converged", "residual", "fell_in_step" (0 if the undisturbed walk does not fall within 15 steps), "scatter"
        of the walk on the map, "x", and, if converged, "largest", "eigenvalues" (magnitudes), "h",
        "noise", "roughness", "study_h", "study_largest", "study_jumps".
    """
    from sim.stability import poincare
    from sim.stability.fixed_point import find_fixed_point
    from sim.stability.step_map import Fell

    rig = _rig(scenario)
    summary = rig.run(NoTape(), steps=15)
    fell = 0 if summary.outcome == Outcome.COMPLETED.value else summary.steps + 1
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
