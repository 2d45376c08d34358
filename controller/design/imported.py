"""A gait of ours from another program's step: samples of a trajectory, or Bezier outputs over a clock of their own.

Both become samples of the five coordinates along one step; our outputs are then fitted to them over our clock, the
ends kept exactly, and polished to the nearest exactly periodic gait.
"""

import csv
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from controller.belief import Gait, WalkerModel
from controller.belief.gait import LARGEST
from controller.common.errors import UserError
from controller.common.records import Vector
from controller.design.parameters import CLOCK, closed

SAMPLES = 201
FEWEST = 12
HIPS = ("left_hip", "right_hip")
COORDINATES = ("left_hip", "left_knee", "right_hip", "right_knee", "torso")
BASE = "base_pitch"
"""The torso's angle about +y, as toolboxes with x forward and z up have it: minus ours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Map:
    """How a coordinate of a file is one of ours: ours = sign theirs + offset."""

    name: str
    sign: float
    offset: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """One step in our coordinates, stance order.

    Attributes:
        q: Coordinates from just after one impact to just before the next in [rad], (K, 5).
        time: Its duration in [s], NaN where the file tells none.
    """

    q: Vector
    time: float


def read_csv(text: str, where: str) -> dict[str, Vector]:
    """Columns of a CSV with a header, numbers below it.

    Raises:
        UserError: no header, a cell that is no number, or two columns of one name.
    """
    reader = csv.reader(text.splitlines())
    try:
        lines = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise UserError(f"{where}: line {reader.line_num}: {error}; must be a CSV of numbers") from error
    if len(lines) <= FEWEST:
        raise UserError(
            f"{where}: {max(len(lines) - 1, 0)} samples below the header; must be {FEWEST} or more, of one step"
        )
    names = [cell.strip() for cell in lines[0][1]]
    if len({*names}) < len(names):
        name, count = Counter(names).most_common(1)[0]
        raise UserError(f"{where}: {count} columns {name[:40]!r}; must be one of each name")
    values = np.empty((len(lines) - 1, len(names)))
    for sample, (number, row) in zip(values, lines[1:], strict=True):
        try:
            if len(row) != len(names):
                raise ValueError(f"{len(row)} cells")
            sample[:] = [float(cell) for cell in row]
        except ValueError as error:
            legal = f"{len(names)} numbers as in the header"
            raise UserError(f"{where}: line {number}: {str(error)[:100]}; must be {legal}") from error
    if not np.isfinite(values).all():
        raise UserError(f"{where}: a value is not finite")
    return {name: values[:, i] for i, name in enumerate(names)}


def sample_bezier(data: Mapping[str, Any], where: str) -> dict[str, Vector]:
    """Columns of a file of Bezier outputs over a linear clock, sampled.

    Args:
        data: `outputs`, names of four coordinates; `alpha`, (4, M + 1), or (M + 1) numbers a row; `clock`, a table of
            coefficients by coordinate, the fifth among them; `clock_offset`; `clock_range`, after to before impact.
        where: The file, for messages.

    Raises:
        UserError: something of it is missing or of another shape.
    """
    outputs, clock = data.get("outputs"), data.get("clock")
    if not (isinstance(outputs, list) and len(outputs) == 4 and all(isinstance(name, str) for name in outputs)):
        raise UserError(f"{where}: outputs = {str(outputs)[:60]}; must be the names of four coordinates")
    if not (isinstance(clock, Mapping) and all(map(_is_number, clock.values()))):
        raise UserError(
            f"{where}: clock = {str(clock)[:60]}; must be a table of coefficients by coordinate, up to {LARGEST:g}"
        )
    fifth = [name for name in clock if name not in outputs]
    if len(fifth) != 1 or not clock[fifth[0]]:
        raise UserError(f"{where}: clock has {fifth} beside the outputs; must be one more, its coefficient not 0")
    alpha, span = (_numbers(data, key, where) for key in ("alpha", "clock_range"))
    if alpha.ndim != 2 or alpha.shape[0] != 4 or alpha.shape[1] < 4 or span.shape != (2,) or span[0] == span[1]:
        raise UserError(f"{where}: alpha {alpha.shape}, clock_range {span.shape}; must be (4, 4 or more), (2,)")
    offset = data.get("clock_offset", 0.0)
    if not _is_number(offset):
        raise UserError(f"{where}: clock_offset = {str(offset)[:40]}; must be a number up to {LARGEST:g}")
    s = np.linspace(0.0, 1.0, SAMPLES)
    values = alpha @ _basis(s, alpha.shape[1] - 1).T
    rest = span[0] + s * (span[1] - span[0]) - offset
    columns = {}
    for name, row in zip(outputs, values, strict=True):
        columns[name] = row
        rest = rest - float(clock.get(name, 0.0)) * row
    columns[fifth[0]] = rest / float(clock[fifth[0]])
    return columns


def _basis(s: Vector, degree: int) -> Vector:
    """Bernstein polynomials at each s, (K, degree + 1)."""
    return np.array([[math.comb(degree, k) * x**k * (1.0 - x) ** (degree - k) for k in range(degree + 1)] for x in s])


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST


def _numbers(data: Mapping[str, Any], key: str, where: str) -> Vector:
    try:
        found = np.array(data[key], dtype=float)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise UserError(f"{where}: {key} is missing or no array of numbers") from error
    if not np.isfinite(found).all():
        raise UserError(f"{where}: {key} holds a value that is not finite")
    return found


def step_of(columns: Mapping[str, Vector], maps: Mapping[str, Map], stance: str, *, degrees: bool, where: str) -> Step:
    """One step in our coordinates.

    Args:
        columns: The file's, by name; `t` in [s] where it has it.
        maps: Of our coordinates onto the file's names; those that are not mapped have our own names.
        stance: "left" or "right", the foot that stands.
        degrees: Whether angles are in degrees.
        where: The file, for messages.

    Raises:
        UserError: a coordinate is missing.
    """
    unit = math.pi / 180.0 if degrees else 1.0
    found = {}
    for ours in COORDINATES:
        map_ = maps.get(ours, Map(name=ours, sign=1.0, offset=0.0))
        if ours in columns:
            found[ours] = unit * columns[ours]
        elif map_.name in columns:
            found[ours] = map_.sign * unit * columns[map_.name] + map_.offset
        elif ours == "torso" and BASE in columns:
            found[ours] = -unit * columns[BASE]
        else:
            names = ", ".join(dict.fromkeys((ours, map_.name, *((BASE,) if ours == "torso" else ()))))
            raise UserError(f"{where}: no column {names}; it has {', '.join(columns)}")
    for hip in HIPS:  # near half a turn: the femurs hang
        found[hip] = np.unwrap(found[hip])
        found[hip] += 2.0 * math.pi * np.round((math.pi - found[hip].mean()) / (2.0 * math.pi))
    other = "right" if stance == "left" else "left"
    order = (f"{stance}_hip", f"{other}_hip", f"{stance}_knee", f"{other}_knee", "torso")
    t = columns.get("t")
    return Step(q=np.column_stack([found[name] for name in order]), time=math.nan if t is None else float(t[-1] - t[0]))


def fit(model: WalkerModel, step: Step, degree: int, name: str, source: str, where: str) -> tuple[Gait, float]:
    """Our outputs over our clock, fitted to a step; and the largest distance of a sample from them in [rad].

    Raises:
        UserError: our clock does not grow along the step, or it is not long enough for the degree.
    """
    if not 4 <= degree <= 10:
        raise UserError(f"degree = {degree}; must be 4 to 10")
    theta = step.q @ CLOCK
    if not (np.diff(theta) > 0.0).all():
        worst = float(np.diff(theta).min())
        raise UserError(
            f"{where}: the stance leg does not sweep forward all along the step (clock step {worst:.3g} rad); must be "
            "one step, from after an impact to before the next, of the leg that stands"
        )
    s = (theta - theta[0]) / (theta[-1] - theta[0])
    basis = _basis(s, degree)
    q = step.q[:, :4]
    alpha = np.empty((4, degree + 1))
    alpha[:, 0], alpha[:, -1] = q[0], q[-1]
    rest = q - basis[:, [0, -1]] @ alpha[:, [0, -1]].T
    alpha[:, 1:-1] = np.linalg.lstsq(basis[:, 1:-1], rest, rcond=None)[0].T
    residual = float(np.abs(basis @ alpha.T - q).max())
    gait = Gait.of(name=name, source=source, alpha=alpha, clock=CLOCK, q_minus=step.q[-1].copy(), dq_minus=np.zeros(5))
    return closed(model, gait), residual
