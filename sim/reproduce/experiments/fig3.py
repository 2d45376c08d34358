"""Fig. 3: postures of the periodic gait, step of 0.4 m in 0.5 s."""

from collections.abc import Mapping

import numpy as np

from sim.reproduce import study
from sim.reproduce.criteria import GAIT_TOLERANCE
from sim.reproduce.panels import BLACK, BLUE, GREY, LinePanel, Series

SETTLED = 6  # the figure's step, and the first that counts
PAPER_LENGTH, PAPER_TIME = 0.4, 0.5  # [m], [s]
TIMES = (0.0, 0.25, 0.5)  # [s]
TORSO = 0.63  # [m], as drawn


def tasks(effort: study.Effort) -> Mapping[str, study.Task]:
    """The undisturbed walk of both controllers on both plants."""
    return {
        f"{plant}/{controller}": study.Task(
            function="sim.reproduce.measure:walk",
            arguments={"scenario": effort.scenario(plant, controller, study.UNDISTURBED)},
            cost=study.UNDISTURBED["steps"] * (3.0 if controller == "c-mpc" else 1.0),
        )
        for plant in study.PLANTS
        for controller in study.CONTROLLERS
    }


def steps_of(run: study.Arrays) -> tuple[np.ndarray, np.ndarray]:
    """Durations in [s] and lengths in [m] of a run's steps."""
    landed = run["landed"][run["landed"] < len(run["t"])]  # the touch-down that ends the run has no tick
    feet = run["foot"][landed]
    return np.diff(run["t"][landed], prepend=0.0), np.abs(feet[:, 2] - feet[:, 0])


def evaluate(results: study.Results, effort: study.Effort) -> study.Evaluation:
    """Step length and time, and the postures."""

    def both(controller: str, index: int, paper: float, unit: str) -> study.Verdict:
        def judge(plant: str) -> study.Finding:
            values = steps_of(results[f"{plant}/{controller}"])[index][SETTLED:]
            if not len(values):
                return study.Finding(text="falls", holds=False)
            mean = float(values.mean())
            return study.Finding(text=f"{mean:.3f} {unit}", holds=abs(mean - paper) <= GAIT_TOLERANCE * paper)

        name = ("step time", "step length")[index]
        return study.Verdict.of(f"{controller}: {name} within 5 %", f"{paper:g} {unit}", judge)

    verdicts = [
        both(controller, index, paper, unit)
        for controller in study.CONTROLLERS
        for index, paper, unit in ((1, PAPER_LENGTH, "m"), (0, PAPER_TIME, "s"))
    ]
    rows, tables = [], {}
    for plant in study.PLANTS:
        run = results[f"{plant}/c-mpc"]
        rows.append(tuple(_posture(run, time, plant) for time in TIMES))
        for controller in study.CONTROLLERS:
            durations, lengths = steps_of(results[f"{plant}/{controller}"])
            number = np.arange(1, len(durations) + 1)
            tables[f"steps-{plant}-{controller}"] = {
                "step": number,
                "duration [s]": durations,
                "length [m]": lengths,
            }
    return study.Evaluation(
        verdicts=tuple(verdicts),
        panels=tuple(rows),
        tables=tables,
        notes=("Means over the steps after the sixth of an undisturbed walk; postures of C-MPC's seventh step.",),
    )


def _posture(run: study.Arrays, time: float, plant: str) -> LinePanel:
    """Stick figure a time after the sixth touch-down."""
    title = f"{study.PLANT_NAMES[plant]}, {time:.2f} s"
    axes = {"x_label": "x from the stance foot [m]", "y_label": "z [m]", "equal": True, "y_range": (-0.05, 1.45)}
    if len(run["landed"]) <= SETTLED:
        return LinePanel(title=f"{title}: fell", series=(), **axes)  # type: ignore[arg-type]
    start = int(run["landed"][SETTLED - 1])
    k = min(start + round(time / float(run["t"][1])), len(run["t"]) - 1)
    stance = int(run["stance"][start + 1])
    feet, hip, q = run["foot"][k].reshape(2, 2), run["hip"][k], run["q"][k]
    origin = np.array([run["foot"][start + 1].reshape(2, 2)[stance, 0], 0.0])

    def end(point: np.ndarray, angle: float, length: float) -> np.ndarray:
        return point + length * np.array([-np.sin(angle), np.cos(angle)])

    lines = []
    for leg in range(2):
        colour, name = (BLUE, "stance leg") if leg == stance else (GREY, "swing leg")
        knee = end(hip, q[4] + q[leg], float(run["femur"][leg]))
        points = np.array([hip, knee, feet[leg]]) - origin
        lines.append(Series(name=name, x=points[:, 0], y=points[:, 1], colour=colour, width=3.0, marker=True))
    torso = np.array([hip, end(hip, q[4], TORSO)]) - origin
    lines.append(Series(name="torso", x=torso[:, 0], y=torso[:, 1], colour=BLACK, width=4.0))
    lines.append(Series(name="", x=np.array([-0.55, 0.55]), y=np.zeros(2), colour=BLACK, width=0.8))
    return LinePanel(title=title, series=tuple(lines), **axes)  # type: ignore[arg-type]
