"""Fig. 7: friction ratio under 50 N throughout the second step, without and with the friction rows."""

from collections.abc import Mapping

import numpy as np

from sim.reproduce import study
from sim.reproduce.criteria import ROUNDING, above, never_above
from sim.reproduce.experiments.fig5 import between
from sim.reproduce.panels import BLUE, ORANGE, Level, LinePanel, Series, Span, thinned

FORCE, PUSHED, STEPS = 50.0, 2, 6  # [N]
MU = 0.6
SENSITIVITY = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
FLOOR = 2.0  # friction MuJoCo's floor grants, so that a ratio above mu shows instead of a slip
SOFTENED = 1e-2  # [N] softening from which the friction rows could not be kept
SETTLING = 20  # ticks after an impact whose forces are those of the impact (MuJoCo spreads it over them)


def tasks(effort: study.Effort) -> Mapping[str, study.Task]:
    """C-MPC with and without friction rows for several coefficients, on both plants."""
    found = {}
    for plant in study.PLANTS:
        for mu in (MU,) if effort.quick else SENSITIVITY:
            found[f"{plant}/with/{mu:g}"] = _task(effort, plant, True, mu)
        found[f"{plant}/without"] = _task(effort, plant, False, MU)
    return found


def _task(effort: study.Effort, plant: str, rows: bool, mu: float) -> study.Task:
    changes = {
        "pushes.0.force": FORCE,
        "pushes.0.step": PUSHED,
        "steps": STEPS,
        "controller.friction_rows": rows,
        "controller.friction": mu,
        "plant.ground.friction": FLOOR,
    }
    return study.Task(
        function="sim.reproduce.measure:walk",
        arguments={"scenario": effort.scenario(plant, "c-mpc", changes)},
        cost=3.0 * STEPS,
    )


def ratio(run: study.Arrays, name: str = "force") -> np.ndarray:
    """|F_T / F_N| of the stance foot, NaN just after impacts and where nothing presses, (n,).

    Args:
        run: The walk.
        name: "force", the mean over each hold, or "force_now", what the controller's model says of the tick itself.
    """
    tangential, normal = run[name].T
    found = np.full(len(run["t"]), np.nan)
    presses = normal > 1.0  # [N]
    found[presses] = np.abs(tangential[presses]) / normal[presses]
    for k in (0, *run["landed"].tolist()):
        found[max(k - 1, 0) : k + SETTLING] = np.nan
    return found


def _worst(run: study.Arrays, name: str = "force") -> float:
    values = ratio(run, name)[between(run, 1, STEPS)]
    return float(np.nanmax(values)) if np.isfinite(values).any() else float("nan")


def _softened(run: study.Arrays, plant: str) -> str:
    """Whether the rows could be kept in those ticks in which the ratio is above mu."""
    values, slack = ratio(run)[between(run, 1, STEPS)], run["slack"][between(run, 1, STEPS)]
    over = np.nan_to_num(values) > MU * (1.0 + ROUNDING)
    if not over.any():
        return f"{study.PLANT_NAMES[plant]}: no tick above mu."
    kept = over & (slack < SOFTENED)
    return (
        f"{study.PLANT_NAMES[plant]}: {int(over.sum())} ticks above mu, "
        f"the rows softened in {int((over & ~kept).sum())} of them; "
        f"the largest ratio in the others is {float(values[kept].max()) if kept.any() else MU:.3f}."
    )


def evaluate(results: study.Results, effort: study.Effort) -> study.Evaluation:
    """Largest ratios."""

    def with_rows(plant: str) -> study.Finding:
        worst = _worst(results[f"{plant}/with/{MU:g}"])
        return study.Finding(text=f"{worst:.4f}", holds=never_above(worst, MU))

    def at_the_tick(plant: str) -> study.Finding:
        worst = _worst(results[f"{plant}/with/{MU:g}"], "force_now")
        return study.Finding(text=f"{worst:.4f}", holds=never_above(worst, MU))

    def without_rows(plant: str) -> study.Finding:
        worst = _worst(results[f"{plant}/without"])
        return study.Finding(text=f"{worst:.3f}", holds=above(worst, MU))

    panels, tables = [], {}
    sensitivity, softened = [], []
    for plant in study.PLANTS:
        row = []
        for name, title, colour in (
            ("without", "without friction rows", ORANGE),
            (f"with/{MU:g}", "with friction rows", BLUE),
        ):
            run = results[f"{plant}/{name}"]
            shown = between(run, 1, 4)
            x, y = thinned(run["t"][shown], ratio(run)[shown])
            pushed = run["t"][between(run, PUSHED, PUSHED)]
            row.append(
                LinePanel(
                    title=f"{study.PLANT_NAMES[plant]}: C-MPC {title}",
                    x_label="time [s]",
                    y_label="|F_T / F_N|",
                    series=(Series(name="", x=x, y=y, colour=colour),),
                    levels=(Level(y=MU, name=f"mu = {MU:g}"),),
                    spans=(Span(x0=float(pushed[0]), x1=float(pushed[-1]), name=f"{FORCE:g} N"),)
                    if len(pushed)
                    else (),
                    y_range=(0.0, 1.0),
                )
            )
            tables[f"ratio-{plant}-{name.partition('/')[0]}"] = {
                "t [s]": run["t"],
                "tangential [N]": run["force"][:, 0],
                "normal [N]": run["force"][:, 1],
                "ratio": ratio(run),
                "ratio at the tick": ratio(run, "force_now"),
            }
        panels.append(tuple(row))
        softened.append(_softened(results[f"{plant}/with/{MU:g}"], plant))
        if not effort.quick:
            worst = np.array([_worst(results[f"{plant}/with/{mu:g}"]) for mu in SENSITIVITY])
            steps = np.array([int(results[f"{plant}/with/{mu:g}"]["steps"]) for mu in SENSITIVITY])
            tables[f"sensitivity-{plant}"] = {
                "mu": np.array(SENSITIVITY),
                "largest ratio": worst,
                "steps walked": steps,
            }
            listed = ", ".join(
                f"{w:.3f} at {mu:g}" + ("" if s >= STEPS else f" (falls in step {s + 1})")
                for mu, w, s in zip(SENSITIVITY, worst, steps, strict=True)
            )
            sensitivity.append(f"Sensitivity, {study.PLANT_NAMES[plant]}: largest ratio {listed}.")
    return study.Evaluation(
        verdicts=(
            study.Verdict.of(
                "with the friction rows the ratio is never above mu at the tick, where they act",
                f"at most mu = {MU:g}",
                at_the_tick,
            ),
            study.Verdict.of(
                "nor is the ratio of the means over the hold that follows", f"at most mu = {MU:g}", with_rows
            ),
            study.Verdict.of("without them it is above mu", f"above mu = {MU:g}", without_rows),
        ),
        panels=tuple(panels),
        tables=tables,
        notes=(
            f"The paper gives no mu; {MU:g} is chosen. MuJoCo's floor grants {FLOOR:g}, so that no foot slips.",
            "Ratios without the 20 ms after each impact: of the force at the tick, by the controller's model, which "
            "the rows bound, and of the means over the hold of 1 ms that follows, in the plant. Figure and sensitivity "
            "show the means.",
            "'As long as there is a possible solution': " + " ".join(softened),
            *sensitivity,
        ),
    )
