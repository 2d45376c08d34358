"""`cmpc gait`: design gaits, check them, polish printed ones, fill the library."""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sim.commands import gait_compare
from sim.errors import UserError
from sim.settings import flags

HELP = """\
usage: cmpc gait design  --step-length M --speed M/S [options]   make a gait from nothing
       cmpc gait check   NAME|FILE.toml [options]                 simulate it on the full model and judge it
       cmpc gait compare NAME|FILE.toml NAME|FILE.toml            two gaits, coefficient by coefficient, cost by cost
       cmpc gait polish  NAME|FILE.toml --out FILE.toml           the exactly periodic gait next to a printed one
       cmpc gait library [options]                                a grid of gaits over step length and speed

cmpc gait SUBCOMMAND --help shows the options. Exit code: 0, 1 for a gait that fails its check, 2 for bad input or a
request that no gait can keep.
"""

REQUIREMENTS = {
    "clearance": ("M", "height in mid-step of the bump the swing foot stays above"),
    "friction": ("RATIO", "largest |F_T / F_N| in stance and at the impact"),
    "normal_share": ("RATIO", "smallest stance force by the walker's weight"),
    "torque_share": ("RATIO", "largest torque by the joint's limit"),
    "knee_min": ("RAD", "most bent knee"),
    "knee_max": ("RAD", "straightest knee"),
    "torso_max": ("RAD", "largest lean of the torso either way"),
    "touch_down": ("M/S", "slowest rate of the swing foot before the impact, downward"),
    "eigenvalue_max": ("RATIO", "largest delta^2 of the restricted Poincare map"),
    "transverse_max": ("RATIO", "largest eigenvalue of the output errors under the gains"),
    "kp": ("1/S^2", "the gains K_P meant"),
    "kd": ("1/S", "the gains K_D meant"),
    "reserve": ("RATIO", "smallest zeta along the step by zeta before impact"),
}
"""Fields of `controller.design.requirements.Requirements` that are flags; a test holds both together."""


def main(argv: Sequence[str]) -> int:
    """Run `cmpc gait`; returns the exit code."""
    commands = {
        "design": _design,
        "check": _check,
        "compare": gait_compare.main,
        "polish": _polish,
        "library": _library,
    }
    if not argv or argv[0] in ("-h", "--help"):
        print(HELP, end="")
        return 0
    if argv[0] not in commands:
        raise UserError(f"cmpc gait {argv[0]}: unknown; legal: {', '.join(commands)}")
    return commands[argv[0]](argv[1:])


def _parser(name: str, text: str, *, requirements: bool = True) -> flags.Parser:
    parser = flags.Parser(prog=f"cmpc gait {name}", description=text)
    parser.add_argument("-h", "--help", action="help", help="show this")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    if requirements:
        group = parser.add_argument_group("requirements, where not the defaults")
        for field, (unit, words) in REQUIREMENTS.items():
            nargs = 4 if field in ("kp", "kd") else None
            group.add_argument(_flag(field), dest=field, type=float, nargs=nargs, metavar=unit, help=words)
    return parser


def _add_force(parser: flags.Parser) -> None:
    parser.add_argument("--force", action="store_true", help="write over another file that is there")


def _flag(field: str) -> str:
    return "--" + field.replace("_", "-")


def _changes(found: argparse.Namespace) -> dict[str, Any]:
    given = {field: getattr(found, field) for field in REQUIREMENTS if getattr(found, field) is not None}
    for field, value in given.items():
        for number in value if isinstance(value, list) else [value]:
            if not math.isfinite(number):
                raise UserError(f"{_flag(field)} = {number} {REQUIREMENTS[field][0].lower()}; legal: a finite number")
    return {field: tuple(value) if isinstance(value, list) else value for field, value in given.items()}


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _design(argv: Sequence[str]) -> int:
    parser = _parser("design", "The cheapest gait that keeps the requirements, the same bytes every time.")
    parser.add_argument("--walker", default="rabbit", metavar="NAME|FOLDER", help="default: rabbit")
    parser.add_argument("--step-length", type=float, required=True, metavar="M")
    parser.add_argument("--speed", type=float, metavar="M/S", help="mean speed; give this or --step-time")
    parser.add_argument("--step-time", type=float, metavar="S")
    parser.add_argument("--degree", type=int, default=6, metavar="INT", help="of the Bezier polynomials (default: 6)")
    parser.add_argument("--cost", choices=("torque", "work"), default="torque", help="what is least (default: torque)")
    parser.add_argument("--warm", metavar="NAME|FILE.toml", help="gait to start from")
    parser.add_argument("--starts", type=int, default=2, metavar="INT", help="take the best of so many (default: 2)")
    parser.add_argument("--out", metavar="FILE.toml", help="default: L<m>-v<m/s>.toml in the walker's gaits/")
    _add_force(parser)
    parser.add_argument("--plot", metavar="FILE.png", help="draw the gait")
    found = parser.parse(argv)
    if (found.speed is None) == (found.step_time is None):
        raise UserError("cmpc gait design: give --speed [m/s] or --step-time [s], one of them")
    if found.starts < 1:
        raise UserError(f"--starts {found.starts}; legal: 1 or above")
    if found.step_time is not None and not found.step_time > 0.0:
        raise UserError(f"--step-time {found.step_time} s; legal: above 0 s")
    speed = found.speed if found.speed is not None else found.step_length / found.step_time

    from sim.bridge import gaits as compose_design

    made, design = compose_design.design_gait(
        found.walker,
        {**_changes(found), "step_length": found.step_length, "speed": speed},
        degree=found.degree,
        cost=found.cost,
        warm=found.warm,
        starts=found.starts,
        name=None,
        out=Path(found.out) if found.out else None,
        force=found.force,
        say=_say,
    )
    return _judge(made, _changes(found), found, extra={"iterations": design.iterations})


def _check(argv: Sequence[str]) -> int:
    parser = _parser("check", "Simulate a gait on the controller's full model and judge it.")
    parser.add_argument("gait", metavar="NAME|FILE.toml")
    parser.add_argument("--walker", metavar="NAME|FOLDER", help="default: the folder the gait lies in, or rabbit")
    parser.add_argument("--plot", metavar="FILE.png", help="draw the gait")
    found = parser.parse(argv)

    from sim.bridge import gaits as compose_design

    return _judge(compose_design.belief(found.gait, found.walker), _changes(found), found)


def _polish(argv: Sequence[str]) -> int:
    parser = _parser("polish", "The exactly periodic gait next to one that is printed to a few decimals.")
    parser.add_argument("gait", metavar="NAME|FILE.toml")
    parser.add_argument("--walker", metavar="NAME|FOLDER", help="default: the folder the gait lies in, or rabbit")
    parser.add_argument("--out", required=True, metavar="FILE.toml")
    _add_force(parser)
    parser.add_argument("--plot", metavar="FILE.png", help="draw the gait")
    found = parser.parse(argv)

    from sim.bridge import gaits as compose_design

    printed = compose_design.belief(found.gait, found.walker)
    polished = compose_design.polish_gait(printed, Path(found.out), force=found.force)
    apart = float(abs(polished.gait.alpha - printed.gait.alpha).max())
    _say(f"largest change of a coefficient: {apart:.4f} rad")
    return _judge(polished, _changes(found), found, extra={"largest_change_rad": apart})


def _library(argv: Sequence[str]) -> int:
    parser = _parser("library", "Design a grid of gaits into the walker's gaits/; those that are there stay.")
    parser.add_argument("--walker", default="rabbit", metavar="NAME|FOLDER", help="default: rabbit")
    parser.add_argument("--step-lengths", type=float, nargs="+", default=[0.4], metavar="M", help="default: 0.4")
    speeds = [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1]
    parser.add_argument("--speeds", type=float, nargs="+", default=speeds, metavar="M/S", help="default: 0.5 ... 1.1")
    parser.add_argument("--degree", type=int, default=6, metavar="INT", help="of the Bezier polynomials (default: 6)")
    parser.add_argument("--starts", type=int, default=2, metavar="INT", help="take the best of so many (default: 2)")
    parser.add_argument("--workers", type=int, default=2, metavar="INT", help="processes (default: 2)")
    parser.add_argument("--fresh", action="store_true", help="design all of them again")
    found = parser.parse(argv)
    for flag, value in (("--workers", found.workers), ("--starts", found.starts)):
        if value < 1:
            raise UserError(f"{flag} {value}; legal: 1 or above")

    from sim.bridge import gaits as compose_design

    files = compose_design.library_gaits(
        found.walker,
        found.step_lengths,
        found.speeds,
        _changes(found),
        degree=found.degree,
        starts=found.starts,
        workers=found.workers,
        fresh=found.fresh,
        say=_say,
    )
    print(json.dumps({"gaits": [str(file) for file in files]}) if found.json else f"{len(files)} gaits in the library")
    return 0


def _judge(made: Any, changes: dict[str, Any], found: argparse.Namespace, extra: dict[str, Any] | None = None) -> int:
    from sim.bridge import gaits as compose_design

    report = compose_design.check_gait(made, changes)
    if found.plot:
        compose_design.plot_gait(Path(found.plot), made)
    if found.json:
        print(json.dumps(_as_dict(made, report) | (extra or {})))
    else:
        _print(made, report)
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
    from rich.console import Console
    from rich.table import Table

    table = Table(title=str(made.path), title_justify="left")
    for column in ("", "found", "legal", ""):
        table.add_column(column, overflow="fold")
    for finding in report.findings:
        verdict = {True: "holds", False: "VIOLATED", None: ""}[finding.holds]
        table.add_row(finding.name, finding.value, finding.legal, verdict)
    Console(highlight=False, width=None if sys.stdout.isatty() else 170).print(table)
