"""The video's "unexpected inclinations": the steepest ramps survived, up and down, of three lengths."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from sim.reproduce import criteria, study
from sim.reproduce.panels import CONTROLLER_STYLES, Level, LinePanel, Series, Span

LENGTHS = (0.3, 1.0, 3.0)  # [m]
QUICK_LENGTHS = (0.3, 1.0)
DIRECTIONS = {"up": 1.0, "down": -1.0}
START = 1.0  # [m], behind two and a half steps of level ground
STEP = 0.4  # [m]
BEYOND = 4  # steps behind the ramp
SHOWN_SLOPE, SHOWN_LENGTH = 0.03, 1.0  # [rad], [m] of the runs that are looked into
SLOW_GAIT, SLOW_LENGTH = "L0.40-v0.80", 3.0  # a gait of the library at 0.8 m/s, [m] of its ramp
SOON = 0.005  # [s] within which a landing confirms that it was expected
ON_RAMP = 2  # steps completed when the first foot reaches for the ramp
IN_THE_AIR = 1e-3  # [m] clearance above which a foot surely does not touch the ground
STRIDE, RESOLUTION, STEEPEST = 0.04, 0.005, 0.6  # [rad]


def _steps(length: float) -> int:
    """Steps over level ground, ramp, and level ground again."""
    return math.ceil((START + length) / STEP) + BEYOND


def _ramp(slope: float, length: float) -> dict[str, Any]:
    return {
        "steps": _steps(length),
        "plant.ground.ramps.0.slope": slope,
        "plant.ground.ramps.0.start": START,
        "plant.ground.ramps.0.length": length,
    }


def tasks(effort: study.Effort) -> Mapping[str, study.Task]:
    """One search for each plant, controller, length and direction, and a walk of each over the same ramp."""
    walks = {
        f"{plant}/{controller}/walk/{direction}": study.Task(
            function="sim.reproduce.measure:walk",
            arguments={
                "scenario": effort.scenario(plant, controller, _ramp(sign * SHOWN_SLOPE, SHOWN_LENGTH)),
            },
            cost=_steps(SHOWN_LENGTH) * (3.0 if controller == "c-mpc" else 1.0),
        )
        for plant in study.PLANTS
        for controller in study.CONTROLLERS
        for direction, sign in DIRECTIONS.items()
    }
    slow = {
        f"{plant}/{controller}/slow": study.Task(
            function="sim.reproduce.measure:walk",
            arguments={
                "scenario": effort.scenario(
                    plant, controller, {**_ramp(criteria.INCLINE, SLOW_LENGTH), "gait": SLOW_GAIT}
                ),
            },
            cost=_steps(SLOW_LENGTH) * (3.0 if controller == "c-mpc" else 1.0),
        )
        for plant in study.PLANTS
        for controller in study.CONTROLLERS
        if not effort.beside  # a gait of its own
    }
    return (
        walks
        | slow
        | {
            f"{plant}/{controller}/{length:g}/{direction}": study.Task(
                function="sim.reproduce.measure:largest_survived",
                arguments={
                    "scenario": effort.scenario(plant, controller, _ramp(0.0, length)),
                    "path": "plant.ground.ramps.0.slope",
                    "sign": sign,
                    "stride": STRIDE,
                    "resolution": 0.5 * STRIDE if effort.quick else RESOLUTION,
                    "limit": STEEPEST,
                },
                cost=_steps(length) * (20.0 if controller == "c-mpc" else 6.0),
            )
            for plant in study.PLANTS
            for controller in study.CONTROLLERS
            for length in (QUICK_LENGTHS if effort.quick else LENGTHS)
            for direction, sign in DIRECTIONS.items()
        }
    )


def _fate(run: study.Arrays) -> str:
    return "walks on" if criteria.walks(int(run["outcome"])) else f"falls in step {int(run['steps']) + 1}"


def _expected(run: study.Arrays) -> np.ndarray:
    """Whether the prediction has the swing foot land within the next tick, tick after tick and in vain, (n,).

    In vain is where the foot is well above the ground and does not land `SOON`. Once, where the foot passes the level
    believed in, is no more than a belief that is wrong.
    """
    t = run["t"]
    landings = np.append(t[run["landed"][run["landed"] < len(t)]], np.inf)
    in_vain = landings[np.searchsorted(landings, t)] - t > SOON
    wrong = (run["impact_in"] == 1) & (run["clearance"] > IN_THE_AIR) & in_vain
    before, after = np.append(False, wrong[:-1]), np.append(wrong[1:], False)
    found: np.ndarray = wrong & (before | after)
    return found


def _speeds(run: study.Arrays) -> str:
    """Mean hip speed of every completed step in [m/s]."""
    landed = [0, *run["landed"][run["landed"] < len(run["t"])].tolist()]
    speeds = [(run["hip"][b, 0] - run["hip"][a, 0]) / (run["t"][b] - run["t"][a]) for a, b in pairwise(landed)]
    return ", ".join(f"{speed:.2f}" for speed in speeds)


def _reasons(results: study.Results, plant: str) -> str:
    """What the runs over the same ramp show."""
    zd, mpc = (results[f"{plant}/{controller}/walk/down"] for controller in study.CONTROLLERS)
    early = _expected(mpc)
    torque = float(np.abs(mpc["u_mpc"][early]).max(initial=0.0))
    down = (
        f"{study.PLANT_NAMES[plant]}, {math.degrees(SHOWN_SLOPE):.1f} deg down for {SHOWN_LENGTH:g} m: "
        f"ZD+PD {_fate(zd)}, C-MPC {_fate(mpc)}; "
        f"in {int(early.sum())} ticks its prediction lands a foot at once that is in the air, and "
        f"the MPC's torque reaches {torque:.0f} N.m in them."
    )
    zd, mpc = (results[f"{plant}/{controller}/walk/up"] for controller in study.CONTROLLERS)
    return (
        f"{down} As much up: ZD+PD {_fate(zd)} at {_speeds(zd)} m/s step by step, C-MPC {_fate(mpc)} at "
        f"{_speeds(mpc)} m/s."
    )


def _late(results: study.Results) -> tuple[str, ...]:
    """What is wrong downhill, where it is."""
    if not any(_expected(results[f"{plant}/c-mpc/walk/down"]).any() for plant in study.PLANTS):
        return ()
    return (
        "C-MPC believes in level ground. Downhill the touch-down is late, and a foot that sinks to the level of the "
        "stance foot lands in the prediction for some ticks in a row, counted below, although it is measured in the "
        "air: the MPC's torque in them is for a step that has not begun.",
    )


def _tripping(results: study.Results, plant: str, lengths: Sequence[float]) -> str:
    """Steepest slopes where a swing foot in the ground is a fall."""
    words = []
    for direction in DIRECTIONS:
        for controller in study.CONTROLLERS:
            found = [float(results[f"{plant}/{controller}/{length:g}/{direction}"]["tripping"]) for length in lengths]
            slopes = " ".join(f"{math.degrees(slope):.1f}" for slope in found)
            words.append(f"{study.CONTROLLER_NAMES[controller]} {direction} {slopes}")
    return f"{study.PLANT_NAMES[plant]}, where a swing foot in the ground is a fall [deg]: {', '.join(words)}."


def _landing(results: study.Results, plant: str) -> LinePanel:
    """The swing foot around the first touch-down on the ramp downwards."""
    lines = []
    spans: tuple[Span, ...] = ()
    for controller in study.CONTROLLERS:
        run = results[f"{plant}/{controller}/walk/down"]
        landed = run["landed"]
        start = int(landed[ON_RAMP - 1]) if len(landed) >= ON_RAMP else 0
        end = int(landed[ON_RAMP]) if len(landed) > ON_RAMP else len(run["t"])
        shown = slice(start, min(end, start + round(1.2 / float(run["t"][1] - run["t"][0]))))
        colour, dash = CONTROLLER_STYLES[controller]
        x, y = run["t"][shown] - run["t"][start], 100.0 * run["clearance"][shown]
        lines.append(Series(name=study.CONTROLLER_NAMES[controller], x=x, y=y, colour=colour, dash=dash))
        at = np.flatnonzero(_expected(run)[shown])
        if controller == "c-mpc" and len(at):
            spans = (Span(x0=float(x[at[0]]), x1=float(x[at[-1]]), name="C-MPC expects it to land at once"),)
    return LinePanel(
        title=f"{study.PLANT_NAMES[plant]}: {math.degrees(SHOWN_SLOPE):.1f} deg down, step {ON_RAMP + 1}",
        x_label="time since the last touch-down [s]",
        y_label="swing foot over the ground [cm]",
        series=tuple(lines),
        levels=(Level(y=0.0),),
        spans=spans,
        y_range=(-1.0, 12.0),
    )


def evaluate(results: study.Results, effort: study.Effort) -> study.Evaluation:
    """Slopes against length."""
    lengths = QUICK_LENGTHS if effort.quick else LENGTHS

    def slopes(plant: str, controller: str, direction: str) -> np.ndarray:
        """Steepest slopes survived in [rad], (lengths,)."""
        return np.array([float(results[f"{plant}/{controller}/{length:g}/{direction}"]["value"]) for length in lengths])

    def navigates(direction: str) -> study.Verdict:
        def judge(plant: str) -> study.Finding:
            steepest = slopes(plant, "c-mpc", direction)
            text = ", ".join(f"{math.degrees(s):.1f}" for s in steepest) + " deg"
            return study.Finding(text=text, holds=bool((steepest >= criteria.INCLINE).all()))

        of = ", ".join(f"{length:g}" for length in lengths)
        claim = f"C-MPC walks {direction} unexpected ramps of {of} m, {math.degrees(criteria.INCLINE):g} deg at least"
        return study.Verdict.of(claim, "navigates (video)", judge)

    def slower(plant: str) -> study.Finding:
        if effort.beside:
            return study.Finding(text="a gait of its own", holds=None)
        runs = [results[f"{plant}/{controller}/slow"] for controller in study.CONTROLLERS]
        text = ", ".join(
            f"{study.CONTROLLER_NAMES[controller]} {_fate(run)}"
            for controller, run in zip(study.CONTROLLERS, runs, strict=True)
        )
        return study.Finding(text=text, holds=all(criteria.walks(int(run["outcome"])) for run in runs))

    def steeper(direction: str) -> study.Verdict:
        def judge(plant: str) -> study.Finding:
            mpc, zd = (slopes(plant, controller, direction) for controller in ("c-mpc", "zd-pd"))
            text = ", ".join(f"{math.degrees(a):.1f}/{math.degrees(b):.1f}" for a, b in zip(mpc, zd, strict=True))
            return study.Finding(text=f"{text} deg", holds=bool((mpc >= zd).all() and (mpc > zd).any()))

        return study.Verdict.of(f"{direction}: steeper than ZD+PD at some length, at none less steep", "-", judge)

    panels, tables = [], {}
    for plant in study.PLANTS:
        lines = []
        for controller in study.CONTROLLERS:
            colour, dash = CONTROLLER_STYLES[controller]
            for direction, sign in DIRECTIONS.items():
                degrees = sign * np.degrees(slopes(plant, controller, direction))
                name = study.CONTROLLER_NAMES[controller] if sign > 0 else ""
                x = np.array(lengths)
                lines.append(Series(name=name, x=x, y=degrees, colour=colour, dash=dash, marker=True))
        panels.append(
            LinePanel(
                title=study.PLANT_NAMES[plant],
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
                for controller in study.CONTROLLERS
                for direction in DIRECTIONS
            },
        }
    return study.Evaluation(
        verdicts=(
            *(navigates(d) for d in DIRECTIONS),
            *(steeper(d) for d in DIRECTIONS),
            study.Verdict.of(
                f"with a gait of 0.8 m/s both walk {math.degrees(criteria.INCLINE):g} deg up over {SLOW_LENGTH:g} m",
                "-",
                slower,
            ),
        ),
        panels=(tuple(panels), tuple(_landing(results, plant) for plant in study.PLANTS)),
        tables=tables,
        notes=(
            f"The paper gives no slope; ramps begin {START:g} m ahead, are tried every "
            f"{math.degrees(STRIDE):.1f} deg until the walker falls and then bisected; a run ends four "
            "steps behind the ramp.",
            "The rigid plant's foot never slips, and its swing foot passes through ground behind the stance foot.",
            *_late(results),
            "Uphill both walkers lose speed; the MPC weighs outputs, not speed. A slower gait is judged beside it.",
            *(_tripping(results, plant, lengths) for plant in study.PLANTS),
            *(_reasons(results, plant) for plant in study.PLANTS),
        ),
    )
