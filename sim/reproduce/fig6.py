"""Fig. 6: the shares of ZD+PD and MPC in C-MPC's torque, 25 N throughout the second step."""

from collections.abc import Mapping

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
VANISHED = 1.5  # times the RMS before


def tasks(effort: Effort) -> Mapping[str, Task]:
    """The pushed walk under C-MPC on both plants."""
    changes = {"pushes.0.force": FORCE, "pushes.0.step": PUSHED, "steps": STEPS}
    return {
        plant: Task(
            function="sim.reproduce.measure:walk",
            arguments={"scenario": effort.scenario(plant, "c-mpc", changes)},
            cost=3.0 * STEPS,
        )
        for plant in PLANTS
    }


def _rms(run: Arrays, name: str, window: str) -> float:
    return rms(run[name][between(run, *WINDOWS[window])])


def evaluate(results: Results, effort: Effort) -> Evaluation:
    """RMS of both shares in the three windows."""

    def before(plant: str) -> Finding:
        mpc, zd = (_rms(results[plant], name, "before") for name in ("u_mpc", "u_zd"))
        return Finding(text=f"{mpc:.2f} of {zd:.2f} N.m: {mpc / zd:.3f}", holds=bool(mpc < NEAR_ZERO * zd))

    def during(plant: str) -> Finding:
        now, then = (_rms(results[plant], "u_mpc", window) for window in ("during", "before"))
        return Finding(text=f"{now:.2f} N.m: {now / then:.1f} times", holds=bool(now > LARGE * then))

    def after(plant: str) -> Finding:
        now, then = (_rms(results[plant], "u_mpc", window) for window in ("after", "before"))
        return Finding(text=f"{now:.2f} N.m: {now / then:.2f} times", holds=bool(now < VANISHED * then))

    panels, tables = [], {}
    for plant in PLANTS:
        run = results[plant]
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
            Verdict.of("MPC share before the push is near zero: RMS below 10 % of ZD+PD's", "almost zero", before),
            Verdict.of(f"MPC share during the push is large: RMS above {LARGE:g} times before", "large", during),
            Verdict.of(
                f"MPC share vanishes again (steps 9 to {STEPS}): RMS below {VANISHED:g} times before",
                "reduces",
                after,
            ),
        ),
        panels=tuple(panels),
        tables=tables,
        notes=("Windows: step 1, step 2 (pushed), steps 9 to 12. RMS over all four joints, impacts included.",),
    )
