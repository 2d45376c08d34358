"""Command-line flags made from the table of settings: `--plant.mass-factor.torso 2`.

Every setting of a scenario is a flag by its dotted path, with its unit as the placeholder in the help. Pushes
are numbered from 0; a number one past the last adds a push.
"""

import argparse
import difflib
import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import MISSING
from typing import Any, NoReturn, TypeVar

from sim.errors import UserError
from sim.settings import tree as settings
from sim.settings.spec import Spec, from_text, specs
from sim.settings.tree import Setting

T = TypeVar("T")

MOST_NAMED = 4  # settings whose paths end alike
LIKE, LIKE_END = 0.55, 0.8
"""How like a mistyped word must be to a whole name, and to the end of a dotted path."""

PREFIX = "setting:"  # marks settings among the attributes of a parsed command line


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaints are `UserError`s and which takes -1e-3 for a number.

    What it parses has the parser that was chosen last, a sub-command's, as `parser`.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter, **kwargs)
        self._negative_number_matcher = re.compile(r"^-(\d|\.\d|inf|nan)")
        self.set_defaults(parser=self)

    def error(self, message: str) -> NoReturn:
        """Complain in one line, with the unit or the words the option takes."""
        option = re.match(r"argument ([^\s,/:]+)[^:]*:? ", message)
        action = self._option_string_actions.get(option[1]) if option else None
        if option:
            message = f"{option[1]} {message[option.end() :]}"
        unit = action.metavar if action else ""
        raise UserError(f"{message} [{' '.join(unit) if isinstance(unit, tuple) else unit}]" if unit else message)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        what = f"{'/'.join(action.option_strings)} {value}" if action.option_strings else f"{self.prog} {value}"
        raise UserError(f"{what}: unknown; {nearest(str(value), action.choices)}must be {_listed(action.choices)}")

    def parse(self, argv: Sequence[str]) -> argparse.Namespace:
        """Parse a whole command line; - and _ in the names of flags are the same.

        Raises:
            UserError: an unknown flag (the message names the nearest), or a missing or illegal value.
        """
        found, unknown = self.parse_known_args([_hyphenated(word) for word in argv])
        for word in unknown:
            near = nearest(word.partition("=")[0], found.parser._option_string_actions).rstrip(" ")
            kind = "option" if word.startswith("-") else "argument"
            raise UserError(f"unknown {kind} {word}; {near or f'see {found.parser.prog} --help'}")
        return found


def nearest(word: str, known: Iterable[str]) -> str:
    """The question "did you mean ...? ", empty where nothing known is like the word.

    Of a dotted path its end will do: "--slope" is near "--plant.ground.slope".
    """
    names = list(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=LIKE)
    ends = {name.rpartition(".")[2]: name for name in reversed(names) if "." in name}
    end = difflib.get_close_matches(word.lstrip("-"), ends, n=1, cutoff=LIKE_END)
    sure = near and difflib.SequenceMatcher(None, word, near[0]).ratio() >= LIKE_END
    begun = [name for name in names if "." in name and len(word) > 4 and f".{word.lstrip('-')}" in name]
    found = near[:1] if sure else [ends[end[0]]] if end else begun[:1] or near[:1]
    same = [name for name in names if "." in name and name.rpartition(".")[2] == word.lstrip("-")]
    return f"did you mean {_listed(same[:MOST_NAMED] or found[:1])}? " if same or found else ""


def _listed(words: Iterable[Any]) -> str:
    *first, last = map(str, words)
    return f"{', '.join(first)} or {last}" if first else last


def whole(least: int) -> Callable[[str], int]:
    """Type of an option that takes a whole number, `least` or above."""

    def read(text: str) -> int:
        if not re.fullmatch(r"[+-]?\d{1,18}", text) or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text}: must be {least} or above, a whole number")
        return int(text)

    return read


def real(above: float = -math.inf, most: float = math.inf) -> Callable[[str], float]:
    """Type of an option that takes a finite number above one bound and at or below another."""
    bounds = [f"above {above:g}"] * math.isfinite(above) + [f"at most {most:g}"] * math.isfinite(most)

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or not above < value <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be a finite number {' and '.join(bounds)}".rstrip())
        return value

    return read


def _hyphenated(word: str) -> str:
    name, equals, value = word.partition("=")
    return name.replace("_", "-") + equals + value if word.startswith("--") else word


def add_settings(parser: argparse.ArgumentParser, tree: Any, argv: Sequence[str] = ()) -> None:
    """Give a parser one flag for each setting.

    Args:
        parser: Where the flags go, in one group a table.
        tree: A tree of settings; its values are the defaults the help shows.
        argv: The command line to come, which tells how many pushes it numbers.
    """
    order = list(specs(type(tree)))
    rows = [*settings.table(tree), *_further_tables(tree, argv)]
    rows.sort(key=lambda row: ("." in row.path, order.index(row.path.split(".")[0]), row.path.rpartition(".")[0]))
    for table, members in itertools.groupby(rows, key=lambda row: row.path.rpartition(".")[0]):
        group = parser.add_argument_group(table.replace("_", "-") or "scenario")
        for setting in members:
            _add_flag(group, setting)


def _further_tables(tree: Any, argv: Sequence[str]) -> Iterator[Setting]:
    """Settings of tables an array does not have yet: one past the last, or as many as `argv` numbers."""
    for path, spec, there in _arrays(tree, ""):
        pattern = re.compile(rf"--{re.escape(path)}\.(\d{{1,3}})\.")
        matches = (pattern.match(word.replace("_", "-")) for word in argv)
        last = max((int(match[1]) for match in matches if match), default=0)
        for index in range(there, max(there, last) + 1):
            for field, inner in specs(spec.type).items():
                yield Setting(path=f"{path}.{index}.{field}", value=inner.default, spec=inner)


def _arrays(tables: Any, path: str) -> Iterator[tuple[str, Spec, int]]:
    """Every array of tables: dotted path, specification, number of tables in it."""
    for name, spec in specs(type(tables)).items():
        here, value = settings.join(path, name), getattr(tables, name)
        if spec.repeated and spec.is_table:
            yield here, spec, len(value)
        elif spec.is_table:
            yield from _arrays(value, here)


def _add_flag(group: Any, setting: Setting) -> None:
    spec, dest = setting.spec, PREFIX + setting.path
    flag = "--" + setting.path.replace("_", "-")
    text = f"{spec.help} (default: {_shown(setting.value)})".replace("%", "%%")
    short = ["--controller"] if setting.path == "controller.kind" else []
    if spec.type is bool and not (spec.length or spec.repeated):
        table, _, name = flag.rpartition(".")
        negative = f"{table}.no-{name}" if table else f"--no-{name[2:]}"
        group.add_argument(flag, dest=dest, action="store_const", const=True, default=None, help=text)
        group.add_argument(negative, dest=dest, action="store_const", const=False, default=None)
    else:
        metavar = (
            "|".join(spec.choices)
            or spec.unit
            or {int: "INT", float: "FLOAT", bool: "true|false"}.get(spec.type, "TEXT")
        )
        group.add_argument(
            *short, flag, dest=dest, nargs=spec.length or ("+" if spec.repeated else 1), metavar=metavar, help=text
        )


def _shown(value: Any) -> str:
    if value is MISSING:
        return "none, must be given"
    if isinstance(value, tuple):
        return " ".join(map(_shown, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value).lower() if value is None else str(value)


def changes(tree: Any, found: argparse.Namespace) -> dict[str, Any]:
    """Every setting that the command line gave, by dotted path.

    Raises:
        UserError: names the flag, the value, the unit and what is legal.
    """
    given = {key.removeprefix(PREFIX): value for key, value in vars(found).items() if key.startswith(PREFIX)}
    words = {path: value for path, value in given.items() if value is not None}
    read: dict[str, Any] = {}
    at = tree
    try:
        while words:  # again where a word chose a table that the others are for
            rows = {row.path: row.spec for row in settings.table(at)}
            rows |= {row.path: row.spec for row in _further_tables(at, [f"--{path}" for path in given])}
            known = [path for path in words if path in rows]
            for path in known or list(words):
                value = words.pop(path)
                spec = rows[path] if known else settings.spec_at(at, path)
                read[path] = from_text(value, spec, path) if isinstance(value, list) else value
            at = settings.with_values(tree, read)
    except UserError as error:
        raise UserError(f"--{error}") from error
    return read


def apply(tree: T, found: argparse.Namespace) -> T:
    """The tree with every setting changed that the command line gave.

    Raises:
        UserError: names the flag, the value, the unit and what is legal.
    """
    return settings.with_values(tree, changes(tree, found))
