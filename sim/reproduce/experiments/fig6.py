"""Fig. 6: the shares of ZD+PD and MPC in C-MPC's torque, 25 N throughout the second step."""

from collections.abc import Callable, Mapping

import numpy as np

from sim.reproduce import study
from sim.reproduce.criteria import TENTH, negligible
from sim.reproduce.experiments.fig5 import FORCE, PUSHED_STEP, between, rms
from sim.reproduce.experiments.fig7 import SETTLING
from sim.reproduce.panels import JOINT_STYLES, LinePanel, Series, Span, thinned

WINDOWS = {"before": (1, PUSHED_STEP - 1), "during": (PUSHED_STEP, PUSHED_STEP), "after": (9, study.PUSHED["steps"])}
"""First and last step of each window; the same for the undisturbed walk."""


def tasks(effort: study.Effort) -> Mapping[str, study.Task]:
    """The pushed and an undisturbed walk under C-MPC on both plants."""
    return {
        f"{plant}/{name}": study.Task(
            function="sim.reproduce.measure:walk",
            arguments={"scenario": effort.scenario(plant, "c-mpc", changes)},
            cost=3.0 * changes["steps"],
        )
        for plant in study.PLANTS
        for name, changes in (("pushed", study.PUSHED), ("undisturbed", study.UNDISTURBED))
    }


def settled(run: study.Arrays) -> np.ndarray:
    """Ticks later than `SETTLING` after an impact, as in Fig. 7, (n,)."""
    found = np.ones(len(run["t"]), dtype=bool)
    for k in run["landed"].tolist():
        found[max(k - 1, 0) : k + SETTLING] = False
    return found


def _rms(run: study.Arrays, name: str, window: str, *, impacts: bool = False) -> float:
    where = between(run, *WINDOWS[window])
    return rms(run[name][where][slice(None) if impacts else settled(run)[where]])


def _text(then: float, beside: float, whole: float) -> str:
    return f"{then:.2f} of {beside:.2f} N.m: {_over(then, beside):.3f} ({whole:.3f} with impacts)"


def _over(value: float, beside: float) -> float:
    return value / beside if beside else float("nan")


def evaluate(results: study.Results, effort: study.Effort) -> study.Evaluation:
    """RMS of both shares in the three windows."""

    def beside_push(window: str) -> Callable[[str], study.Finding]:
        def judge(plant: str) -> study.Finding:
            run = results[f"{plant}/pushed"]
            then, during = (_rms(run, "u_mpc", w) for w in (window, "during"))
            whole = tuple(_rms(run, "u_mpc", w, impacts=True) for w in (window, "during"))
            return study.Finding(text=_text(then, during, _over(whole[0], whole[1])), holds=negligible(then, during))

        return judge

    def beside_zd(plant: str) -> study.Finding:
        run = results[f"{plant}/undisturbed"]
        mpc, zd = (_rms(run, torque, "after") for torque in ("u_mpc", "u_zd"))
        whole = tuple(_rms(run, torque, "after", impacts=True) for torque in ("u_mpc", "u_zd"))
        return study.Finding(text=_text(mpc, zd, _over(whole[0], whole[1])), holds=negligible(mpc, zd))

    after = WINDOWS["after"]
    panels, tables = [], {}
    for plant in study.PLANTS:
        run = results[f"{plant}/pushed"]
        row = []
        for name, title in (("u_zd", "ZD+PD share"), ("u_mpc", "MPC share")):
            shown = between(run, 1, 5)
            lines = []
            for i, joint in enumerate(study.JOINT_NAMES):
                x, y = thinned(run["t"][shown], run[name][shown, i])
                lines.append(Series(name=joint, x=x, y=y, colour=JOINT_STYLES[i][0], dash=JOINT_STYLES[i][1]))
            pushed = between(run, PUSHED_STEP, PUSHED_STEP)
            ends = run["t"][pushed]
            row.append(
                LinePanel(
                    title=f"{study.PLANT_NAMES[plant]}: {title}",
                    x_label="time [s]",
                    y_label="torque [N.m]",
                    series=tuple(lines),
                    spans=(Span(x0=float(ends[0]), x1=float(ends[-1]), name=f"{FORCE:g} N"),) if len(ends) else (),
                    y_range=(-150.0, 150.0),
                )
            )
            tables[f"{name}-{plant}"] = {
                "t [s]": run["t"],
                **{f"{joint} [N.m]": run[name][:, i] for i, joint in enumerate(study.JOINT_NAMES)},
            }
        panels.append(tuple(row))
    return study.Evaluation(
        verdicts=(
            study.Verdict.of(
                f"MPC share is almost zero before the push beside that during: RMS at most {TENTH:g} of it",
                "almost zero",
                beside_push("before"),
            ),
            study.Verdict.of(
                f"it vanishes again: RMS in steps {after[0]} to {after[1]} at most {TENTH:g} of that during",
                "reduces again",
                beside_push("after"),
            ),
            study.Verdict.of(
                f"and without a push: RMS in the same steps at most {TENTH:g} of ZD+PD's",
                "zero without disturbance",
                beside_zd,
            ),
        ),
        panels=tuple(panels),
        tables=tables,
        notes=(
            f"Windows: step 1, step 2 (pushed), steps {after[0]} to {after[1]}. RMS over all four joints without the "
            f"{SETTLING} ms after each impact, as in Fig. 7, and in brackets with them. Step 1 begins with the exact "
            "state after a rigid impact, later ones with the plant's own impact.",
            "Spikes around impacts beyond 150 N.m are cut off in the figure, and whole in the data.",
        ),
    )
