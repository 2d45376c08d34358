"""The abstract's "against noises": standard deviations survived by all of twenty seeds."""

from collections.abc import Mapping

import numpy as np

from sim.reproduce.panels import CONTROLLER_STYLES, LinePanel, Series
from sim.reproduce.study import (
    CONTROLLER_NAMES,
    CONTROLLERS,
    PLANT_NAMES,
    PLANTS,
    Effort,
    Evaluation,
    Finding,
    Results,
    Task,
    Verdict,
)

KINDS = {
    "encoder": (("sensors.angle_noise", "sensors.torso_noise"), 1e-4, "rad"),
    "rate": (("sensors.rate_noise", "sensors.torso_rate_noise"), 1e-2, "rad/s"),
    "torque": (("actuation.noise",), 1.0, "N.m"),
}
"""Kind -> settings that take the standard deviation, least one tried, unit."""

RATIO, RUNGS = 2.0, 12  # standard deviations form a ladder: least * RATIO ** rung
SEEDS, QUICK_SEEDS = 20, 2
STEPS, QUICK_STEPS = 5, 4


def ladder(kind: str) -> np.ndarray:
    """Standard deviations tried for a kind of noise, in its unit."""
    return np.array([float(f"{KINDS[kind][1] * RATIO**rung:.3g}") for rung in range(RUNGS)])


def tasks(effort: Effort) -> Mapping[str, Task]:
    """One search for each plant, controller and kind."""
    return {
        f"{plant}/{controller}/{kind}": Task(
            function="sim.reproduce.measure:largest_noise",
            arguments={
                "scenario": effort.scenario(plant, controller, {"steps": QUICK_STEPS if effort.quick else STEPS}),
                "paths": list(paths),
                "ladder": ladder(kind).tolist(),
                "seeds": QUICK_SEEDS if effort.quick else SEEDS,
            },
            cost=STEPS * (QUICK_SEEDS if effort.quick else SEEDS) * (6.0 if controller == "c-mpc" else 2.0),
        )
        for plant in PLANTS
        for controller in CONTROLLERS
        for kind, (paths, _, _) in KINDS.items()
    }


def evaluate(results: Results, effort: Effort) -> Evaluation:
    """Standard deviations survived."""
    seeds, steps = (QUICK_SEEDS, QUICK_STEPS) if effort.quick else (SEEDS, STEPS)

    def survived(plant: str, controller: str, kind: str) -> float:
        return float(results[f"{plant}/{controller}/{kind}"]["value"])

    def more(kind: str) -> Verdict:
        unit = KINDS[kind][2]

        def judge(plant: str) -> Finding:
            mpc, zd = (survived(plant, controller, kind) for controller in ("c-mpc", "zd-pd"))
            end = float(ladder(kind)[-1])
            shown = [f"{value:.3g}" + (" or more" if value == end else "") for value in (mpc, zd)]
            return Finding(text=f"{shown[0]} against {shown[1]} {unit}", holds=None if zd == end else mpc > zd)

        return Verdict.of(f"C-MPC survives more {kind} noise than ZD+PD (standard deviation)", "more", judge)

    panels, tables = [], {}
    for plant in PLANTS:
        row = []
        for kind, (_, _, unit) in KINDS.items():
            lines = []
            for controller in CONTROLLERS:
                found = results[f"{plant}/{controller}/{kind}"]
                order = np.argsort(found["tried"], kind="stable")
                colour, dash = CONTROLLER_STYLES[controller]
                lines.append(
                    Series(
                        name=CONTROLLER_NAMES[controller],
                        x=found["tried"][order],
                        y=100.0 * found["survived"][order] / seeds,
                        colour=colour,
                        dash=dash,
                        marker=True,
                    )
                )
                tables[f"{kind}-{plant}-{controller}"] = {
                    f"standard deviation [{unit}]": found["tried"][order],
                    f"seeds of {seeds} survived": found["survived"][order],
                }
            row.append(
                LinePanel(
                    title=f"{PLANT_NAMES[plant]}: {kind} noise",
                    x_label=f"standard deviation [{unit}]",
                    y_label="seeds survived [%]",
                    series=tuple(lines),
                    log_x=True,
                    y_range=(-5.0, 105.0),
                )
            )
        panels.append(tuple(row))
    return Evaluation(
        verdicts=tuple(more(kind) for kind in KINDS),
        panels=tuple(panels),
        tables=tables,
        notes=(
            f"The paper gives no noise level. White noise, drawn anew each tick, of the same standard deviation "
            f"on all joints and the torso; survived means that all of {seeds} seeds take {steps} steps. The ladder "
            f"of standard deviations has a ratio of {RATIO:g} and is searched by bisection.",
        ),
    )
