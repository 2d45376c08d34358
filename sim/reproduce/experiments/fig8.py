"""Fig. 8: basins of attraction over torso offset and first-step force."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.reproduce import study
from sim.reproduce.basin import COARSE, EPSILON, STEPS, Fate, Grid
from sim.reproduce.measure import TRIP_DEPTH
from sim.reproduce.panels import BLUE, ORANGE, MapPanel, Region

FORCES = (-40.0, 80.0)  # [N]
READINGS = {
    "torso": ("torso tilted about the hip", (-0.8, 0.8), study.PLANTS, ((25, 31), (13, 16), (7, 5))),
    "q5": (
        "q5 alone: the whole walker tilted about its foot",
        (-0.2, 0.2),
        ("rigid",),
        ((13, 13), (13, 13), (5, 5)),
    ),
}
"""Two readings of "we disturb q5", as `sim.reproduce.basin` calls them: words, offsets in [rad], plants that can do
it, and numbers of offsets and forces in full, for the gait judged beside, and coarse."""

CLASSES = ("neither", "ZD+PD only", "both", "{} only")
COLOURS = ("#f4f4f2", "#d9731a", "#8fb8de", "#1f5fa8")
IMPOSSIBLE = study.Finding(text="cannot be: the swing foot would start in the ground", holds=None)


def _grid(reading: str, effort: study.Effort) -> Grid:
    _, span, _, sizes = READINGS[reading]
    offsets, forces = sizes[2 if effort.quick else 1 if effort.beside else 0]
    return Grid.of((*span, offsets), (*FORCES, forces))


def _maps(effort: study.Effort) -> dict[str, tuple[str, str, Grid]]:
    """Name of a map -> plant, reading, grid."""
    return {
        f"{plant}-{reading}": (plant, reading, _grid(reading, effort))
        for reading, (_, _, plants, _) in READINGS.items()
        for plant in plants
    }


def tasks(effort: study.Effort) -> Mapping[str, study.Task]:
    """A map of one controller a task."""
    return {
        f"{name}/{controller}": study.Task(
            function="sim.reproduce.basin:followed",
            arguments={
                "scenario": effort.scenario(plant, controller),
                "axis": axis,
                "torso": grid.torso.tolist(),
                "force": grid.force.tolist(),
                "epsilon": EPSILON,
                "steps": STEPS,
            },
            cost=0.4 * len(grid.torso) * len(grid.force) * (12.0 if controller == "c-mpc" else 3.0),
        )
        for name, (plant, axis, grid) in _maps(effort).items()
        for controller in study.CONTROLLERS
    }


def table(found: Mapping[str, Mapping[str, Any]], grid: Grid) -> dict[str, np.ndarray]:
    """What `sim.reproduce.basin` found of each controller at every point, a row a point."""
    offsets, forces = np.meshgrid(grid.torso, grid.force)
    columns = {"torso offset [rad]": offsets.ravel(), "force [N]": forces.ravel()}
    for controller, arrays in found.items():
        columns |= {f"{controller} {what}": np.asarray(values).astype(float).ravel() for what, values in arrays.items()}
    return {name: values.astype(int) if _whole(values) else values for name, values in columns.items()}


def _whole(values: np.ndarray) -> bool:
    return bool(np.isfinite(values).all() and (values == values.astype(int)).all())


def panel(
    zd: np.ndarray, other: np.ndarray, grid: Grid, *, title: str, name: str = study.CONTROLLER_NAMES["c-mpc"]
) -> MapPanel:
    """The map of the basins of ZD+PD and of another controller, C-MPC or as it is called."""
    return MapPanel(
        title=title,
        x_label="initial torso offset [rad]",
        y_label="force throughout step 1 [N]",
        x=grid.torso,
        y=grid.force,
        classes=np.where(zd & other, 2, np.where(other, 3, np.where(zd, 1, 0))),
        names=tuple(words.format(name) for words in CLASSES),
        colours=COLOURS,
        regions=_regions(zd, other, grid, name),
    )


def evaluate(results: study.Results, effort: study.Effort) -> study.Evaluation:
    """Areas and boundaries."""
    maps = _maps(effort)
    inside = {
        (name, controller): results[f"{name}/{controller}"]["fate"] == Fate.CONVERGED
        for name in maps
        for controller in study.CONTROLLERS
    }

    def areas(name: str) -> tuple[float, float]:
        cell = maps[name][2].cell
        zd, mpc = (float(inside[name, controller].sum()) * cell for controller in study.CONTROLLERS)
        return zd, mpc

    def larger(reading: str) -> study.Verdict:
        def judge(plant: str) -> study.Finding:
            name = f"{plant}-{reading}"
            if name not in maps:
                return IMPOSSIBLE
            zd, mpc = areas(name)
            ratio = f": {mpc / zd:.2f} times" if zd else ""
            return study.Finding(text=f"{mpc:.2f} against {zd:.2f} rad N{ratio}", holds=mpc > zd)

        return study.Verdict.of(f"{READINGS[reading][0]}: C-MPC's basin is larger (area)", "considerably larger", judge)

    def upward(reading: str) -> study.Verdict:
        def judge(plant: str) -> study.Finding:
            name = f"{plant}-{reading}"
            if name not in maps:
                return IMPOSSIBLE
            zd, mpc = (_top(inside[name, controller], maps[name][2]) for controller in study.CONTROLLERS)
            above, below = int((mpc > zd).sum()), int((mpc < zd).sum())
            both = np.isfinite(zd) & np.isfinite(mpc)
            lift = mpc[both] - zd[both]
            text = f"higher at {above}, lower at {below} of {len(zd)} offsets"
            text += (
                f"; where both survive {lift.mean():+.1f} N in the mean, {lift.min():+.1f} at worst"
                if len(lift)
                else ""
            )
            return study.Finding(text=text, holds=above > 0 and below == 0)

        claim = f"{READINGS[reading][0]}: its upper boundary is nowhere below ZD+PD's, and above it somewhere"
        return study.Verdict.of(claim, "extended from the top", judge)

    def kept(plant: str) -> study.Finding:
        zd, mpc = (inside[f"{plant}-torso", controller] for controller in study.CONTROLLERS)
        share = float((zd & mpc).sum() / zd.sum()) if zd.any() else float("nan")
        return study.Finding(text=f"{100 * share:.1f} %", holds=None)

    def tripping(plant: str) -> study.Finding:
        """Both basins where a swing foot in the ground is a fall."""
        name = f"{plant}-torso"
        grid = maps[name][2]
        kept = {
            controller: inside[name, controller] & ~results[f"{name}/{controller}"]["trips"]
            for controller in study.CONTROLLERS
        }
        zd, mpc = (float(kept[controller].sum()) * grid.cell for controller in study.CONTROLLERS)
        ratio = f": {mpc / zd:.2f} times" if zd else ""
        lost = [int((inside[name, controller] & ~kept[controller]).sum()) for controller in study.CONTROLLERS]
        text = f"{mpc:.2f} against {zd:.2f} rad N{ratio}; ZD+PD loses {lost[0]}, C-MPC {lost[1]} points"
        return study.Finding(text=text, holds=mpc > zd)

    panels, tables, notes = [], {}, []
    for name, (plant, reading, grid) in maps.items():
        zd, mpc = (inside[name, controller] for controller in study.CONTROLLERS)
        panels.append(panel(zd, mpc, grid, title=f"{study.PLANT_NAMES[plant]}: {READINGS[reading][0]}"))
        found = {controller: results[f"{name}/{controller}"] for controller in study.CONTROLLERS}
        tables[f"basin-{name}"] = table(found, grid)
        undecided = sum(int((one["fate"] == Fate.UNDECIDED).sum()) for one in found.values())
        if undecided:
            notes.append(f"{name}: {undecided} points undecided after {STEPS} steps, counted as outside.")
        ran = sum(int(one["run"].sum()) for one in found.values())
        notes.append(f"{name}: {ran} of {2 * len(grid.torso) * len(grid.force)} points were run.")
    sizes = [f"{len(grid.torso)} x {len(grid.force)}" for grid in (_grid(reading, effort) for reading in READINGS)]
    return study.Evaluation(
        verdicts=(
            *(larger(reading) for reading in READINGS),
            study.Verdict.of(
                f"the same, torso tilted, where a swing foot {1e3 * TRIP_DEPTH:g} mm in the ground is a fall",
                "considerably larger",
                tripping,
            ),
            *(upward(reading) for reading in READINGS),
            study.Verdict.of("torso tilted about the hip: points of ZD+PD's basin that C-MPC keeps", "not said", kept),
        ),
        panels=(tuple(panels),),
        tables=tables,
        notes=(
            f"{sizes[0]} offsets and forces, the literal reading {sizes[1]}; both controllers saturated. "
            f"Converged: the state before an impact within {EPSILON:g} rad (rates in units of 4 rad/s) of the "
            "periodic one. Fates in the data: 0 fell, 1 converged, 2 undecided.",
            f"Points are run along the boundaries: cells of {COARSE} points a side with one fate at their corners and "
            "in the middle are taken to have it throughout, which the data say of each point (run = 0). Islands "
            "smaller than that are not seen.",
            "'We disturb q5' is read in two ways. The literal one turns the whole walker about its foot, as the "
            "other four angles are relative to q5; above 0 it starts with the swing foot in the ground, which the "
            "pinned plant ignores and a plant with contact cannot do.",
            *notes,
        ),
    )


def _regions(zd: np.ndarray, other: np.ndarray, grid: Grid, name: str) -> tuple[Region, Region]:
    """Both basins, named with their areas."""
    areas = [float(inside.sum()) * grid.cell for inside in (zd, other)]
    return (
        Region(name=f"{name}, {areas[1]:.1f} rad N", inside=other, colour=BLUE, dash="solid"),
        Region(name=f"ZD+PD, {areas[0]:.1f} rad N", inside=zd, colour=ORANGE, dash="dashed"),
    )


def _top(inside: np.ndarray, grid: Grid) -> np.ndarray:
    """Largest force survived at each offset in [N], (m,); minus infinity where none is."""
    return np.array([grid.force[np.flatnonzero(column)[-1]] if column.any() else -np.inf for column in inside.T])
