"""`cmpc completion`: a shell's completion of commands, actions, options and shipped names."""

import argparse
import importlib
from argparse import Namespace
from collections.abc import Mapping, Sequence
from typing import Any

from sim.settings import flags

SHELLS = ("bash", "zsh", "tcsh")
EPILOG = """\
  bash   cmpc completion bash > ~/.local/share/bash-completion/completions/cmpc
  zsh    cmpc completion zsh > a folder of $fpath, as _cmpc
"""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc completion`."""
    parser = commands.add_parser("completion", description="Print the completion for a shell.", epilog=EPILOG)
    parser.add_argument("shell", choices=SHELLS, help="whose completion")
    parser.set_defaults(run=_run, commands=commands)


def _run(found: Namespace) -> int:
    import shtab

    lines = {action.dest: str(action.help) for action in found.commands._choices_actions}
    print(shtab.complete(whole(lines | {"completion": "completion for a shell"}), shell=found.shell))
    return 0


def whole(lines: Mapping[str, str]) -> argparse.ArgumentParser:
    """The program's parser with every command in it, whichever is asked for; `lines`: what each does, by its name."""
    from sim.scenario import files
    from sim.trials.plan.plan import shipped_names

    parser = flags.Parser(prog="cmpc")
    parser.add_argument("--version", action="store_true")
    commands = parser.add_subparsers()
    for name, line in lines.items():
        importlib.import_module(f"sim.commands.{name}").add_parser(commands, [])
        if name not in {action.dest for action in commands._choices_actions}:  # shtab lists those with a help
            commands._choices_actions.append(commands._ChoicesPseudoAction(name, (), line))
    names = {"scenario": files.shipped_names(files.SHIPPED), "plan": shipped_names()}
    for command in _all(parser):
        for action in command._actions:
            _describe(action, names)
    return parser


def _all(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    """A parser and those of its sub-commands."""
    found = [parser]
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                found += _all(command)
    return found


def _describe(action: argparse.Action, names: dict[str, list[str]]) -> None:
    """Tell what completes an argument: names, words or a file; nothing is parsed with what is said here."""
    import shtab

    text = " ".join(action.metavar) if isinstance(action.metavar, tuple) else str(action.metavar or "")
    if action.dest in names and not action.option_strings:
        action.choices = names[action.dest]
    elif "|" in text and "." not in text and "FILE" not in text and text.islower():
        action.choices = text.split("|")
    elif any(word in text for word in ("FILE", "PATH", "mcap", "OUT")):
        action.complete = shtab.FILE  # type: ignore[attr-defined]
    elif any(word in text for word in ("DIR", "FOLDER")):
        action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
