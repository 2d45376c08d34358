"""Fig. 8: basins of attraction over torso offset and first-step force."""

from collections.abc import Mapping

import numpy as np

from sim.basin import EPSILON, STEPS, Fate, Grid
from sim.reproduce.panels import BLUE, ORANGE, MapPanel, Region
from sim.reproduce.study import (
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

FULL = Grid.of((-0.8, 0.8, 25), (-40.0, 80.0, 31))
COARSE = Grid.of((-0.8, 0.8, 9), (-40.0, 80.0, 7))
TILT = Grid.of((-0.15, 0.25, 9), (-40.0, 80.0, 13))
"""Grid of the other reading of "we disturb q5", rigid plant only."""

CLASSES = ("neither", "ZD+PD only", "both", "C-MPC only")
COLOURS = ("#f4f4f2", "#d9731a", "#8fb8de", "#1f5fa8")


def _maps(effort: Effort) -> dict[str, tuple[str, str, Grid]]:
    """Name of a map -> plant, axis of `sim.basin`, grid."""
    grid = COARSE if effort.quick else FULL
    maps = {plant: (plant, "torso", grid) for plant in PLANTS}
    if not effort.quick:
        maps["rigid, q5 alone"] = ("rigid", "q5", TILT)
    return maps


def tasks(effort: Effort) -> Mapping[str, Task]:
    """A column of a map a task."""
    return {
        f"{name}/{controller}/{i}": Task(
            function="sim.basin:column",
            arguments={
                "scenario": effort.scenario(plant, controller),
                "axis": axis,
                "torso": float(torso),
                "force": grid.force.tolist(),
                "epsilon": EPSILON,
                "steps": STEPS,
            },
            cost=len(grid.force) * (4.0 if controller == "c-mpc" else 1.0),
        )
        for name, (plant, axis, grid) in _maps(effort).items()
        for controller in CONTROLLERS
        for i, torso in enumerate(grid.torso)
    }


def stacked(results: Results, name: str, controller: str, what: str, grid: Grid) -> np.ndarray:
    """Columns of a map side by side, (forces, offsets)."""
    prefix = f"{name}/" if name else ""
    return np.array([results[f"{prefix}{controller}/{i}"][what] for i in range(len(grid.torso))]).T


def converged(results: Results, name: str, controller: str, grid: Grid) -> np.ndarray:
    """Which points come back, (forces, offsets)."""
    found: np.ndarray = stacked(results, name, controller, "fate", grid) == Fate.CONVERGED
    return found


def table(results: Results, name: str, grid: Grid) -> dict[str, np.ndarray]:
    """Fate and steps of both controllers at every point."""
    offsets, forces = np.meshgrid(grid.torso, grid.force)
    columns = {"torso offset [rad]": offsets.ravel(), "force [N]": forces.ravel()}
    for controller in CONTROLLERS:
        for what in ("fate", "steps"):
            columns[f"{controller} {what}"] = stacked(results, name, controller, what, grid).ravel()
    return columns


def panel(zd: np.ndarray, mpc: np.ndarray, grid: Grid, *, title: str) -> MapPanel:
    """The map of both basins."""
    return MapPanel(
        title=title,
        x_label="initial torso offset [rad]",
        y_label="force throughout step 1 [N]",
        x=grid.torso,
        y=grid.force,
        classes=np.where(zd & mpc, 2, np.where(mpc, 3, np.where(zd, 1, 0))),
        names=CLASSES,
        colours=COLOURS,
        regions=_regions(zd, mpc, grid),
    )


def evaluate(results: Results, effort: Effort) -> Evaluation:
    """Areas and boundaries."""
    maps = _maps(effort)
    inside = {
        (name, controller): converged(results, name, controller, grid)
        for name, (_, _, grid) in maps.items()
        for controller in CONTROLLERS
    }

    def areas(name: str) -> tuple[float, float]:
        cell = maps[name][2].cell
        zd, mpc = (float(inside[name, controller].sum()) * cell for controller in CONTROLLERS)
        return zd, mpc

    def larger(plant: str) -> Finding:
        zd, mpc = areas(plant)
        text = f"{mpc:.2f} against {zd:.2f} rad N: {mpc / zd:.2f} times" if zd else f"{mpc:.2f} against 0 rad N"
        return Finding(text=text, holds=mpc > zd)

    def upward(plant: str) -> Finding:
        tops = [_top(inside[plant, controller], maps[plant][2]) for controller in CONTROLLERS]
        both = np.isfinite(tops[0]) & np.isfinite(tops[1])
        if not both.any():
            return Finding(text="no offset survived by both", holds=False)
        lift = (tops[1] - tops[0])[both]
        text = f"by {lift.mean():.1f} N in the mean, higher at {int((lift > 0).sum())} of {int(both.sum())} offsets"
        return Finding(text=text, holds=bool(lift.mean() > 0 and (lift > 0).sum() > both.sum() / 2))

    def kept(plant: str) -> Finding:
        zd, mpc = (inside[plant, controller] for controller in CONTROLLERS)
        share = float((zd & mpc).sum() / zd.sum()) if zd.any() else float("nan")
        return Finding(text=f"{100 * share:.1f} %", holds=None)

    panels, tables, notes = [], {}, []
    for name, (plant, axis, grid) in maps.items():
        zd, mpc = (inside[name, controller] for controller in CONTROLLERS)
        reading = "torso tilted about the hip" if axis == "torso" else "whole walker tilted about the foot"
        panels.append(panel(zd, mpc, grid, title=f"{PLANT_NAMES[plant]}: {reading}"))
        tables[f"basin-{name.replace(', ', '-').replace(' ', '-')}"] = table(results, name, grid)
        if name not in PLANTS:
            area = areas(name)
            notes.append(
                f"Sensitivity, {name}: {area[1]:.2f} (C-MPC) against {area[0]:.2f} (ZD+PD) rad N on "
                f"{len(grid.torso)} x {len(grid.force)} points."
            )
        undecided = sum(
            int((results[f"{name}/{controller}/{i}"]["fate"] == Fate.UNDECIDED).sum())
            for controller in CONTROLLERS
            for i in range(len(grid.torso))
        )
        if undecided:
            notes.append(f"{name}: {undecided} points undecided after {STEPS} steps, counted as outside.")
    grid = maps["rigid"][2]
    return Evaluation(
        verdicts=(
            Verdict.of("C-MPC's basin is larger: area", "considerably larger", larger),
            Verdict.of("its boundary is extended upward (forward forces)", "extended from the top", upward),
            Verdict.of("points of ZD+PD's basin that C-MPC keeps", "not said", kept),
        ),
        panels=(tuple(panels),),
        tables=tables,
        notes=(
            f"{len(grid.torso)} offsets x {len(grid.force)} forces, both controllers saturated. Converged: the "
            f"state before an impact within {EPSILON:g} rad (rates in units of 4 rad/s) of the periodic one. "
            "Fates in the data: 0 fell, 1 converged, 2 undecided.",
            "'We disturb q5' is read as the torso tilting about the hip: q5 alone would tilt the whole walker "
            "about its foot and start it with the other foot in the ground, which a plant with contact cannot do.",
            *notes,
        ),
    )


def _regions(zd: np.ndarray, mpc: np.ndarray, grid: Grid) -> tuple[Region, Region]:
    """Both basins, named with their areas."""
    areas = [float(inside.sum()) * grid.cell for inside in (zd, mpc)]
    return (
        Region(name=f"C-MPC, {areas[1]:.1f} rad N", inside=mpc, colour=BLUE, dash="solid"),
        Region(name=f"ZD+PD, {areas[0]:.1f} rad N", inside=zd, colour=ORANGE, dash="dashed"),
    )


def _top(inside: np.ndarray, grid: Grid) -> np.ndarray:
    """Largest force survived at each offset in [N], NaN where none is, (m,)."""
    return np.array([grid.force[np.flatnonzero(column)[-1]] if column.any() else np.nan for column in inside.T])
