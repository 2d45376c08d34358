"""Sec. III.E: "starting from N = 2000 ... no drastic changes ... N = 100"."""

from collections.abc import Mapping

import numpy as np

from sim.reproduce import study
from sim.reproduce.criteria import TENTH, no_larger, no_worse, walks
from sim.reproduce.experiments.fig5 import FORCE, PUSHED_STEP, between, rms
from sim.reproduce.panels import BLUE, ORANGE, Level, LinePanel, Series

HORIZONS = (10, 20, 50, 100, 200, 500, 2000)
BESIDE = (100, 200, 2000)
QUICK = (20, 100, 300)
CHOSEN = 100
OFFERED = 200  # ticks; what --controller.horizon 200 does
STEPS = 5
STRIDE, RESOLUTION, BESIDE_RESOLUTION, LARGEST = 16.0, 2.0, 4.0, 200.0  # [N]


def _horizons(effort: study.Effort) -> tuple[int, ...]:
    return QUICK if effort.quick else BESIDE if effort.beside else HORIZONS


def _resolution(effort: study.Effort) -> float:
    return STRIDE if effort.quick else BESIDE_RESOLUTION if effort.beside else RESOLUTION


def tasks(effort: study.Effort) -> Mapping[str, study.Task]:
    """The walk of Fig. 5 and the largest force survived in step 1, for each horizon on both plants."""
    found = {}
    for plant in study.PLANTS:
        for N in _horizons(effort):
            base = {"controller.horizon": N, "steps": 4 if effort.quick else STEPS}
            push = {"pushes.0.force": FORCE, "pushes.0.step": PUSHED_STEP}
            each = STEPS * (1.0 + 0.02 * N)
            found[f"{plant}/{N}/walk"] = study.Task(
                function="sim.reproduce.measure:walk",
                arguments={"scenario": effort.scenario(plant, "c-mpc", {**base, **push})},
                cost=each,
            )
            found[f"{plant}/{N}/margin"] = study.Task(
                function="sim.reproduce.measure:largest_survived",
                arguments={
                    "scenario": effort.scenario(plant, "c-mpc", {**base, "pushes.0.force": 0.0, "pushes.0.step": 1}),
                    "path": "pushes.0.force",
                    "sign": 1.0,
                    "stride": STRIDE,
                    "resolution": _resolution(effort),
                    "limit": LARGEST,
                },
                cost=8.0 * each,
            )
    return found


def _step_by_step(results: study.Results, plant: str, longest: int) -> str:
    """Where the chosen horizon loses against the longest."""
    errors = [
        [
            rms(results[f"{plant}/{N}/walk"]["y"][between(results[f"{plant}/{N}/walk"], step, step)])
            for N in (CHOSEN, longest)
        ]
        for step in range(PUSHED_STEP, STEPS)
    ]
    words = ", ".join(f"{a:.4f} for {b:.4f} in step {PUSHED_STEP + i}" for i, (a, b) in enumerate(errors))
    return f"{study.PLANT_NAMES[plant]}, RMS of y [rad] at N = {CHOSEN} for that at {longest}: {words}."


def evaluate(results: study.Results, effort: study.Effort) -> study.Evaluation:
    """Force, error and tick time against the horizon."""
    horizons = np.array(_horizons(effort))

    def forces(plant: str) -> np.ndarray:
        return np.array([float(results[f"{plant}/{N}/margin"]["value"]) for N in horizons])

    def errors(plant: str) -> np.ndarray:
        runs = [results[f"{plant}/{N}/walk"] for N in horizons]
        walked = [walks(int(run["outcome"])) for run in runs]
        values = [rms(run["y"][between(run, PUSHED_STEP, STEPS)]) for run in runs]
        return np.where(walked, values, np.nan)

    def ticks(plant: str) -> np.ndarray:
        return np.array([float(results[f"{plant}/{N}/walk"]["tick_ms"]) for N in horizons])

    at = int(np.flatnonzero(horizons == CHOSEN)[0])

    def force(plant: str) -> study.Finding:
        chosen, longest = forces(plant)[[at, -1]]
        text = f"{chosen:g} N at N = {CHOSEN}, {longest:g} N at N = {horizons[-1]}"
        return study.Finding(text=text, holds=no_worse(chosen, longest))

    def error(plant: str) -> study.Finding:
        chosen, longest = errors(plant)[[at, -1]]
        text = f"{chosen:.4f} rad at N = {CHOSEN}, {longest:.4f} rad at N = {horizons[-1]}"
        return study.Finding(text=text, holds=no_larger(chosen, longest))

    def longer(plant: str) -> study.Finding:
        """What a horizon of `OFFERED` ticks does."""
        if OFFERED not in horizons:
            return study.Finding(text="not tried", holds=None)
        chosen, longest = errors(plant)[[int(np.flatnonzero(horizons == OFFERED)[0]), -1]]
        text = f"{chosen:.4f} rad at N = {OFFERED}, {longest:.4f} rad at N = {horizons[-1]}"
        return study.Finding(text=text, holds=no_larger(chosen, longest))

    styles = {"rigid": (BLUE, "solid"), "mujoco": (ORANGE, "dashed")}

    def panel(title: str, label: str, values: dict[str, np.ndarray], levels: tuple[Level, ...] = ()) -> LinePanel:
        lines = tuple(
            Series(name=study.PLANT_NAMES[p], x=horizons, y=v, colour=styles[p][0], dash=styles[p][1], marker=True)
            for p, v in values.items()
        )
        axes = {"x_label": "horizon N [ticks]", "y_label": label, "log_x": True}
        return LinePanel(title=title, series=lines, levels=levels, **axes)  # type: ignore[arg-type]

    tables = {
        plant: {
            "N [ticks]": horizons,
            "survived force [N]": forces(plant),
            "RMS deviation [rad]": errors(plant),
        }
        for plant in study.PLANTS
    } | {f"timing-{plant}": {"N [ticks]": horizons, "median tick [ms]": ticks(plant)} for plant in study.PLANTS}
    return study.Evaluation(
        verdicts=(
            study.Verdict.of(
                f"survived force at N = {CHOSEN} at most {TENTH:.0%} below the longest horizon's",
                "no drastic change",
                force,
            ),
            study.Verdict.of(
                f"RMS deviation at N = {CHOSEN} at most {TENTH:.0%} above the longest horizon's",
                "no drastic change",
                error,
            ),
            study.Verdict.of(
                f"RMS deviation at N = {OFFERED} at most {TENTH:.0%} above the longest horizon's",
                "no drastic change",
                longer,
            ),
        ),
        panels=(
            (
                panel("Largest force survived in step 1", "force [N]", {p: forces(p) for p in study.PLANTS}),
                panel("RMS deviation, 25 N in step 2", "RMS of y [rad]", {p: errors(p) for p in study.PLANTS}),
                panel("Tick time", "median [ms]", {p: ticks(p) for p in study.PLANTS}, (Level(y=1.0, name="1 kHz"),)),
            ),
        ),
        tables=tables,
        notes=(
            *(_step_by_step(results, plant, int(horizons[-1])) for plant in study.PLANTS),
            f"N = {OFFERED} is one setting: --controller.horizon {OFFERED}.",
            f"Forces to {_resolution(effort):g} N.",
            "A horizon whose walk falls has no RMS. Tick times are of this machine, and alone not reproducible bit "
            "for bit.",
        ),
    )
