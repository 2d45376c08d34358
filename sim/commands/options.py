"""Options that several commands share."""

import argparse
import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from controller.common import outside
from controller.common.settings import BUILT_IN
from sim.errors import UserError
from sim.scenario import Scenario, load, with_value
from sim.settings import flags

ESSENTIAL = (
    "steps",
    "seed",
    "walker",
    "gait",
    "controller.kind",
    "controller.horizon",
    "controller.friction",
    "plant.kind",
    "plant.ground.friction",
    "plant.ground.slope",
    "plant.mass_factor.torso",
    "pushes.0.force",
    "pushes.0.step",
    "sensors.angle_noise",
    "actuation.latency",
)
"""Settings that the short help shows."""


def add_out(parser: argparse.ArgumentParser) -> None:
    """The options of a search: where its result goes, and in which form it is printed."""
    parser.add_argument("--seed", type=flags.whole(0), default=0, metavar="INT", help="of the optimiser (default: 0)")
    parser.add_argument("--out", required=True, metavar="FILE.toml", help="the result")
    add_json(parser)


def add_json(parser: Any, what: str = "the result") -> None:
    """`--json`."""
    parser.add_argument("--json", action="store_true", help=f"print {what} as one JSON object")


def add_quiet(parser: Any) -> None:
    """`--quiet`."""
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def add_workers(parser: Any) -> None:
    """`--workers`."""
    from sim.runner import cores

    text = "worker processes (default: one for each core)"
    parser.add_argument("--workers", type=flags.whole(1), default=cores(), metavar="INT", help=text)


def add_scenario(
    commands: Any,
    name: str,
    argv: Sequence[str],
    scenario: Scenario | None,
    *,
    description: str,
    epilog: str,
    default: str | None,
    text: str = "a shipped scenario (cmpc run --list) or a scenario file",
) -> tuple[flags.Parser, Any]:
    """A parser of a command that takes a scenario and every setting of it.

    Args:
        commands: Where the command goes.
        name: Its name.
        argv: Its words, which tell how many pushes they number.
        scenario: Whose values the help shows; None for the defaults.
        description: What the command does.
        epilog: Below the options.
        default: The scenario if none is named.
        text: What the scenario may be.

    Returns:
        The parser and its group of options that are no settings.
    """
    parser = commands.add_parser(
        name,
        usage=f"cmpc {name} [NAME|FILE.toml] [options]",
        description=description,
        epilog=epilog,
        add_help=False,
    )
    parser.add_argument("scenario", nargs="?", metavar="NAME|FILE.toml", help=f"{text} (default: {default})")
    own = parser.add_argument_group("options")
    own.add_argument(
        "-h", "--help", action="store_true", help="show the options that matter most, with the scenario's values"
    )
    own.add_argument("--help-all", action="store_true", help="show every setting as well, by what it belongs to")
    flags.add_settings(parser, with_controller(scenario or Scenario(), argv), argv)
    parser.set_defaults(argv=argv)
    return parser, own


def with_controller(scenario: Scenario, argv: Sequence[str]) -> Scenario:
    """A scenario with the controller that a command line names by a flag or by its scenario file: what there is to set.

    Raises:
        UserError: the controller's code cannot be imported.
    """
    kind = scenario.controller.kind
    for word in argv:
        if word.endswith(".toml") and Path(word).is_file():
            with contextlib.suppress(UserError):  # said later, by name
                kind = load(word).controller.kind
    for name in ("--controller", "--controller.kind"):
        kind = next((word.removeprefix(f"{name}=") for word in argv if word.startswith(f"{name}=")), kind)
        kind = next((argv[i + 1] for i, word in enumerate(argv[:-1]) if word == name), kind)
    named = kind not in BUILT_IN and kind != scenario.controller.kind and outside.is_named(kind)
    return with_value(scenario, "controller.kind", kind) if named else scenario


def show_help(add_parser: Callable[..., None], found: argparse.Namespace, scenario: Scenario) -> None:
    """Print a command's help with the values of a scenario.

    Args:
        add_parser: Adds the command's parser for `(commands, argv, scenario)`.
        found: What was parsed: `help` shows the settings of `ESSENTIAL`, `help_all` every one.
        scenario: Whose values are shown.
    """
    commands = flags.Parser(prog="cmpc").add_subparsers(prog="cmpc")
    add_parser(commands, found.argv, scenario)
    parser = next(iter(commands.choices.values()))
    if not found.help_all:
        for action in parser._actions:
            path = action.dest.removeprefix(flags.PREFIX)
            if action.dest.startswith(flags.PREFIX) and path not in (*ESSENTIAL, *_own(path)):
                action.help = argparse.SUPPRESS
        parser.epilog = f"{parser.epilog}\nmore settings: cmpc {next(iter(commands.choices))} --help-all"
    parser.print_help()


def _own(path: str) -> tuple[str, ...]:
    """The path itself where it is a setting of a controller from outside, of which there are few."""
    return (path,) if path.startswith("controller.settings.") else ()


def scenario_of(found: argparse.Namespace, default: str, add_parser: Callable[..., None]) -> Scenario | None:
    """The scenario that the command line names with its flags applied, None if only help was asked for.

    Raises:
        UserError: the scenario, or a flag, is not legal.
    """
    scenario = load(default if found.scenario is None else found.scenario)
    if found.help or found.help_all:
        show_help(add_parser, found, scenario)
        return None
    return flags.apply(scenario, found)
