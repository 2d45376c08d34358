"""Fig. 5: deviation from the gait under 25 N throughout the second step, and what remains undisturbed."""

from collections.abc import Mapping

import numpy as np

from sim.reproduce import study
from sim.reproduce.criteria import TENTH, negligible, walks
from sim.reproduce.panels import JOINT_STYLES, LinePanel, Series, Span, same_scale, thinned

FORCE: float = study.PUSHED["pushes.0.force"]  # [N]
PUSHED_STEP: int = study.PUSHED["pushes.0.step"]
STEADY_FROM = 10  # steps that an undisturbed walk is given to settle


def tasks(effort: study.Effort) -> Mapping[str, study.Task]:
    """A pushed and an undisturbed walk of both controllers on both plants."""
    runs = {"pushed": study.PUSHED, "steady": study.UNDISTURBED}
    return {
        f"{plant}/{controller}/{name}": study.Task(
            function="sim.reproduce.measure:walk",
            arguments={"scenario": effort.scenario(plant, controller, changes)},
            cost=changes["steps"] * (3.0 if controller == "c-mpc" else 1.0),
        )
        for plant in study.PLANTS
        for controller in study.CONTROLLERS
        for name, changes in runs.items()
    }


def between(run: study.Arrays, first: int, last: int) -> slice:
    """Ticks from the start of step `first` to the end of step `last`, counted from 1, or to the fall."""
    landed = [0, *(int(k) for k in run["landed"]), len(run["t"])]
    return slice(landed[min(first - 1, len(landed) - 1)], landed[min(last, len(landed) - 1)])


def rms(values: np.ndarray) -> float:
    """Root of the mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def evaluate(results: study.Results, effort: study.Effort) -> study.Evaluation:
    """Peak, RMS and remaining error."""

    def both_walk(plant: str) -> study.Finding:
        runs = [results[f"{plant}/{controller}/pushed"] for controller in study.CONTROLLERS]
        walk = [walks(int(run["outcome"])) for run in runs]
        words = [
            "walks on" if on else f"falls in step {int(run['steps']) + 1}" for on, run in zip(walk, runs, strict=True)
        ]
        return study.Finding(text=f"ZD+PD {words[0]}, C-MPC {words[1]}", holds=all(walk))

    def smaller(statistic: str) -> study.Verdict:
        def judge(plant: str) -> study.Finding:
            runs = [results[f"{plant}/{controller}/pushed"] for controller in ("c-mpc", "zd-pd")]
            last = min(int(run["steps"]) for run in runs)  # what follows is falling
            if last < PUSHED_STEP:
                return study.Finding(text=f"one falls in step {last + 1}, before the push is over", holds=False)
            values = []
            for run in runs:
                y = run["y"][between(run, PUSHED_STEP, last)]
                values.append(float(np.abs(y).max()) if statistic == "peak" else rms(y))
            text = f"{values[0]:.4f} against {values[1]:.4f} rad"
            if last < study.PUSHED["steps"]:
                text += f", up to step {last}: then one falls"
            return study.Finding(text=text, holds=values[0] < values[1])

        return study.Verdict.of(f"C-MPC's {statistic} deviation from the push on is smaller", "much smaller", judge)

    def remaining(plant: str) -> study.Finding:
        values = []
        for controller in ("c-mpc", "zd-pd"):
            run = results[f"{plant}/{controller}/steady"]
            values.append(rms(run["y"][between(run, STEADY_FROM + 1, study.UNDISTURBED["steps"])]))
        if not np.isfinite(values).all():
            return study.Finding(text="falls undisturbed", holds=False)
        ratio = values[0] / values[1]
        text = f"{values[0]:.1e} against {values[1]:.1e} rad: {ratio:.3f}"
        return study.Finding(text=text, holds=negligible(*values))

    panels: list[tuple[LinePanel, ...]] = []
    tables = {}
    for plant in study.PLANTS:
        row = []
        for controller in study.CONTROLLERS:
            run = results[f"{plant}/{controller}/pushed"]
            row.append(_panel(run, f"{study.PLANT_NAMES[plant]}: {study.CONTROLLER_NAMES[controller]}"))
            for name in ("pushed", "steady"):
                run = results[f"{plant}/{controller}/{name}"]
                tables[f"error-{plant}-{controller}-{name}"] = {
                    "t [s]": run["t"],
                    **{f"{joint} [rad]": run["y"][:, i] for i, joint in enumerate(study.JOINT_NAMES)},
                }
        panels.append(tuple(row))
    return study.Evaluation(
        verdicts=(
            study.Verdict.of(f"both controllers reject {FORCE:g} N in step {PUSHED_STEP}", "yes", both_walk),
            smaller("peak"),
            smaller("RMS"),
            study.Verdict.of(
                f"undisturbed, ZD+PD's remaining error vanishes under C-MPC: ratio of RMS at most {TENTH:g}",
                "no remaining error",
                remaining,
            ),
        ),
        panels=tuple(same_scale(row, most=0.5) for row in panels),
        tables=tables,
        notes=(
            "Where a walker falls, only the steps both complete are compared.",
            f"Steady RMS over steps {STEADY_FROM + 1} to {study.UNDISTURBED['steps']} of an undisturbed walk, "
            "all outputs.",
        ),
    )


def _panel(run: study.Arrays, title: str) -> LinePanel:
    shown = between(run, 1, 6)
    lines = []
    for i, joint in enumerate(study.JOINT_NAMES):
        x, y = thinned(run["t"][shown], run["y"][shown, i])
        colour, dash = JOINT_STYLES[i]
        lines.append(Series(name=joint, x=x, y=y, colour=colour, dash=dash))
    pushed = between(run, PUSHED_STEP, PUSHED_STEP)
    ends = run["t"][pushed]
    return LinePanel(
        title=title,
        x_label="time [s]",
        y_label="deviation y [rad]",
        series=tuple(lines),
        spans=(Span(x0=float(ends[0]), x1=float(ends[-1]), name=f"{FORCE:g} N"),) if len(ends) else (),
    )
