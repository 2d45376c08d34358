"""`cmpc poincare`: fixed point and eigenvalues of a scenario's step-to-step map."""

import dataclasses
import json
import math
from argparse import Namespace
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from sim.commands.options import add_json, add_quiet, add_scenario, scenario_of
from sim.errors import UserError
from sim.scenario import Scenario
from sim.settings import flags
from sim.settings import tree as settings

if TYPE_CHECKING:
    from sim.terminal.progress import Update

DEFAULT = "undisturbed"
SETTLING = 60  # steps of the free walk whose scatter is reported
KEPT = 20

DESCRIPTION = "Stability of a scenario's gait: fixed point and eigenvalues of the step-to-step map."
EPILOG = """\
The map takes the state just before an impact to the state just before the next one, undisturbed: pushes and
start offsets of the scenario play no part. Flags override the scenario:

  cmpc poincare                                     the gait under C-MPC on MuJoCo
  cmpc poincare --plant.kind rigid --controller zd-pd
  cmpc poincare payload-x2 --plant.kind rigid --json

exit code: 0 a fixed point was found, 1 none was found (the walker falls), 2 bad input
"""


def add_parser(commands: Any, argv: Sequence[str], scenario: Scenario | None = None) -> None:
    """Add the parser of `cmpc poincare`, whose help shows a scenario's values."""
    parser, own = add_scenario(
        commands, "poincare", argv, scenario, description=DESCRIPTION, epilog=EPILOG, default=DEFAULT
    )
    parser.set_defaults(run=_run)
    text = "use this perturbation only, without the step-size study"
    own.add_argument("--step-size", type=flags.real(above=0.0), metavar="rad", help=text)
    add_json(own)
    add_quiet(own)


def _run(found: Namespace) -> int:
    scenario = scenario_of(found, DEFAULT, add_parser)
    if scenario is None:
        return 0
    if found.step_size is not None and not found.step_size < 1.0:
        raise UserError(f"--step-size {found.step_size:g} rad: must be above 0 and below 1 [rad]")
    _check_legs(scenario)
    report = analyse(scenario, step_size=found.step_size, quiet=found.quiet or found.json)
    print(json.dumps(report) if found.json else _text(report, scenario))
    return 0 if report["converged"] else 1


def _check_legs(scenario: Scenario) -> None:
    """A step map needs legs that are alike: otherwise a step with the left leg leads to one of another map."""
    values = {row.path: row.value for row in settings.table(scenario)}
    for path, value in values.items():
        twin = path.replace(".left_", ".right_")
        if values.get(twin, value) != value:  # a controller of one's own may call anything left
            raise UserError(
                f"--{path.replace('_', '-')} {value}: the legs must be alike for a step map; "
                f"--{twin.replace('_', '-')} is {values[twin]}"
            )


def analyse(scenario: Scenario, *, step_size: float | None = None, quiet: bool = True) -> dict[str, Any]:
    """Fixed point, eigenvalues and error figures of a scenario as a plain dict.

    Args:
        scenario: Walker, controller, plant.
        step_size: The one perturbation to use in [rad]; None for the step-size study.
        quiet: Whether to show no progress on stderr.
    """
    from sim.bridge.run import build_rig
    from sim.terminal.progress import progress_bar

    with progress_bar("step-to-step map", quiet=quiet) as update:
        return _analyse(build_rig(scenario), step_size, update or (lambda done, of, words="": None))


def _analyse(rig: Any, step_size: float | None, update: "Update") -> dict[str, Any]:
    from sim.stability import poincare
    from sim.stability.fixed_point import find_fixed_point
    from sim.stability.step_map import Fell, scaled

    update(0, 0, "searching the fixed point")
    point = find_fixed_point(rig.step_map, rig.surface, rig.x_gait)
    report: dict[str, Any] = {
        "converged": point.converged,
        "fixed_point": point.x.tolist(),
        "residual": point.residual,
        "map_scatter": point.scatter,
        "settling_steps": point.iterations[0],
        "newton_steps": point.iterations[1],
        "message": point.message,
    }
    try:
        scatter = scaled(rig.settled(SETTLING, KEPT)).std(axis=0)
        report["free_walk_scatter"] = float(math.hypot(*scatter))
    except Fell as fall:
        report["free_walk_scatter"], report["free_walk"] = None, str(fall)
    if point.converged:
        sizes = poincare.STEP_SIZES if step_size is None else ()
        try:
            stability = poincare.analyse(
                rig.step_map,
                rig.surface,
                point.x,
                h=step_size or poincare.PERTURBATION,
                step_sizes=sizes,
                progress=lambda done, of: update(done, of, f"Jacobian {done} of {of}"),
            )
        except Fell as fall:
            report["message"] = str(fall)
        else:
            report |= {
                "largest": stability.largest,
                "eigenvalues": [[value.real, value.imag] for value in stability.eigenvalues.tolist()],
                "step_size": stability.h,
                "noise": stability.noise if math.isfinite(stability.noise) else None,
                "roughness": stability.roughness,
                "study": [dataclasses.asdict(row) for row in stability.study],
            }
    return report


def _text(report: dict[str, Any], scenario: Scenario) -> str:
    from sim.stability.fixed_point import SHARP

    head = f"{scenario.name}, {scenario.controller.kind}, {scenario.plant.kind} plant"
    lines = [head]

    def row(name: str, text: str) -> None:
        lines.append(f"  {name:<24}{text}")

    if report["converged"]:
        walked, newton = report["settling_steps"], report["newton_steps"]
        sharp = report["residual"] < SHARP
        words = "found in" if sharp else f"the mean of states that scatter by {report['map_scatter']:.1e} rad, after"
        row("fixed point", f"{words} {walked} steps of walking and {newton} of Newton")
    else:
        row("fixed point", f"none found: {report['message']}")
    row("residual", f"{report['residual']:.1e} rad (rates in units of 4 rad/s)")
    x = report["fixed_point"]
    row("q before impact", " ".join(f"{value: .5f}" for value in x[:5]) + "  rad")
    row("dq before impact", " ".join(f"{value: .5f}" for value in x[5:]) + "  rad/s")
    if report["free_walk_scatter"] is None:
        row("free walk", report["free_walk"])
    else:
        scatter = report["free_walk_scatter"]
        row("scatter of a free walk", f"{scatter:.1e} rad, as the phase of ticks and impacts drifts")
    if "largest" in report:
        row("largest |eigenvalue|", f"{report['largest']:.4f}, perturbation {report['step_size']:g} rad")
        noise = "unknown: the walker falls" if report["noise"] is None else f"{report['noise']:.1g}"
        row("noise floor", f"{noise}, standard deviation over perturbations along other directions")
        magnitudes = sorted((math.hypot(*value) for value in report["eigenvalues"]), reverse=True)
        row("all |eigenvalues|", " ".join(f"{value:.3f}" for value in magnitudes))
        row("roughness of the map", f"{report['roughness']:.1e} rad at perturbations of 1e-4 rad")
        lines.append("  perturbation [rad]   largest |eigenvalue|   jumps of the map over it")
        for entry in report["study"]:
            value = "falls" if entry["largest"] is None else f"{entry['largest']:.5f}"
            mark = "  <- reported" if entry["h"] == report["step_size"] else ""
            lines.append(f"  {entry['h']:<18g}   {value:<20}   {entry['jumps']:.1e}{mark}")
    return "\n".join(lines)
