"""What an axis of a study is: one or more settings of the scenario that take one value together."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from sim.errors import UserError
from sim.scenario import Scenario
from sim.settings import tree as settings
from sim.settings.spec import Spec, from_text

Value = float | str

SET_BY_TRIAL = ("name", "seed", "controller.kind")
"""Settings of the scenario that belong to the trial."""


class Axis(Protocol):
    """The part every kind of axis shares.

    Attributes:
        name: Name in tables and plots; the first path if empty.
        paths: Dotted paths of settings that all take the axis' value.
        also: Further settings the axis needs, each "path = value".
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def paths(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def also(self) -> tuple[str, ...]: ...  # noqa: D102


def label(axis: Axis) -> str:
    """Name of an axis in tables and plots."""
    return axis.name or axis.paths[0]


def spec_of(axis: Axis, base: Scenario) -> Spec:
    """Specification of the settings an axis moves.

    Raises:
        UserError: no path, an unknown one (the message has the nearest), or paths of different units.
    """
    if not axis.paths:
        raise UserError(f"axis {axis.name!r}: paths is empty; must name at least one setting of the scenario")
    found = [settings.spec_at(base, path) for path in axis.paths]
    if len({(spec.type, spec.unit) for spec in found}) > 1:
        raise UserError(f"axis {label(axis)!r}: its paths have different types or units")
    return found[0]


def changes(axis: Axis, value: Value, base: Scenario) -> dict[str, Any]:
    """Settings that put a scenario at a value of an axis, by dotted path.

    Args:
        axis: The axis.
        value: In the unit of its settings.
        base: The plan's scenario.

    Raises:
        UserError: an unknown path, or a value that is not legal there.
    """
    kind = spec_of(axis, base).type
    whole = kind is int and isinstance(value, float) and value.is_integer()
    typed = int(value) if whole else bool(value) if kind is bool and value in (0.0, 1.0) else value
    return _also(axis.also, base) | dict.fromkeys(axis.paths, typed)


def _also(lines: Sequence[str], base: Scenario) -> dict[str, Any]:
    found = {}
    for line in lines:
        path, equals, text = (part.strip() for part in line.partition("="))
        if not equals:
            raise UserError(f'also = "{line}": must read "path = value"')
        found[path] = from_text([text], settings.spec_at(base, path), path)
    return found


def check_axes(where: str, axes: Sequence[Axis], base: Scenario, *, together: bool) -> None:
    """Refuse axes that would do nothing, or undo one another.

    Args:
        where: The study, in messages.
        axes: Its axes.
        base: The plan's scenario.
        together: Whether all axes take their values at once.

    Raises:
        UserError: names the study, the axis and the setting.
    """
    names: set[str] = set()
    owners: dict[str, str] = {}
    for axis in axes:
        name = label(axis)
        if name in names:
            raise UserError(f"{where}: two axes are called {name!r}; each needs a name of its own")
        names.add(name)
        spec_of(axis, base)
        for path in axis.paths:
            if path in SET_BY_TRIAL:
                raise UserError(f"{where}, axis {name!r}: {path} is set by each trial, so the axis would do nothing")
            if path in owners and (together or owners[path] == name):
                raise UserError(f"{where}: axes {owners[path]!r} and {name!r} both set {path}; one would do nothing")
            owners[path] = name
    settled: dict[str, tuple[str, Any]] = {}
    for axis in axes:
        name = label(axis)
        for path, value in _also(axis.also, base).items():
            own = path in axis.paths
            if path in SET_BY_TRIAL or own or (together and path in owners):
                why = "is set by each trial" if path in SET_BY_TRIAL else f"is what axis {owners[path]!r} sets"
                raise UserError(f"{where}, axis {name!r}: also sets {path}, which {why}")
            other, there = settled.setdefault(path, (name, value))
            if together and there != value:
                raise UserError(f"{where}: axes {other!r} and {name!r} set {path} to {there} and {value}")


def scenario_at(base: Scenario, values: Mapping[str, Any]) -> Scenario:
    """The scenario with settings changed; arrays of tables are filled from their first table on.

    Raises:
        UserError: a value is not legal.
    """
    return settings.with_values(base, dict(sorted(values.items(), key=lambda item: item[0])))
