"""A file of limits, as `cmpc limit` writes it, and which of its rows an axis of a margin study is held against."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from controller.common import toml
from sim import pages
from sim.errors import UserError
from sim.scenario import Scenario
from sim.scenario.files import is_file, shipped_names

OF_QUESTION = ("axis", "step", "seconds", "friction", "longest_step", "torso", "steps", "blind", "controller")
"""What makes two rows answers to one question."""

NEEDED = {
    "axis": str,
    "words": str,
    "value": float,
    "unit": str,
    "step": int,
    "friction": float,
    "at_bound": bool,
    "sure": str,
}
"""What a row must have; numbers are finite."""

KNOWN = {
    "seconds": float,
    "blind": float,
    "longest_step": float,
    "torso": float,
    "steps": int,
    "controller": str,
    "trusted": bool,
}
"""What it may have too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """How much any controller could hold, as far as was found.

    Attributes:
        walker: Fingerprint of the walker.
        gait: Its gait.
        rows: Answers.
    """

    walker: str
    gait: str
    rows: tuple[Mapping[str, Any], ...]

    def with_row(self, row: Mapping[str, Any]) -> "Limits":
        """With an answer, in the place of an older one to the same question."""
        kept = [old for old in self.rows if not _alike(old, row)]
        return replace(self, rows=(*kept, row))

    def row_of(self, key: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """The answer to a question, None where there is none."""
        return next((row for row in self.rows if _alike(row, key)), None)

    def write(self, path: Path) -> None:
        """Write the file, at once or not at all.

        Raises:
            UserError: it cannot be written.
        """
        lines = [
            "# How much any controller could hold, by cmpc limit: local optima, proofs in neither direction.",
            f"walker = {toml.quoted(self.walker)}",
            f"gait = {toml.quoted(self.gait)}",
        ]
        for row in self.rows:
            lines += ["", "[[limits]]", *(f"{key} = {_toml(value)}" for key, value in row.items())]
        pages.write(path, "\n".join(lines) + "\n")

    def beside(self, scenario: Scenario, path: str, sign: int) -> Mapping[str, Any] | None:
        """The row that an axis of trials is held against, None where there is none.

        A push through a later step may have no limit, since who knows of it prepares for it in the steps before. It is
        then held against the same push through the first step: on its gait a walker begins every step alike.

        Args:
            scenario: With a value of the axis set.
            path: Setting that the axis varies.
            sign: Which way it is varied, -1 or 1.
        """
        name, step = _asked(scenario, path, sign)
        known = [row for row in self.rows if row["axis"] == name and not {"seconds", "blind"} & {*row}]
        known = [row for row in known if row.get("trusted", not row["at_bound"])]
        rows = [row for row in known if row["step"] == step] or [row for row in known if row["step"] == 1]
        mu = scenario.plant.ground.friction
        return min(rows, key=lambda row: abs(row["friction"] - mu), default=None)


def _alike(row: Mapping[str, Any], key: Mapping[str, Any]) -> bool:
    return all(row.get(name) == key.get(name) for name in OF_QUESTION)


SHIPPED = Path(__file__).parent / "shipped" / "limits"


def shipped_limits(name: str) -> Limits:
    """A file of limits by its path, or a shipped one by its name.

    Raises:
        UserError: there is none, or it is none.
    """
    if name.endswith(".toml"):
        return read_limits(Path(name))
    if is_file(path := SHIPPED / f"{name}.toml"):
        return read_limits(path)
    known = ", ".join(shipped_names(SHIPPED))
    raise UserError(f"limits = {name!r}: no such file of limits; must be {known}, or a .toml file of cmpc limit")


def limits_of(name: str, scenario: Scenario) -> Limits:
    """A file of limits, of a scenario's own walker; its gait may be another of it.

    Raises:
        UserError: there is none, it is none, or it is of another walker.
    """
    from sim.bridge.limits import fingerprint

    limits, walker = shipped_limits(name), fingerprint(scenario.walker, scenario.gait)
    if limits.walker != walker:
        raise UserError(
            f"limits = {name!r}: are of walker {limits.walker}; must be of the plan's, {scenario.walker!r} ({walker})"
        )
    return limits


def _asked(scenario: Scenario, path: str, sign: int) -> tuple[str, int]:
    """Axis of `cmpc limit` and step of a setting varied."""
    push = scenario.pushes[0] if len(scenario.pushes) == 1 else None
    plain = push is not None and push.body == "torso" and push.point is None and push.direction == 0.0
    way, ground = ("forward", "up") if sign > 0 else ("back", "down"), scenario.plant.ground
    if path == "pushes.0.force" and push and plain and push.step is not None:
        return f"push-{way[0]}", push.step
    if path == "pushes.0.impulse" and push and plain and push.step is not None:
        return f"impulse-{way[0]}", push.step
    if path == "plant.ground.slope" or (path == "plant.ground.ramps.0.slope" and ground.ramps[0].length > 5.0):
        return f"slope-{way[1]}", 1
    if path == "plant.ground.ledges.0.height" and len(ground.ledges) == 1:
        return f"step-{way[1]}", 2
    if path == "plant.mass_factor.torso" and sign > 0:
        return "load", 1
    return ("friction", 1) if path == "plant.ground.friction" and sign < 0 else ("", 0)


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(key)} = {_toml(item)}" for key, item in value.items()) + " }"
    return toml.quoted(value) if isinstance(value, str) else json.dumps(value)


def read_limits(path: Path) -> Limits:
    """Read a file of limits.

    Raises:
        UserError: it is missing, unreadable, or none.
    """
    try:
        table = toml.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: no file of limits that can be read; must be made by cmpc limit --out") from error
    except ValueError as error:
        raise UserError(f"{path}: not TOML ({error}); must be made by cmpc limit --out") from error
    rows = table.get("limits", [])
    if not isinstance(rows, list) or not all(isinstance(table.get(key), str) for key in ("walker", "gait")):
        raise UserError(f"{path}: no file of limits; must be made by cmpc limit --out")
    for number, row in enumerate(rows):
        try:
            _check_row(row if isinstance(row, Mapping) else {})
        except UserError as error:
            raise UserError(f"{path}: limits.{number}.{error}") from None
    return Limits(walker=table["walker"], gait=table["gait"], rows=tuple(rows))


def _check_row(row: Mapping[str, Any]) -> None:
    """Refuse a row that cannot be drawn beside an axis, or written again."""
    from sim.bridge.limits import AXES

    words = {str: "text", float: "a number", int: "a whole number", bool: "true or false"}
    for key, kind in (NEEDED | {key: kind for key, kind in KNOWN.items() if key in row}).items():
        value = row.get(key)
        legal = isinstance(value, (int, float) if kind is float else kind)
        if not legal or (isinstance(value, bool) and kind is not bool):
            raise UserError(f"{key} = {value!r}: must be {words[kind]}")
    for key, value in row.items():
        if not _is_plain(value):
            raise UserError(f"{key} = {value!r}: must be finite numbers and text")
    if row["axis"] not in AXES:
        raise UserError(f"axis = {row['axis']!r}: must be one of {', '.join(AXES)}")
    axis = AXES[row["axis"]]
    if row["unit"] != axis.unit:
        raise UserError(f"unit = {row['unit']!r}: must be {axis.unit!r} for {row['axis']}")
    sign = 1.0 if axis.kind == "friction" else axis.sign  # the least friction is asked for, and it is above 0
    if row["value"] * sign < 0.0:
        raise UserError(f"value = {row['value']:g} {axis.unit}: must be 0 or {'above' if sign > 0.0 else 'below'}")


def _is_plain(value: Any) -> bool:
    if isinstance(value, Mapping):
        return all(map(_is_plain, value.values()))
    if isinstance(value, list):
        return all(map(_is_plain, value))
    return isinstance(value, str | int) or (isinstance(value, float) and math.isfinite(value))
