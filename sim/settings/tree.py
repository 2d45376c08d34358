"""A tree of frozen dataclasses as settings: read strictly, changed by dotted path, listed, written as TOML.

Nothing here knows what a setting means. A field's annotation tells its type, unit and range; the `Attributes`
section of its class tells its help; `sim.settings.spec` reads both. A class with a class method
`read_as(table) -> (class, table)` chooses itself by what is in its table; a part of it that another choice does not
know stays behind when the choice changes (`Carried`).
"""

import dataclasses
import difflib
import json
import numbers
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass
from typing import Any, TypeVar

from controller.common.toml import quoted
from sim.errors import UserError
from sim.settings.spec import Spec, leaf, specs

T = TypeVar("T")
OWN = ("sim", "controller")  # packages whose errors are defects


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A row of the table of settings: dotted path of a leaf, its present value, and its `Spec`."""

    path: str
    value: Any
    spec: Spec


def build(cls: type[T], table: Any, path: str = "") -> T:
    """Settings from nested dicts and lists, as `tomllib` reads them.

    Raises:
        UserError: an unknown or missing key, a wrong type, or a value out of range; names the dotted path.
    """
    if not isinstance(table, Mapping):
        raise UserError(f"{path} = {table!r}: must be a table with the keys {', '.join(specs(cls))}")
    chooses: Any = getattr(cls, "read_as", None)
    if chooses is not None:
        cls, table = chooses(table)
    for key in table:
        if key not in specs(cls) and not _stays_behind(table, key):
            raise UserError(f"{join(path, key)}: unknown key{_hint(key, path, cls)}")
    values = {}
    for name, spec in specs(cls).items():
        if name in table:
            values[name] = _field(table[name], spec, join(path, name))
        elif spec.default is MISSING and spec.is_table and not spec.repeated:
            values[name] = build(spec.type, {}, join(path, name))
        elif spec.default is MISSING:
            raise UserError(f"{join(path, name)}: missing; must be {spec.legal}")
    try:
        built = cls(**values)
    except UserError:
        raise
    except Exception as error:  # a class from outside may refuse what its annotations allow
        if cls.__module__.partition(".")[0] in OWN:
            raise
        raise UserError(f"{path}: {type(error).__name__}: {' '.join(str(error).split())}") from error
    _remember(built)
    return built


class Carried(dict[str, Any]):
    """A table that came along with a copy; only what was `given` since must fit the class that is chosen now."""

    def __init__(self, table: Mapping[str, Any]) -> None:
        """Args: table: what came along."""
        super().__init__(table)
        self.given: set[str] = set()

    def __setitem__(self, key: str, value: Any) -> None:
        self.given.add(key)
        super().__setitem__(key, value)


def _stays_behind(table: Mapping[str, Any], key: str) -> bool:
    """Whether an unknown key only came along."""
    value = table[key]
    return (isinstance(table, Carried) and key not in table.given) or (isinstance(value, Carried) and not value.given)


def _field(value: Any, spec: Spec, path: str) -> Any:
    if not spec.is_table:
        return leaf(value, spec, path)
    if not spec.repeated:
        return build(spec.type, value, path)
    if not isinstance(value, list | tuple):
        raise UserError(f"{path} = {value!r}: must be {spec.legal}")
    return tuple(build(spec.type, item, join(path, str(index))) for index, item in enumerate(value))


def _hint(key: str, path: str, cls: type) -> str:
    near = difflib.get_close_matches(key, list(specs(cls)), n=1, cutoff=0.5)
    if near:
        return f"; did you mean {join(path, near[0])}? Must be one of {', '.join(specs(cls))}"
    return f"; must be one of {', '.join(specs(cls))}" if specs(cls) else "; it has none"


def check(settings: Any) -> None:
    """Check type and range of every leaf; for settings that were built by hand.

    Raises:
        UserError: names the dotted path, the value, the unit and what is legal.
    """
    _check(settings, "")


_CHECKED: dict[int, Any] = {}
"""Tables known to be legal by their identity, which holds as long as they stand here: a copy with one value changed
shares all other tables with its original, and these are not checked again."""
MOST_CHECKED = 4096


def _remember(table: Any) -> None:
    if len(_CHECKED) >= MOST_CHECKED:
        _CHECKED.clear()
    _CHECKED[id(table)] = table


def _check(settings: Any, path: str) -> None:
    if _CHECKED.get(id(settings)) is settings:
        return
    for name, spec in specs(type(settings)).items():
        value, here = getattr(settings, name), join(path, name)
        if not spec.is_table:
            leaf(value, spec, here)
        elif spec.repeated:
            for index, item in enumerate(value):
                _check(item, join(here, str(index)))
        else:
            _check(value, here)
    _remember(settings)


def table(settings: Any, path: str = "") -> Iterator[Setting]:
    """Every leaf of a settings object with its dotted path; tables of an array are numbered from 0."""
    for name, spec in specs(type(settings)).items():
        value, here = getattr(settings, name), join(path, name)
        if not spec.is_table:
            yield Setting(path=here, value=value, spec=spec)
        elif spec.repeated:
            for index, item in enumerate(value):
                yield from table(item, join(here, str(index)))
        else:
            yield from table(value, here)


def spec_at(settings: Any, path: str) -> Spec:
    """The specification of one leaf by its dotted path; an array may be one table longer than it is.

    Args:
        settings: Where to look.
        path: "plant.mass_factor.torso", "pushes.0.force", "start.q_offset.4".

    Raises:
        UserError: no such leaf; the message has the nearest path.
    """
    at: Any = settings  # a table, or the class of one that is not there yet
    spec: Spec | None = None
    for key in path.split("."):
        if spec is not None and (spec.repeated or spec.length) and key.isdecimal():
            at = at[int(key)] if isinstance(at, tuple) and int(key) < len(at) else spec.type
            spec = dataclasses.replace(spec, repeated=False, length=0)
        elif spec is None or (spec.is_table and not spec.repeated):
            spec = specs(_class_of(at)).get(key)
            at = (spec.type if isinstance(at, type) else getattr(at, key)) if spec is not None else at
        else:
            spec = None
        if spec is None:
            break
    if spec is None or spec.is_table or spec.repeated or spec.length:
        paths = list(_leaf_paths(settings, ""))
        near = difflib.get_close_matches(path, paths, n=1, cutoff=0.4)
        raise UserError(f"{path}: no such setting" + (f"; did you mean {near[0]}?" if near else ""))
    return spec


def _class_of(at: Any) -> Any:
    return at if isinstance(at, type) else type(at)


def _leaf_paths(at: Any, path: str) -> Iterator[str]:
    for name, spec in specs(_class_of(at)).items():
        here = join(path, name) + (".0" if spec.repeated or spec.length else "")
        if spec.is_table:
            yield from _leaf_paths(spec.type if spec.repeated or isinstance(at, type) else getattr(at, name), here)
        else:
            yield here


def as_tree(settings: Any) -> dict[str, Any]:
    """Settings as nested dicts and lists; `build` is its inverse."""
    return {
        name: _plain(getattr(settings, name)) if name not in getattr(settings, "own", ()) else _carried(settings, name)
        for name in specs(type(settings))
    }


def _carried(settings: Any, name: str) -> Carried:
    """A table that only the class chosen now has."""
    return Carried(as_tree(getattr(settings, name)))


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return as_tree(value)
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


def with_values(settings: T, changes: Mapping[str, Any]) -> T:
    """A copy with several leaves changed at once, so that values that must agree can change together.

    Args:
        settings: What to start from.
        changes: New values by dotted path, "plant.mass_factor.torso". Tables of an array are numbered from 0;
            the number after the last one appends a table.

    Raises:
        UserError: an unknown path or an illegal value.
    """
    tree = as_tree(settings)
    for path, value in changes.items():
        node: Any = tree
        *parents, last = path.split(".")
        for depth, key in enumerate(parents):
            node = _child(node, key, ".".join(parents[:depth]), path)
        _child(node, last, ".".join(parents), path)
        node[int(last) if isinstance(node, list) else last] = value
    return build(type(settings), tree)


def _child(node: Any, key: str, at: str, path: str) -> Any:
    """The entry `key`, made empty if it is new; `build` judges unknown names later."""
    if isinstance(node, dict):
        return node.setdefault(key, {})
    if not isinstance(node, list):
        raise UserError(f"{path}: unknown key; {at} is a single value")
    last = len(node) if not node or isinstance(node[0], dict) else len(node) - 1
    if not re.fullmatch(r"[0-9]+", key) or int(key) > last:
        raise UserError(f"{path}: {key!r} is no index of {at}; must be 0 to {last}")
    if int(key) == len(node):
        node.append({})
    return node[int(key)]


def to_toml(settings: Any) -> str:
    """Settings as TOML text that reads back equal; None is written by leaving the key out."""
    return "\n".join(_toml_lines(settings, "")).strip() + "\n"


def toml_line(row: Setting) -> str:
    """One setting as a line of TOML by its path, its unit beside it."""
    return f"{row.path} = {_toml_value(row.value)}" + (f"  # [{row.spec.unit}]" if row.spec.unit else "")


def _toml_lines(settings: Any, path: str) -> Iterator[str]:
    fields = specs(type(settings)).items()
    for name, spec in fields:
        if not spec.is_table and getattr(settings, name) is not None:
            yield toml_line(Setting(path=_bare(name), value=getattr(settings, name), spec=spec))
    for name, spec in fields:
        if spec.is_table:
            here, value = f"{path}.{_bare(name)}" if path else _bare(name), getattr(settings, name)
            for item in value if spec.repeated else (value,):
                yield f"\n[[{here}]]" if spec.repeated else f"\n[{here}]"
                yield from _toml_lines(item, here)


def _bare(key: str) -> str:
    """A key as TOML takes it: quoted where it is not of ASCII."""
    return key if key.isascii() else json.dumps(key, ensure_ascii=False)


def _toml_value(value: bool | float | str | Sequence[float]) -> str:
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Sequence):
        return f"[{', '.join(map(_toml_value, value))}]"
    return repr(int(value) if isinstance(value, numbers.Integral) else float(value))


def join(path: str, key: str) -> str:
    """Dotted path of a key under a path; a key that TOML would have to quote is quoted."""
    key = key if re.fullmatch(r"[\w-]+", key) else json.dumps(key)
    return f"{path}.{key}" if path else key
