"""A library of gaits over speed and step length, and gaits between its own.

Neighbours are mixed in the free numbers of `design.parameters`, so a mixture is hybrid invariant and periodic for the
same reason as its neighbours are; only its speed and its margins are between theirs in no exact sense. The mixing
weight is found so that the speed is the one asked for.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.belief import Gait, WalkerModel, load_gait
from controller.common.errors import UserError
from controller.common.records import Vector
from controller.design.orbit import periodic_orbit
from controller.design.parameters import LOWEST, Parametrisation, with_rates

FILE = re.compile(r"L(\d+\.\d+)-v(\d+\.\d+)\.toml")
SPEED_ERROR = 1e-6  # relative, of a gait between two of the library's
NEARLY = 1e-9  # [m], [m/s]: on a grid line


def file_name(step_length: float, speed: float) -> str:
    """Name of a library gait: step length in [m], speed in [m/s]."""
    return f"L{step_length:.2f}-v{speed:.2f}.toml"


def check_grid(name: str, unit: str, values: Sequence[float]) -> None:
    """Refuse values that the name of a file would round, and with it the library.

    Raises:
        UserError: in one line, by the name and unit given.
    """
    for value in values:
        if abs(value - round(value, 2)) > NEARLY:
            raise UserError(
                f"{name} {value:g} {unit}: must be a multiple of 0.01 {unit}, as the names of the files are"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GaitLibrary:
    """Gaits on a grid of step lengths and speeds.

    Attributes:
        model: The walker.
        lengths: Step lengths in [m], ascending, (n,).
        speeds: Speeds in [m/s], ascending, (m,).
        vectors: Free numbers of the gaits, step length last, (n, m, size).
        degree: Of all of them.
    """

    model: WalkerModel
    lengths: Vector
    speeds: Vector
    vectors: Vector
    degree: int

    @classmethod
    def load(cls, folder: Path, model: WalkerModel) -> "GaitLibrary":
        """Read all library gaits in a folder.

        Raises:
            UserError: no library there, a hole in its grid, gaits of several degrees or of too low a one, an
                illegal file.
        """
        found = {
            (float(match[1]), float(match[2])): path
            for path in sorted(folder.glob("*.toml"))
            if (match := FILE.fullmatch(path.name))
        }
        if not found:
            raise UserError(f"{folder}: no library gaits L<m>-v<m/s>.toml; make them: cmpc gait library")
        lengths, speeds = (sorted({key[i] for key in found}) for i in range(2))
        gaits = {key: load_gait(path, model) for key, path in found.items()}
        first, gait = next(iter(gaits.items()))
        degree = gait.alpha.shape[1] - 1
        if degree < LOWEST:
            raise UserError(f"{found[first]}: degree {degree}; must be {LOWEST} or more to be mixed with others")
        space = Parametrisation(model=model, degree=degree, step_length=None)
        vectors = np.empty((len(lengths), len(speeds), space.size))
        for i, length in enumerate(lengths):
            for j, speed in enumerate(speeds):
                if (length, speed) not in gaits:
                    raise UserError(f"{folder}: the library has no {file_name(length, speed)}")
                gait = gaits[length, speed]
                if gait.alpha.shape[1] - 1 != degree:
                    raise UserError(
                        f"{found[length, speed]}: degree {gait.alpha.shape[1] - 1}; must be {degree}, as its neighbours"
                    )
                vectors[i, j] = space.vector(gait)
        return cls(model=model, lengths=np.array(lengths), speeds=np.array(speeds), vectors=vectors, degree=degree)

    def gait(self, speed: float, step_length: float | None = None) -> Gait:
        """The gait of a speed and a step length.

        Args:
            speed: In [m/s], within the library's.
            step_length: In [m], within the library's; the middle one if not given.

        Raises:
            UserError: outside of the library.
        """
        if step_length is None:
            step_length = float(self.lengths[len(self.lengths) // 2])
        row = _between("step length", "m", self.lengths, step_length)
        column = _between("speed", "m/s", self.speeds, speed)
        along = _mix(self.vectors, row)
        at, low, high = column, 0.0, 1.0
        place, weight = at
        gait = self._close(_mix(along, at))
        if weight in (0.0, 1.0) and row[1] in (0.0, 1.0):
            return gait[0]
        # The speed of a mixture grows with the weight and is nearly linear in it: a safeguarded secant.
        for _ in range(20):
            error = gait[1] - speed
            if abs(error) <= SPEED_ERROR * speed:
                break
            low, high = (low, weight) if error > 0.0 else (weight, high)
            guess = weight - error / (self.speeds[place + 1] - self.speeds[place])
            weight = guess if low - 0.1 < guess < high + 0.1 else 0.5 * (low + high)
            gait = self._close(_mix(along, (place, weight)))
        return gait[0]

    def _close(self, p: Vector) -> tuple[Gait, float]:
        space = Parametrisation(model=self.model, degree=self.degree, step_length=None)
        gait = space.gait(p, "library", "mixed from the gait library")
        orbit = periodic_orbit(self.model, gait)
        return with_rates(gait, orbit), orbit.speed


def _between(what: str, unit: str, grid: Vector, value: float) -> tuple[int, float]:
    """Cell and weight of a value on an ascending grid."""
    if not grid[0] - NEARLY <= value <= grid[-1] + NEARLY:
        raise UserError(
            f"{what} = {value:g} {unit}; must be from {grid[0]:g} to {grid[-1]:g} {unit}, the range of the gait library"
        )
    if len(grid) == 1:
        return 0, 0.0
    cell = min(int(np.searchsorted(grid, value, side="right")) - 1, len(grid) - 2)
    cell = max(cell, 0)
    weight = float((value - grid[cell]) / (grid[cell + 1] - grid[cell]))
    for whole in (0.0, 1.0):
        if abs(weight - whole) < NEARLY:
            weight = whole
    return cell, weight


def _mix(values: Vector, at: tuple[int, float]) -> Vector:
    cell, weight = at
    if weight == 0.0 or len(values) == 1:
        return values[cell]
    return (1.0 - weight) * values[cell] + weight * values[cell + 1]
