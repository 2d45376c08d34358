"""A decision of a controller from outside held against what a `ControlStep` must be, and brought to its types."""

import dataclasses
import operator
from collections.abc import Mapping
from typing import Any

import numpy as np

from controller.common.errors import ControllerFailed
from controller.common.records import ControlStep

_SHAPES = {
    "u_total": (4,),
    "u_zd": (4,),
    "u_mpc": (4,),
    "y": (4,),
    "dy": (4,),
    "contact_force": (2,),
    "residuals": (3,),
}
_WHOLE, _REAL = (int, np.integer), (int, float, np.integer, np.floating)
_SCALARS = dict.fromkeys(("impact_in", "iterations", "active"), _WHOLE) | dict.fromkeys(
    ("theta", "dtheta", "s", "slack", "solve_s", "followed"), _REAL
)
_KINDS = tuple(int if kinds is _WHOLE else float for kinds in _SCALARS.values())
_arrays, _numbers, _FLOAT = operator.attrgetter(*_SHAPES), operator.attrgetter(*_SCALARS), np.dtype(float)
_LEGS = ("left", "right")


def checked(step: ControlStep, kind: str, where: str) -> ControlStep:
    """The same decision with arrays of float.

    Args:
        step: What the controller gave; its plan is left alone.
        kind: The name the controller was asked for by.
        where: Which method gave it, and where that stands.

    Raises:
        ControllerFailed: something of it is not what it must be.
    """
    if step.diagnostics:
        _check_diagnostics(step.diagnostics, kind)
    return step if step.stance in _LEGS and _in_shape(step) else _looked_at(step, kind, where)


def _in_shape(step: ControlStep) -> bool:
    """Whether arrays and numbers are just as they must be; false of what has to be looked at more closely."""
    for value, shape in zip(_arrays(step), _SHAPES.values(), strict=True):
        if type(value) is not np.ndarray or value.dtype is not _FLOAT or value.shape != shape:
            return False
    return tuple(map(type, _numbers(step))) == _KINDS


def _looked_at(step: ControlStep, kind: str, where: str) -> ControlStep:
    """What is nearly as it must be, made so."""
    changed: dict[str, Any] = {}
    for name, shape in _SHAPES.items():
        value = getattr(step, name)
        if type(value) is not np.ndarray or value.dtype != np.float64:
            try:
                value = changed[name] = np.array(value, dtype=float)
            except (TypeError, ValueError):
                value = getattr(step, name)
        if getattr(value, "shape", None) != shape:
            raise ControllerFailed(
                f"{where} gave ControlStep.{name} = {said(getattr(step, name))}; must be an array of {shape[0]} numbers"
            )
    for name, kinds in _SCALARS.items():
        value = getattr(step, name)
        if not isinstance(value, kinds):
            raise ControllerFailed(f"{where} gave ControlStep.{name} = {said(value)}; must be a number")
    if step.stance not in _LEGS:
        raise ControllerFailed(f"controller {kind}: ControlStep.stance = {step.stance!r}: must be left or right")
    return dataclasses.replace(step, **changed) if changed else step


def _check_diagnostics(given: Any, kind: str) -> None:
    if not isinstance(given, Mapping):
        raise ControllerFailed(
            f'controller {kind}: ControlStep.diagnostics is {said(given)}; must be a dict such as {{"push [N]": 3.0}}'
        )
    for name, value in given.items():
        if type(value) is float and type(name) is str:
            continue
        if not isinstance(name, str) or not isinstance(value, int | float | np.number):
            raise ControllerFailed(
                f"controller {kind}: ControlStep.diagnostics[{name!r}] is {said(value)}; must be a number"
            )


def said(value: Any) -> str:
    """What a value is, in a few words."""
    if value is None:
        return "None"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if isinstance(value, list | tuple):
        return f"a {type(value).__name__} of {len(value)}"
    return f"{value!r:.40}" if isinstance(value, str | int | float) else f"a {type(value).__name__}"
