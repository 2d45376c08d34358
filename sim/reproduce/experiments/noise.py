"""The abstract's "against noises": standard deviations survived by all of twenty seeds, and tracking under the same."""

from collections.abc import Mapping

import numpy as np
from scipy.special import stdtrit

from sim.reproduce import study
from sim.reproduce.measure import SEEN_DEPTH
from sim.reproduce.panels import CONTROLLER_STYLES, LinePanel, Series
from sim.trials.reliability.probability import wilson

KINDS = {
    "encoder": (("sensors.angle_noise", "sensors.torso_noise"), 1e-4, "rad"),
    "rate": (("sensors.rate_noise", "sensors.torso_rate_noise"), 1e-2, "rad/s"),
    "torque": (("actuation.noise",), 1.0, "N.m"),
}
"""Kind -> settings that take the standard deviation, least one tried, unit."""

RATIO, RUNGS = 2.0, 12  # standard deviations form a ladder: least * RATIO ** rung
SAME = {"encoder": 8e-4, "rate": 0.16, "torque": 8.0}  # noise under which tracking is compared, in the kind's unit
SEEDS, BESIDE_SEEDS, QUICK_SEEDS = 20, 10, 2
STEPS, QUICK_STEPS = 5, 4


def ladder(kind: str) -> np.ndarray:
    """Standard deviations tried for a kind of noise, in its unit."""
    return np.array([float(f"{KINDS[kind][1] * RATIO**rung:.3g}") for rung in range(RUNGS)])


def _seeds(effort: study.Effort) -> int:
    return QUICK_SEEDS if effort.quick else BESIDE_SEEDS if effort.beside else SEEDS


def tasks(effort: study.Effort) -> Mapping[str, study.Task]:
    """One search for each plant, controller and kind, which begins where tracking is compared."""
    return {
        f"{plant}/{controller}/{kind}": study.Task(
            function="sim.reproduce.measure:noise",
            arguments={
                "scenario": effort.scenario(plant, controller, {"steps": QUICK_STEPS if effort.quick else STEPS}),
                "paths": list(paths),
                "ladder": ladder(kind).tolist(),
                "same": SAME[kind],
                "seeds": _seeds(effort),
            },
            cost=STEPS * _seeds(effort) * (6.0 if controller == "c-mpc" else 2.0),
        )
        for plant in study.PLANTS
        for controller in study.CONTROLLERS
        for kind, (paths, _, _) in KINDS.items()
    }


def mean_and_half(values: np.ndarray) -> tuple[float, float]:
    """Mean and half its 95 % interval (Student's t); NaN where a run fell."""
    n = len(values)
    half = float(stdtrit(n - 1, 0.975) * values.std(ddof=1) / np.sqrt(n)) if n > 1 else float("nan")
    return float(values.mean()), half


def _scuffing(results: study.Results, plant: str, kind: str) -> str:
    """How deep the survivors' swing feet were in the ground."""
    depths = [1e3 * float(results[f"{plant}/{controller}/{kind}"]["scuff"]) for controller in ("c-mpc", "zd-pd")]
    return f" (swing foot {depths[0]:.1f}/{depths[1]:.1f} mm in the ground)" if max(depths) > 1e3 * SEEN_DEPTH else ""


def evaluate(results: study.Results, effort: study.Effort) -> study.Evaluation:
    """Standard deviations survived."""
    seeds, steps = _seeds(effort), QUICK_STEPS if effort.quick else STEPS
    least = 100.0 * wilson(seeds, seeds)[0]

    def survived(plant: str, controller: str, kind: str) -> float:
        return float(results[f"{plant}/{controller}/{kind}"]["value"])

    def more(kind: str) -> study.Verdict:
        unit = KINDS[kind][2]

        def judge(plant: str) -> study.Finding:
            mpc, zd = (survived(plant, controller, kind) for controller in ("c-mpc", "zd-pd"))
            end = float(ladder(kind)[-1])
            shown = [f"{value:.3g}" + (" or more" if value == end else "") for value in (mpc, zd)]
            text = f"{shown[0]} against {shown[1]} {unit} ({seeds} of {seeds} seeds: {least:.0f} to 100 %)"
            text += _scuffing(results, plant, kind)
            return study.Finding(text=text, holds=None if zd == end else mpc > zd)

        return study.Verdict.of(f"C-MPC survives more {kind} noise than ZD+PD (standard deviation)", "more", judge)

    def tracks(kind: str) -> study.Verdict:
        level = f"{SAME[kind]:g} {KINDS[kind][2]}"

        def judge(plant: str) -> study.Finding:
            mpc, zd = (
                mean_and_half(results[f"{plant}/{controller}/{kind}"]["rms"]) for controller in ("c-mpc", "zd-pd")
            )
            text = " against ".join(
                f"{mean:.4f} +- {half:.4f}" if np.isfinite(mean) else "a fall" for mean, half in (mpc, zd)
            )
            clear = mpc[0] + mpc[1] < zd[0] - zd[1]  # the intervals do not overlap
            return study.Finding(
                text=f"{text} rad", holds=bool(clear) if np.isfinite(zd[0]) else np.isfinite(mpc[0]) or None
            )

        claim = f"C-MPC tracks better than ZD+PD under {kind} noise of {level} (RMS of y, 95 % intervals apart)"
        return study.Verdict.of(claim, "more", judge)

    panels, tables = [], {}
    for plant in study.PLANTS:
        row = []
        for kind, (_, _, unit) in KINDS.items():
            lines = []
            for controller in study.CONTROLLERS:
                found = results[f"{plant}/{controller}/{kind}"]
                order = np.argsort(found["tried"], kind="stable")
                colour, dash = CONTROLLER_STYLES[controller]
                lines.append(
                    Series(
                        name=study.CONTROLLER_NAMES[controller],
                        x=found["tried"][order],
                        y=100.0 * found["survived"][order] / seeds,
                        colour=colour,
                        dash=dash,
                        marker=True,
                    )
                )
                tables[f"{kind}-{plant}-{controller}"] = {
                    f"standard deviation [{unit}]": found["tried"][order],
                    f"seeds of {seeds} survived before the first fall": found["survived"][order],
                }
            row.append(
                LinePanel(
                    title=f"{study.PLANT_NAMES[plant]}: {kind} noise",
                    x_label=f"standard deviation [{unit}]",
                    y_label="seeds survived [%]",
                    series=tuple(lines),
                    log_x=True,
                    y_range=(-5.0, 105.0),
                )
            )
        panels.append(tuple(row))
    return study.Evaluation(
        verdicts=(*(more(kind) for kind in KINDS), *(tracks(kind) for kind in KINDS)),
        panels=tuple(panels),
        tables=tables,
        notes=(
            f"The paper gives no noise level. White noise, drawn anew each tick, of the same standard deviation "
            f"on all joints and the torso; survived means that all of {seeds} seeds take {steps} steps. The ladder "
            f"of standard deviations has a ratio of {RATIO:g} and is searched by bisection. {seeds} survivors of "
            f"{seeds} mean a probability of at least {least:.0f} % (Wilson's 95 % interval).",
            "Depths in brackets are those of the swing foot below the rigid ground, which does not stop it.",
        ),
    )
