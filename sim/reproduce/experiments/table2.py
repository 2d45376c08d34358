"""Table II: largest eigenvalue of the step-to-step map, as modelled and with twice the torso mass."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.reproduce import study
from sim.reproduce.criteria import DOUBLED_TOLERANCE, NOMINAL_TOLERANCE, measured
from sim.reproduce.panels import CONTROLLER_STYLES, Level, LinePanel, Series

SIZES = (3e-2, 2e-2, 1e-2, 5e-3)  # [rad]; the second is the one that is used, smaller ones measure the map's jumps
QUICK_SIZES = (2e-2,)
REPEATS, BESIDE_REPEATS, QUICK_REPEATS = 4, 2, 1
NOMINAL, DOUBLED = 0.75, 0.78

MASS_ALONE = "torso mass x2, inertia as it is"
CASES: dict[str, dict[str, Any]] = {
    "nominal": {},
    "torso x2": {"plant.mass_factor.torso": 2.0},
    MASS_ALONE: {"plant.mass_factor.torso": 2.0, "plant.inertia_follows_mass": False},
    "torso x2, unsaturated": {"plant.mass_factor.torso": 2.0, "plant.saturation": False},
}


def _cases() -> list[tuple[str, str]]:
    """(Controller, case) of the table; the unsaturated one is ZD+PD's alone."""
    return [("zd-pd", case) for case in CASES] + [("c-mpc", case) for case in CASES if "unsaturated" not in case]


def _repeats(effort: study.Effort) -> int:
    return QUICK_REPEATS if effort.quick else BESIDE_REPEATS if effort.beside else REPEATS


def tasks(effort: study.Effort) -> Mapping[str, study.Task]:
    """One analysis a case."""
    sizes, repeats = list(QUICK_SIZES if effort.quick or effort.beside else SIZES), _repeats(effort)
    return {
        f"{plant}/{controller}/{case}": study.Task(
            function="sim.reproduce.measure:stability",
            arguments={
                "scenario": effort.scenario(plant, controller, CASES[case]),
                "step_sizes": sizes,
                "repeats": repeats,
            },
            cost=(60.0 + 18.0 * (len(sizes) + repeats)) * (4.0 if controller == "c-mpc" else 1.0),
        )
        for plant in study.PLANTS
        for controller, case in _cases()
    }


def _study(found: study.Arrays) -> str:
    rows = zip(found["study_h"], found["study_largest"], found["study_jumps"], strict=True)
    return "; ".join(f"{h:g} rad {'falls' if np.isnan(v) else f'{v:.3f}'} ({jumps:.1g})" for h, v, jumps in rows)


def _words(found: study.Arrays) -> str:
    step = int(found["fell_in_step"])
    fall = f"falls in step {step}" if step else ""
    if "largest" not in found:
        return fall or "no fixed point found"
    value = f"{float(found['largest']):.3f}, noise floor {float(found['noise']):.2g}"
    return f"{value}; {fall}" if fall else value


def evaluate(results: study.Results, effort: study.Effort) -> study.Evaluation:
    """Eigenvalues against the table."""

    def value(controller: str, case: str, paper: float, tolerance: float) -> study.Verdict:
        name = study.CONTROLLER_NAMES[controller]

        def judge(plant: str) -> study.Finding:
            found = results[f"{plant}/{controller}/{case}"]
            if "largest" not in found:
                return study.Finding(text=_words(found), holds=False)
            largest, noise = float(found["largest"]), float(found["noise"])
            stable = int(found["fell_in_step"]) == 0 and largest < 1.0
            # Contact is another system: there the paper's verdict counts, not its digits.
            if plant == "rigid":
                holds = stable and abs(largest - paper) <= tolerance and measured(noise, tolerance)
            else:
                holds = stable and measured(noise, 1.0 - largest)
            return study.Finding(text=_words(found), holds=holds)

        claim = f"{name}, {case}: stable; on the rigid plant within {tolerance:g} of the paper's"
        return study.Verdict.of(claim, f"{paper:g}", judge)

    def unstable(case: str) -> study.Verdict:
        def judge(plant: str) -> study.Finding:
            found = results[f"{plant}/zd-pd/{case}"]
            falls = int(found["fell_in_step"]) > 0
            return study.Finding(text=_words(found), holds=falls)

        return study.Verdict.of(f"ZD+PD, {case}: falls", "falls after one step", judge)

    repeats = _repeats(effort)
    panels, tables, notes = [], {}, []
    for plant in study.PLANTS:
        row = []
        for case in ("nominal", "torso x2"):
            lines = []
            for controller in study.CONTROLLERS:
                found = results[f"{plant}/{controller}/{case}"]
                if "largest" in found:
                    colour, dash = CONTROLLER_STYLES[controller]
                    h, largest = found["study_h"], found["study_largest"]
                    name = study.CONTROLLER_NAMES[controller]
                    lines.append(Series(name=name, x=h, y=largest, colour=colour, dash=dash, marker=True))
            paper = NOMINAL if case == "nominal" else DOUBLED
            row.append(
                LinePanel(
                    title=f"{study.PLANT_NAMES[plant]}: {case}",
                    x_label="perturbation [rad]",
                    y_label="largest |eigenvalue|",
                    series=tuple(lines),
                    levels=(Level(y=paper, name=f"paper {paper:g}"), Level(y=1.0, name="stability limit")),
                    log_x=True,
                    y_range=(0.5, 1.1),
                )
            )
        panels.append(tuple(row))
        for controller, case in _cases():
            found = results[f"{plant}/{controller}/{case}"]
            if "largest" not in found:
                continue
            stem = f"{plant}-{controller}-{case.replace(', ', '-').replace(' ', '-')}"
            tables[f"study-{stem}"] = {
                "perturbation [rad]": found["study_h"],
                "largest": found["study_largest"],
                "jumps over perturbation": found["study_jumps"],
            }
            tables[f"eigenvalues-{stem}"] = {
                "number": np.arange(1, 10),
                "magnitude": found["eigenvalues"],
            }
            notes.append(
                f"{study.PLANT_NAMES[plant]}, {study.CONTROLLER_NAMES[controller]}, {case}: "
                f"{float(found['largest']):.4f} at {float(found['h']):g} rad, noise floor "
                f"{float(found['noise']):.1g} (standard deviation over {repeats + 1} sets of directions); residual of "
                f"the fixed point {float(found['residual']):.1e}, scatter of the walk on the map "
                f"{float(found['scatter']):.1e}, roughness of the map {float(found['roughness']):.1e} rad. "
                f"Perturbation, eigenvalue and jumps over perturbation: {_study(found)}."
            )
    return study.Evaluation(
        verdicts=(
            value("zd-pd", "nominal", NOMINAL, NOMINAL_TOLERANCE),
            value("c-mpc", "nominal", NOMINAL, NOMINAL_TOLERANCE),
            unstable("torso x2"),
            unstable("torso x2, unsaturated"),
            value("c-mpc", "torso x2", DOUBLED, DOUBLED_TOLERANCE),
            unstable(MASS_ALONE),
            value("c-mpc", MASS_ALONE, DOUBLED, DOUBLED_TOLERANCE),
        ),
        panels=tuple(panels),
        tables=tables,
        notes=(
            "The paper doubles the torso's mass and does not speak of its inertia; the first reading doubles both.",
            "Central differences along the switching surface; the tick grid starts anew at each impact. C-MPC "
            "predicts impacts at whole ticks, so its map jumps a little: small perturbations measure the jumps. One "
            "perturbation is used for all; the noise floor is how much the eigenvalue differs with the directions",
            *notes,
        ),
    )
