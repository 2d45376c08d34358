"""Fig. 6: the shares of ZD+PD and MPC in C-MPC's torque, 25 N throughout the second step."""

from collections.abc import Callable, Mapping
from typing import Any

from sim.reproduce.fig5 import FORCE, PUSHED, between, rms
from sim.reproduce.panels import JOINT_STYLES, LinePanel, Series, Span, thinned
from sim.reproduce.study import (
    JOINT_NAMES,
    PLANT_NAMES,
    PLANTS,
    Arrays,
    Effort,
    Evaluation,
    Finding,
    Results,
    Task,
    Verdict,
)

STEPS = 12
WINDOWS = {"before": (1, PUSHED - 1), "during": (PUSHED, PUSHED), "after": (9, STEPS)}
"""First and last step of each window."""

NEAR_ZERO = 0.1  # of ZD+PD's RMS in the same window
LARGE = 3.0  # times the RMS before
VANISHED = 1.5  # times the RMS of an undisturbed walk in the same steps


def tasks(effort: Effort) -> Mapping[str, Task]:
    """The pushed and an undisturbed walk under C-MPC on both plants."""
    push: dict[str, Any] = {"pushes.0.force": FORCE, "pushes.0.step": PUSHED}
    return {
        f"{plant}/{name}": Task(
            function="sim.reproduce.measure:walk",
            arguments={"scenario": effort.scenario(plant, "c-mpc", {**changes, "steps": STEPS})},
            cost=3.0 * STEPS,
        )
        for plant in PLANTS
        for name, changes in (("pushed", push), ("undisturbed", {}))
    }


def _rms(run: Arrays, name: str, window: str) -> float:
    return rms(run[name][between(run, *WINDOWS[window])])


def evaluate(results: Results, effort: Effort) -> Evaluation:
    """RMS of both shares in the three windows."""

    def share(name: str, window: str) -> Callable[[str], Finding]:
        def judge(plant: str) -> Finding:
            mpc, zd = (_rms(results[f"{plant}/{name}"], torque, window) for torque in ("u_mpc", "u_zd"))
            return Finding(text=f"{mpc:.2f} of {zd:.2f} N.m: {mpc / zd:.3f}", holds=bool(mpc < NEAR_ZERO * zd))

        return judge

    def during(plant: str) -> Finding:
        now, then = (_rms(results[f"{plant}/pushed"], "u_mpc", window) for window in ("during", "before"))
        return Finding(text=f"{now:.2f} N.m: {now / then:.1f} times", holds=bool(now > LARGE * then))

    def after(plant: str) -> Finding:
        now, usual = (_rms(results[f"{plant}/{name}"], "u_mpc", "after") for name in ("pushed", "undisturbed"))
        return Finding(text=f"{now:.2f} N.m: {now / usual:.2f} times", holds=bool(now < VANISHED * usual))

    panels, tables = [], {}
    for plant in PLANTS:
        run = results[f"{plant}/pushed"]
        row = []
        for name, title in (("u_zd", "ZD+PD share"), ("u_mpc", "MPC share")):
            shown = between(run, 1, 5)
            lines = []
            for i, joint in enumerate(JOINT_NAMES):
                x, y = thinned(run["t"][shown], run[name][shown, i])
                lines.append(Series(name=joint, x=x, y=y, colour=JOINT_STYLES[i][0], dash=JOINT_STYLES[i][1]))
            pushed = between(run, PUSHED, PUSHED)
            ends = run["t"][pushed]
            row.append(
                LinePanel(
                    title=f"{PLANT_NAMES[plant]}: {title}",
                    x_label="time [s]",
                    y_label="torque [N.m]",
                    series=tuple(lines),
                    spans=(Span(x0=float(ends[0]), x1=float(ends[-1]), name=f"{FORCE:g} N"),) if len(ends) else (),
                    y_range=(-150.0, 150.0),
                )
            )
            tables[f"{name}-{plant}"] = {
                "t [s]": run["t"],
                **{f"{joint} [N.m]": run[name][:, i] for i, joint in enumerate(JOINT_NAMES)},
            }
        panels.append(tuple(row))
    return Evaluation(
        verdicts=(
            Verdict.of(
                "MPC share before the push is near zero: RMS below 10 % of ZD+PD's",
                "almost zero",
                share("pushed", "before"),
            ),
            Verdict.of(
                f"and in steps 9 to {STEPS} of an undisturbed walk: RMS below 10 % of ZD+PD's",
                "almost zero",
                share("undisturbed", "after"),
            ),
            Verdict.of(f"MPC share during the push is large: RMS above {LARGE:g} times before", "large", during),
            Verdict.of(
                f"it vanishes again: in steps 9 to {STEPS} RMS below {VANISHED:g} times the undisturbed walk's",
                "reduces again",
                after,
            ),
        ),
        panels=tuple(panels),
        tables=tables,
        notes=(
            "Windows: step 1, step 2 (pushed), steps 9 to 12. RMS over all four joints, impacts included. Step 1 "
            "begins with the exact state after a rigid impact; the steps after it begin with the plant's own impact.",
            "Spikes around impacts beyond 150 N.m are cut off in the figure, and whole in the data.",
        ),
    )
