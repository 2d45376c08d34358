"""What "40 N to the torso throughout the first step" can mean, and what each reading does to both controllers."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.reproduce import study
from sim.reproduce.measure import SEEN_DEPTH
from sim.reproduce.panels import BLACK, BLUE, GREY, ORANGE, LinePanel, Series

FORCES = (25.0, 30.0, 40.0)  # [N]
STEPS, QUICK_STEPS = 10, 6
TORSO = 0.63  # [m], RABBIT's
PUSH: Mapping[str, Any] = {"pushes.0.force": 0.0, "pushes.0.step": 1}

READINGS: Mapping[str, Mapping[str, Any]] = {
    "at the torso's centre of mass, throughout the step": PUSH,
    "at the top of the torso": {**PUSH, "pushes.0.point": (0.0, TORSO)},
    "at the hip": {**PUSH, "pushes.0.point": (0.0, 0.0)},
    "at the centre of mass, for 0.5 s": {"pushes.0.force": 0.0, "pushes.0.start": 0.0, "pushes.0.end": 0.5},
    "at the centre of mass, no damping in any joint or belief": PUSH,
}
UNDAMPED = "no damping"
COLOURS = (BLACK, ORANGE, BLUE, GREY, BLUE)
DASHES = ("solid", "solid", "solid", "dashed", "dotted")


def tasks(effort: study.Effort) -> Mapping[str, study.Task]:
    """Three forces for each reading, plant and controller."""
    steps = QUICK_STEPS if effort.quick else STEPS
    return {
        f"{plant}/{controller}/{reading}": study.Task(
            function="sim.reproduce.measure:pushed",
            arguments={
                "scenario": effort.scenario(plant, controller, {**changes, "steps": steps}),
                "forces": list(FORCES),
                "undamped": UNDAMPED in reading,
            },
            cost=len(FORCES) * steps * (3.0 if controller == "c-mpc" else 1.0),
        )
        for plant in study.PLANTS
        for controller in study.CONTROLLERS
        for reading, changes in READINGS.items()
    }


def _words(found: study.Arrays) -> str:
    return ", ".join(
        f"{force:g} {'walks' if walked else f'falls in step {steps + 1}'}"
        + (f" ({1e3 * depth:.1f} mm in the ground)" if walked and depth > SEEN_DEPTH else "")
        for force, walked, steps, depth in zip(FORCES, found["walked"], found["steps"], found["scuff"], strict=True)
    )


def _panel(results: study.Results, plant: str, controller: str) -> LinePanel:
    """Steps completed against the force, a line a reading."""
    lines = [
        Series(
            name=reading,
            x=np.array(FORCES),
            y=results[f"{plant}/{controller}/{reading}"]["steps"].astype(float),
            colour=COLOURS[i],
            dash=DASHES[i],
            marker=True,
        )
        for i, reading in enumerate(READINGS)
    ]
    return LinePanel(
        title=f"{study.PLANT_NAMES[plant]}: {study.CONTROLLER_NAMES[controller]}",
        x_label="force [N]",
        y_label="steps completed",
        series=tuple(lines),
    )


def evaluate(results: study.Results, effort: study.Effort) -> study.Evaluation:
    """The paper's sentence under each reading."""

    def sentence(reading: str) -> study.Verdict:
        def judge(plant: str) -> study.Finding:
            zd, mpc = (results[f"{plant}/{controller}/{reading}"] for controller in study.CONTROLLERS)
            text = "; ".join(
                f"{study.CONTROLLER_NAMES[controller]} {_words(found)}"
                for controller, found in zip(study.CONTROLLERS, (zd, mpc), strict=True)
            )
            return study.Finding(text=text, holds=bool(zd["walked"][0] and not zd["walked"][-1] and mpc["walked"][-1]))

        claim = f"{reading}: ZD+PD walks at {FORCES[0]:g} N and falls at {FORCES[-1]:g}, where C-MPC walks"
        return study.Verdict.of(claim, "yes", judge)

    tables = {
        f"{plant}-{controller}": {
            "force [N]": np.array(FORCES),
            **{
                f"{reading}: {what}": results[f"{plant}/{controller}/{reading}"][key].astype(float)
                for reading in READINGS
                for what, key in (("walks", "walked"), ("steps", "steps"), ("swing foot below ground [m]", "scuff"))
            },
        }
        for plant in study.PLANTS
        for controller in study.CONTROLLERS
    }
    return study.Evaluation(
        verdicts=tuple(sentence(reading) for reading in READINGS),
        panels=tuple(
            tuple(_panel(results, plant, controller) for controller in study.CONTROLLERS) for plant in study.PLANTS
        ),
        tables=tables,
        notes=(
            "The paper says neither where on the torso the force attacks nor how long a step lasts that it shortens; "
            f"the force is horizontal in all readings. A run of {QUICK_STEPS if effort.quick else STEPS} steps.",
            f"In the ground: how deep the swing foot of a walker came, where it is more than {1e3 * SEEN_DEPTH:g} mm.",
        ),
    )
