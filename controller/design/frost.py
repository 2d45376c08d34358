"""A step out of the .mat files of FROST, which keep a gait as an array of phases with their trajectories.

A phase has `tspan`, `states.x` (7, K): base forward, base up, base pitch about +y, then the joints in the order of the
robot's file, and `inputs`, whose names tell the contact: `fRightToe`. Impacts have one column and are left out.
"""

import io
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from controller.common.errors import UserError
from controller.common.records import Vector
from controller.design.imported import BASE, FEWEST

BASE_ROWS = 3  # of `states.x`: forward, up, pitch
PITCH = 2
ROWS = BASE_ROWS + 4


def read_mat(data: bytes, joints: Sequence[str], stance: str, number: int | None, where: str) -> dict[str, Vector]:
    """Columns of one step: `t` in [s], the base's pitch, and a joint each in [rad].

    Args:
        data: The file.
        joints: Names of the four joints in the order of the robot's file.
        stance: "left" or "right", the foot that stands.
        number: Which gait of the file, from 1; None for the only one.
        where: The file, for messages.

    Raises:
        UserError: no such file of FROST, several gaits and none is named, or none of its phases stands on that foot.
    """
    from scipy.io import loadmat

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            content = loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=False)
    except Exception as error:  # of every kind, as the bytes may be anything
        words = " ".join(str(error).split())[:120]
        raise UserError(f"{where}: no MATLAB file up to version 7 ({words}); save it with -v7") from error
    gaits = list(_gaits(content))
    if not gaits:
        raise UserError(f"{where}: no gait of FROST; must hold an array of phases with tspan and states.x ({ROWS}, K)")
    if number is None and len(gaits) > 1:
        raise UserError(f"{where}: holds {len(gaits)} gaits; choose one by --number 1 to {len(gaits)}")
    if number is not None and not 1 <= number <= len(gaits):
        raise UserError(f"{where}: --number {number}: must be 1 to {len(gaits)}")
    there = gaits[(number or 1) - 1]
    phases = [(phase, x) for phase in there if (x := _states(phase)) is not None]
    if not phases:
        raise UserError(
            f"{where}: none of its phases is a step: states.x must be ({ROWS}, {FEWEST} or more), real and finite; "
            f"it is {', '.join(map(_what, there))}"
        )
    feet = [_feet(phase) for phase, _ in phases]
    fits = [one for one, foot in zip(phases, feet, strict=True) if not foot or stance in foot]
    if not fits:
        stands = " and ".join(sorted(set().union(*feet)))
        raise UserError(f"{where}: no step of {FEWEST} samples or more on the {stance} foot; it stands on: {stands}")
    phase, x = fits[0]
    t = _numbers(getattr(phase, "tspan", None))
    columns = {BASE: x[PITCH], **dict(zip(joints, x[BASE_ROWS:], strict=True))}
    return columns | ({"t": t} if t is not None and t.shape == x[PITCH].shape and t[-1] > t[0] else {})


def _gaits(value: Any) -> Iterator[list[Any]]:
    """Every array of phases in what a file holds, in order."""
    items = list(value.ravel()) if isinstance(value, np.ndarray) and value.dtype == object else [value]
    if any(hasattr(item, "states") for item in items):
        yield [item for item in items if hasattr(item, "states")]
        return
    for item in items:
        names = getattr(item, "_fieldnames", ())
        if isinstance(item, Mapping):
            for name, inner in item.items():
                yield from () if name.startswith("__") else _gaits(inner)
        elif names:
            for name in names:
                yield from _gaits(getattr(item, name))
        elif isinstance(item, np.ndarray) and item.dtype == object:
            yield from _gaits(item)


def _states(phase: Any) -> Vector | None:
    """The trajectory of a phase, (7, K) with finite numbers; None for an impact."""
    x = _numbers(getattr(phase.states, "x", None))
    return x if x is not None and x.ndim == 2 and x.shape[0] == ROWS and x.shape[1] >= FEWEST else None


def _numbers(value: Any) -> Vector | None:
    """An array of finite real numbers; None for anything else, however MATLAB keeps it."""
    try:
        found = np.array(value, dtype=None if np.iscomplexobj(value) else float)
    except (TypeError, ValueError):
        return None
    return None if np.iscomplexobj(found) or not np.isfinite(found).all() else found


def _what(phase: Any) -> str:
    """What a phase has in the place of a trajectory, in words."""
    x = getattr(phase.states, "x", None)
    if x is None:
        return "missing"
    if _numbers(x) is None:
        return "complex" if np.iscomplexobj(x) else "not finite numbers"
    return str(np.shape(x))


def _feet(phase: Any) -> set[str]:
    """The feet in contact by the names of the phase's inputs; empty where they do not tell."""
    names = [name.lower() for name in getattr(getattr(phase, "inputs", None), "_fieldnames", ())]
    return {side for side in ("left", "right") if any(side in name for name in names)}
