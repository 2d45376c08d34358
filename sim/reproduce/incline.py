"""The video's "unexpected inclinations": the steepest ramps survived, up and down, of three lengths."""

import math
from collections.abc import Mapping

import numpy as np

from sim.reproduce.criteria import INCLINE
from sim.reproduce.panels import CONTROLLER_STYLES, Level, LinePanel, Series
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

LENGTHS = (0.3, 1.0, 3.0)  # [m]
QUICK_LENGTHS = (0.3, 1.0)
DIRECTIONS = {"up": 1.0, "down": -1.0}
START = 1.0  # [m], behind two and a half steps of level ground
STEP = 0.4  # [m]
BEYOND = 4  # steps behind the ramp
STRIDE, RESOLUTION, STEEPEST = 0.04, 0.005, 0.6  # [rad]


def _steps(length: float) -> int:
    """Steps over level ground, ramp, and level ground again."""
    return math.ceil((START + length) / STEP) + BEYOND


def tasks(effort: Effort) -> Mapping[str, Task]:
    """One search for each plant, controller, length and direction."""
    return {
        f"{plant}/{controller}/{length:g}/{direction}": Task(
            function="sim.reproduce.measure:largest_survived",
            arguments={
                "scenario": effort.scenario(
                    plant,
                    controller,
                    {
                        "steps": _steps(length),
                        "plant.ground.ramps.0.slope": 0.0,
                        "plant.ground.ramps.0.start": START,
                        "plant.ground.ramps.0.length": length,
                    },
                ),
                "path": "plant.ground.ramps.0.slope",
                "sign": sign,
                "stride": STRIDE,
                "resolution": 0.5 * STRIDE if effort.quick else RESOLUTION,
                "limit": STEEPEST,
            },
            cost=_steps(length) * (20.0 if controller == "c-mpc" else 6.0),
        )
        for plant in PLANTS
        for controller in CONTROLLERS
        for length in (QUICK_LENGTHS if effort.quick else LENGTHS)
        for direction, sign in DIRECTIONS.items()
    }


def evaluate(results: Results, effort: Effort) -> Evaluation:
    """Slopes against length."""
    lengths = QUICK_LENGTHS if effort.quick else LENGTHS

    def slopes(plant: str, controller: str, direction: str) -> np.ndarray:
        """Steepest slopes survived in [rad], (lengths,)."""
        return np.array([float(results[f"{plant}/{controller}/{length:g}/{direction}"]["value"]) for length in lengths])

    def navigates(direction: str) -> Verdict:
        def judge(plant: str) -> Finding:
            steepest = slopes(plant, "c-mpc", direction)
            text = ", ".join(f"{math.degrees(s):.1f}" for s in steepest) + " deg"
            return Finding(text=text, holds=bool((steepest >= INCLINE).all()))

        of = ", ".join(f"{length:g}" for length in lengths)
        claim = f"C-MPC walks {direction} unexpected ramps of {of} m, {math.degrees(INCLINE):g} deg at least"
        return Verdict.of(claim, "navigates (video)", judge)

    def steeper(direction: str) -> Verdict:
        def judge(plant: str) -> Finding:
            mpc, zd = (slopes(plant, controller, direction) for controller in ("c-mpc", "zd-pd"))
            text = ", ".join(f"{math.degrees(a):.1f}/{math.degrees(b):.1f}" for a, b in zip(mpc, zd, strict=True))
            return Finding(text=f"{text} deg", holds=bool((mpc >= zd).all() and (mpc > zd).any()))

        return Verdict.of(f"{direction}: steeper than ZD+PD at some length, at none less steep", "-", judge)

    panels, tables = [], {}
    for plant in PLANTS:
        lines = []
        for controller in CONTROLLERS:
            colour, dash = CONTROLLER_STYLES[controller]
            for direction, sign in DIRECTIONS.items():
                degrees = sign * np.degrees(slopes(plant, controller, direction))
                name = CONTROLLER_NAMES[controller] if sign > 0 else ""
                x = np.array(lengths)
                lines.append(Series(name=name, x=x, y=degrees, colour=colour, dash=dash, marker=True))
        panels.append(
            LinePanel(
                title=PLANT_NAMES[plant],
                x_label="length of the ramp [m]",
                y_label="steepest slope survived [deg]",
                series=tuple(lines),
                levels=(Level(y=0.0, name="level"),),
            )
        )
        tables[f"slopes-{plant}"] = {
            "length [m]": np.array(lengths),
            **{
                f"{controller} {direction} [rad]": slopes(plant, controller, direction)
                for controller in CONTROLLERS
                for direction in DIRECTIONS
            },
        }
    return Evaluation(
        verdicts=(*(navigates(d) for d in DIRECTIONS), *(steeper(d) for d in DIRECTIONS)),
        panels=(tuple(panels),),
        tables=tables,
        notes=(
            f"The paper gives no slope; ramps begin {START:g} m ahead, are tried every "
            f"{math.degrees(STRIDE):.1f} deg until the walker falls and then bisected; a run ends four "
            "steps behind the ramp.",
            "The rigid plant's foot never slips, and its swing foot passes through ground behind the stance foot.",
        ),
    )
