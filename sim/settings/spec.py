"""What one setting may hold: type, unit, range, choices and help, read from a dataclass field.

Legal field types: bool, int, float, str, Literal, `T | None` with default None, fixed-length tuples of float,
tuples of any length, another settings dataclass, and `tuple[Dataclass, ...]`.
"""

import dataclasses
import difflib
import functools
import inspect
import math
import numbers
import re
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass
from typing import Any

from controller.common.units import Doc, Range, Unit, Words
from sim.errors import UserError

TYPES = "bool, int, float, str, a Literal of words, T | None, a tuple of one of these, or a dataclass of these"
LARGEST = 1e9
"""Of any number in any unit here; beyond it nothing is a walker, and sums lose the digits of what is."""
LARGEST_INTEGER = 2**63 - 1  # of those without a unit, such as seeds: what a database and compiled code can hold
SWITCH = {"true": True, "yes": True, "false": False, "no": False}
LONGEST_SHOWN = 60  # characters of an illegal value that a message repeats


@dataclass(frozen=True, slots=True, kw_only=True)
class Spec:
    """What one field of a settings class may hold.

    Attributes:
        type: bool, int, float, str, or the settings class of a nested table.
        unit: Symbol of the unit, empty for words and switches.
        range: Legal values, None if every finite one is.
        choices: Legal words, empty if every one is.
        words: What else is legal beside the choices, None for nothing.
        length: Number of values of a fixed-length tuple, 0 for a single value.
        repeated: Whether the field holds any number of tables, or of values.
        optional: Whether None is legal.
        help: One sentence.
        default: Default value, `dataclasses.MISSING` if it must be given.
    """

    type: Any
    unit: str
    range: Range | None
    choices: tuple[str, ...]
    words: Words | None
    length: int
    repeated: bool
    optional: bool
    help: str
    default: Any

    @property
    def is_table(self) -> bool:
        """Whether the field holds a nested table, or several."""
        return dataclasses.is_dataclass(self.type)

    @property
    def legal(self) -> str:
        """What may be given, in words, with the unit."""
        if self.choices:
            return "one of " + ", ".join(self.choices) + (f", or {self.words.legal}" if self.words else "")
        noun = {bool: "true or false", int: "an integer", float: "a number", str: "a string"}.get(self.type)
        if self.is_table:
            noun = "an array of tables" if self.repeated else "a table"
        elif self.repeated:
            noun = {float: "a list of numbers", str: "a list of strings"}.get(self.type, "a list")
        words = f"{self.length} numbers" if self.length else str(noun)
        if self.range is not None:
            words += f" {self.range.words}"
        elif self.type is float:
            words = words.replace("number", "finite number")
        return words + (f" [{self.unit}]" if self.unit else "") + (" or none" if self.optional else "")


def specs(cls: Any) -> Mapping[str, Spec]:
    """Field specifications of a settings class, by field name, in order of declaration."""
    return _specs(cls)


@functools.cache
def _specs(cls: Any) -> Mapping[str, Spec]:
    who = f"{re.sub('_[0-9a-f]{12}$', '.py', cls.__module__)}: {cls.__qualname__}"  # as a file's module is called
    try:
        hints = typing.get_type_hints(cls, include_extras=True)
    except Exception as error:  # of a class from outside, whose annotations may be anything
        raise UserError(f"{who}: its annotations: {type(error).__name__}: {error}") from error
    helps: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        helps |= _attribute_helps(base)
    found = {}
    for field in dataclasses.fields(cls):
        if not field.init:
            continue  # made by the class itself
        try:
            spec = _spec(hints[field.name], _default(field), helps.get(field.name, ""))
            if spec.is_table and _holds(spec.type, cls):
                raise TypeError(f"{spec.type.__qualname__} holds {cls.__qualname__} again; tables must come to an end")
        except TypeError as error:
            raise UserError(f"{who}: field {field.name}: {error}") from None
        if not spec.is_table and spec.default is not MISSING:
            leaf(spec.default, spec, f"{who}: default of {field.name}")
        found[field.name] = spec
    return found


def _default(field: "dataclasses.Field[Any]") -> Any:
    if field.default_factory is MISSING:
        return field.default
    try:
        return field.default_factory()
    except Exception as error:  # of a class from outside
        name = getattr(field.default_factory, "__qualname__", "its default")
        words = " ".join(f"{type(error).__name__}: {error}".split())
        raise TypeError(f"{name} cannot be made of defaults: {words}") from error


def _holds(kind: Any, cls: Any) -> bool:
    """Whether a settings class is another, or has a field that holds it."""
    return kind is cls or any(spec.is_table and _holds(spec.type, cls) for spec in specs(kind).values())


def _spec(hint: Any, default: Any, help: str) -> Spec:
    notes: tuple[Any, ...] = getattr(hint, "__metadata__", ())
    hint = typing.get_args(hint)[0] if notes else hint
    optional = typing.get_origin(hint) in (types.UnionType, typing.Union)
    if optional:
        hint = next(arg for arg in typing.get_args(hint) if arg is not types.NoneType)
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    repeated = origin is tuple and Ellipsis in args
    kind = {tuple: args[0] if args else None, typing.Literal: str}.get(origin, hint)
    if kind not in (bool, int, float, str) and not dataclasses.is_dataclass(kind):
        raise TypeError(f"type {hint!r}: must be {TYPES}")
    if origin is tuple and not repeated and len(set(args)) > 1:
        raise TypeError(f"type {hint!r}: a tuple must be of one type")
    if origin is typing.Literal and not all(isinstance(word, str) for word in args):
        raise TypeError(f"type {hint!r}: a Literal must be of words")
    if optional and dataclasses.is_dataclass(kind):
        raise TypeError(f"type {hint!r} | None: a table must be there")
    words = next((note for note in notes if isinstance(note, Words)), None)
    return Spec(
        type=kind,
        unit=next((note.symbol for note in notes if isinstance(note, Unit)), ""),
        range=next((note for note in notes if isinstance(note, Range)), None),
        choices=args if origin is typing.Literal else words.known if words else (),
        words=words,
        length=len(args) if origin is tuple and not repeated else 0,
        repeated=repeated,
        optional=optional,
        help=next((note.text for note in notes if isinstance(note, Doc)), help),
        default=default,
    )


def _attribute_helps(cls: type) -> dict[str, str]:
    """Sentences of a class' own docstring under "Attributes:", up to where the section ends."""
    section = inspect.cleandoc(cls.__doc__ or "").partition("Attributes:\n")[2]
    end = r"^\S" if section[:1].isspace() else r"^(?:[A-Z]\w*:)?$"
    section = re.split(end, section, maxsplit=1, flags=re.MULTILINE)[0]
    found: dict[str, str] = {}
    names: list[str] = []
    for line in inspect.cleandoc(section).splitlines():
        entry = re.match(r"((?:\w+, )*\w+)(?: \([^)]*\))?: *(.*)", line)
        if entry:
            names, line = entry[1].split(", "), entry[2]
        for name in names:
            found[name] = f"{found.get(name, '')} {line.strip()}".strip()
    return found


def leaf(value: Any, spec: Spec, path: str) -> Any:
    """The value in its field's type (an int becomes a float where one is expected), or a `UserError`."""
    if value is None and spec.optional:
        return None
    many = spec.length or spec.repeated
    items = value if many else (value,)
    fits = isinstance(items, list | tuple) and (spec.repeated or len(items) == (spec.length or 1))
    if not fits or not all(_fits(item, spec) for item in items):
        beyond = fits and any(_is_beyond(item, spec) for item in items)
        most = f" and no more than {f'{LARGEST:g}' if spec.type is float else LARGEST_INTEGER}" if beyond else ""
        raise UserError(f"{path} = {_shown(value, spec)}: must be {spec.legal}{most}{_near(value, spec)}")
    items = tuple(spec.type(item) for item in items)
    return items if many else items[0]


def _fits(value: Any, spec: Spec) -> bool:
    if spec.type is float:
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            return False
        try:
            number = float(value)
        except OverflowError:
            return False
        return abs(number) <= LARGEST and (spec.range is None or number in spec.range)
    if spec.type is int:
        if isinstance(value, bool) or not isinstance(value, numbers.Integral):
            return False
        return abs(int(value)) <= LARGEST_INTEGER and (spec.range is None or int(value) in spec.range)
    if type(value) is not spec.type:
        return False
    return not spec.choices or value in spec.choices or (spec.words is not None and spec.words.others(value))


def _is_beyond(item: Any, spec: Spec) -> bool:
    """Whether nothing but its size speaks against a number."""
    largest = {float: LARGEST, int: LARGEST_INTEGER}.get(spec.type, math.inf)
    number = isinstance(item, int | float) and largest < abs(item) < math.inf
    return number and (spec.range is None or item in spec.range)


def _near(value: Any, spec: Spec) -> str:
    near = difflib.get_close_matches(value, spec.choices, n=1) if isinstance(value, str) else ()
    return f"; did you mean {near[0]}?" if near else ""


def _shown(value: Any, spec: Spec) -> str:
    text = repr(value)
    text = text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."
    number = isinstance(value, numbers.Real) and not isinstance(value, bool)
    return f"{text} {spec.unit}" if number and spec.unit else text


def from_text(texts: Sequence[str], spec: Spec, path: str) -> Any:
    """The value of a field from the words of a command line, or from one word with commas, or a `UserError`."""
    many = bool(spec.length or spec.repeated)
    if many and len(texts) == 1 and spec.type is not str:
        texts = texts[0].replace(",", " ").split()
    if spec.optional and all(text.lower() == "none" for text in texts):
        return None
    items: list[Any] = [_number(text, spec.type) if spec.type in (int, float) else text for text in texts]
    if spec.type is bool:
        items = [SWITCH.get(text.lower(), text) for text in texts]
    return leaf(items if many else items[0], spec, path)


def _number(text: str, kind: type) -> Any:
    """The number a text stands for, or the text itself, for `leaf` to reject by name."""
    try:
        return kind(text)
    except ValueError:
        return text
