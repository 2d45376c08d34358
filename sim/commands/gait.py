"""`cmpc gait`: design gaits, check them, polish printed ones, fill the library."""

import json
import math
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.commands import gait_compare
from sim.commands.options import add_json
from sim.errors import UserError
from sim.settings import flags
from sim.terminal import console

EPILOG = """\
exit code: 0, 1 for a gait that fails its check, 2 for bad input or a request that no gait can keep
"""

REQUIREMENTS = {
    "clearance": ("m", "height in mid-step of the bump the swing foot stays above"),
    "friction": ("ratio", "largest |F_T / F_N| in stance and at the impact"),
    "normal_share": ("ratio", "smallest stance force by the walker's weight"),
    "torque_share": ("ratio", "largest torque by the joint's limit"),
    "knee_min": ("rad", "most bent knee"),
    "knee_max": ("rad", "straightest knee"),
    "torso_max": ("rad", "largest lean of the torso either way"),
    "touch_down": ("m/s", "slowest rate of the swing foot before the impact, downward"),
    "eigenvalue_max": ("ratio", "largest delta^2 of the restricted Poincare map"),
    "transverse_max": ("ratio", "largest eigenvalue of the output errors under the gains"),
    "kp": ("1/s^2", "the gains K_P meant"),
    "kd": ("1/s", "the gains K_D meant"),
    "reserve": ("ratio", "smallest zeta along the step by zeta before impact"),
}
"""Fields of `controller.design.requirements.Requirements` that are flags; a test holds both together."""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc gait`."""
    parser = commands.add_parser("gait", description="Gaits: design, check, compare, polish, library.", epilog=EPILOG)
    actions = parser.add_subparsers(metavar="COMMAND")

    design = actions.add_parser(
        "design",
        help="make a gait from nothing",
        description="The cheapest gait that keeps the requirements, the same bytes every time.",
    )
    design.add_argument("--step-length", type=flags.real(above=0.0), required=True, metavar="m")
    design.add_argument(
        "--speed", type=flags.real(above=0.0), metavar="m/s", help="mean speed; give this or --step-time"
    )
    design.add_argument("--step-time", type=flags.real(above=0.0), metavar="s")
    _add_design(design)
    text = "what is least (default: torque)"
    design.add_argument("--cost", choices=("torque", "work"), default="torque", help=text)
    design.add_argument("--warm", metavar="NAME|FILE.toml", help="gait to start from")
    design.add_argument("--out", metavar="FILE.toml", help="default: L<m>-v<m/s>.toml in the walker's gaits/")
    _add_common(design, _design, force=True)

    text = "Simulate a gait on the controller's full model and judge it."
    check = actions.add_parser("check", help="simulate it on the full model and judge it", description=text)
    _add_gait(check)
    _add_common(check, _check)

    gait_compare.add_parser(actions)

    text = "The exactly periodic gait next to one that is printed to a few decimals."
    polish = actions.add_parser("polish", help="the exactly periodic gait next to a printed one", description=text)
    _add_gait(polish)
    polish.add_argument("--out", required=True, metavar="FILE.toml")
    _add_common(polish, _polish, force=True)

    text = "A gait of ours from another's step: CSV of its trajectory, Bezier outputs as TOML or JSON, a .mat of FROST."
    taken = actions.add_parser("import", help="a gait from another program's step", description=text)
    taken.add_argument("file", metavar="FILE.csv|toml|json|mat")
    taken.add_argument("--walker", default="rabbit", metavar="NAME|FOLDER", help="default: rabbit")
    taken.add_argument(
        "--stance", choices=("left", "right"), default="left", help="the foot that stands (default: left)"
    )
    taken.add_argument("--degrees", action="store_true", help="the file's angles are in degrees")
    text = "which gait of a .mat that holds several, from 1"
    taken.add_argument("--number", type=flags.whole(1), metavar="INT", help=text)
    text = "of our Bezier polynomials (default: 6)"
    taken.add_argument("--degree", type=flags.whole(4), default=6, metavar="INT", help=text)
    taken.add_argument("--out", required=True, metavar="FILE.toml")
    _add_common(taken, _import, force=True)

    library = actions.add_parser(
        "library",
        help="a grid of gaits over step length and speed",
        description="Design a grid of gaits into the walker's gaits/; those that are there stay.",
    )
    library.add_argument(
        "--step-lengths", type=flags.real(above=0.0), nargs="+", default=[0.4], metavar="m", help="default: 0.4"
    )
    speeds = [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1]
    library.add_argument(
        "--speeds", type=flags.real(above=0.0), nargs="+", default=speeds, metavar="m/s", help="default: 0.5 ... 1.1"
    )
    _add_design(library)
    library.add_argument("--workers", type=flags.whole(1), default=2, metavar="INT", help="processes (default: 2)")
    library.add_argument("--fresh", action="store_true", help="design all of them again")
    _add_common(library, _library, plot=False)


def _add_gait(parser: flags.Parser) -> None:
    parser.add_argument("gait", metavar="NAME|FILE.toml")
    text = "default: the folder the gait lies in, or rabbit"
    parser.add_argument("--walker", metavar="NAME|FOLDER", help=text)


def _add_design(parser: flags.Parser) -> None:
    parser.add_argument("--walker", default="rabbit", metavar="NAME|FOLDER", help="default: rabbit")
    parser.add_argument("--degree", type=int, default=6, metavar="INT", help="of the Bezier polynomials (default: 6)")
    text = "take the best of so many (default: 2)"
    parser.add_argument("--starts", type=flags.whole(1), default=2, metavar="INT", help=text)


def _add_common(parser: flags.Parser, run: Any, *, force: bool = False, plot: bool = True) -> None:
    parser.set_defaults(run=run)
    if force:
        parser.add_argument("--force", action="store_true", help="write over another file that is there")
    if plot:
        parser.add_argument("--plot", metavar="FILE.png", help="draw the gait")
    add_json(parser)
    group = parser.add_argument_group("requirements, where not the defaults")
    for field, (unit, words) in REQUIREMENTS.items():
        flag, nargs = "--" + field.replace("_", "-"), 4 if field in ("kp", "kd") else None
        group.add_argument(flag, dest=field, type=flags.real(), nargs=nargs, metavar=unit, help=words)


def _changes(found: Namespace) -> dict[str, Any]:
    given = {field: getattr(found, field) for field in REQUIREMENTS if getattr(found, field) is not None}
    return {field: tuple(value) if isinstance(value, list) else value for field, value in given.items()}


def _design(found: Namespace) -> int:
    if (found.speed is None) == (found.step_time is None):
        raise UserError("cmpc gait design: give --speed [m/s] or --step-time [s], one of them")
    speed = found.speed if found.speed is not None else found.step_length / found.step_time

    from sim.bridge import gaits

    made, design = gaits.design_gait(
        found.walker,
        {**_changes(found), "step_length": found.step_length, "speed": speed},
        degree=found.degree,
        cost=found.cost,
        warm=found.warm,
        starts=found.starts,
        name=None,
        out=Path(found.out) if found.out else None,
        force=found.force,
        say=console.note,
    )
    return _judge(made, _changes(found), found, extra={"iterations": design.iterations})


def _check(found: Namespace) -> int:
    from sim.bridge import gaits

    return _judge(gaits.belief(found.gait, found.walker), _changes(found), found)


def _polish(found: Namespace) -> int:
    from sim.bridge import gaits

    printed = gaits.belief(found.gait, found.walker)
    polished = gaits.polish_gait(printed, Path(found.out), force=found.force)
    apart = float(abs(polished.gait.alpha - printed.gait.alpha).max())
    console.note(f"largest change of a coefficient: {apart:.4f} rad")
    return _judge(polished, _changes(found), found, extra={"largest_change_rad": apart})


def _import(found: Namespace) -> int:
    from sim.bridge.gait_import import import_gait

    made, apart = import_gait(
        found.walker,
        Path(found.file),
        Path(found.out),
        stance=found.stance,
        degrees=found.degrees,
        degree=found.degree,
        force=found.force,
        number=found.number,
    )
    file = "" if math.isnan(apart["step_time_file_s"]) else f", the file's step takes {apart['step_time_file_s']:.4f} s"
    console.note(
        f"fitted within {apart['fit_rad']:.2g} rad, polished by up to {apart['polish_rad']:.2g} rad a coefficient; "
        f"a step takes {apart['step_time_s']:.4f} s{file}"
    )
    apart = {key: value for key, value in apart.items() if not math.isnan(value)}
    return _judge(made, _changes(found), found, extra=apart)


def _library(found: Namespace) -> int:
    from sim.bridge import gaits

    files = gaits.library_gaits(
        found.walker,
        found.step_lengths,
        found.speeds,
        _changes(found),
        degree=found.degree,
        starts=found.starts,
        workers=found.workers,
        fresh=found.fresh,
        say=console.note,
    )
    print(json.dumps({"gaits": [str(file) for file in files]}) if found.json else f"{len(files)} gaits in the library")
    return 0


def _judge(made: Any, changes: dict[str, Any], found: Namespace, extra: dict[str, Any] | None = None) -> int:
    from sim.bridge import gaits

    report = gaits.check_gait(made, changes)
    if found.plot:
        gaits.plot_gait(Path(found.plot), made)
    if found.json:
        print(json.dumps(_as_dict(made, report) | (extra or {})))
    else:
        _print(made, report)
        if report.passed and extra:
            walker = f" --walker {found.walker}" if found.walker not in (None, "rabbit") else ""
            console.next_step(f"cmpc run undisturbed --gait {made.path}{walker}")
    return 0 if report.passed else 1


def _as_dict(made: Any, report: Any) -> dict[str, Any]:
    orbit, section = report.orbit, report.section
    return {
        "file": str(made.path),
        "passed": report.passed,
        "step_length_m": orbit.step_length,
        "step_time_s": orbit.step_time,
        "speed_m_s": orbit.speed,
        "cost_N2ms": orbit.cost,
        "work_J_m": orbit.work,
        "peak_torque_Nm": [float(u) for u in abs(orbit.u).max(axis=0)],
        "invariance": report.invariance,
        "periodicity": report.residual if section else None,
        "delta2": orbit.delta**2,
        "eigenvalues": [float(x) for x in abs(section.eigenvalues)] if section else None,
        "margins": {m.name: m.worst for m in report.margins},
    }


def _print(made: Any, report: Any) -> None:
    table = console.table("", "found", "must be", " ", title=str(made.path))
    for finding in report.findings:
        verdict = {True: "holds", False: "VIOLATED", None: ""}[finding.holds]
        table.add_row(finding.name, finding.value, finding.legal, verdict)
    console.show(table)
