"""The controller's world: what it believes of the walker, and the laws; for a law of your own, by name.

Loaded when first asked for. See docs/own-controller.md.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from controller.belief import Gait, StanceEstimator, WalkerModel
    from controller.common.records import JOINTS, ControlStep, Leg, Observation, Status
    from controller.common.units import AT_LEAST_ONE, FRACTION, NOT_NEGATIVE, POSITIVE, Doc, Range, Unit
    from controller.facade import outputs
    from controller.observer import Estimate, PushObserver

_HOMES = {
    "belief": ("Gait", "StanceEstimator", "WalkerModel"),
    "facade": ("outputs",),
    "observer": ("Estimate", "PushObserver"),
    "common.records": ("JOINTS", "ControlStep", "Leg", "Observation", "Status"),
    "common.units": ("AT_LEAST_ONE", "FRACTION", "NOT_NEGATIVE", "POSITIVE", "Doc", "Range", "Unit"),
}
"""Module -> what it gives."""

__all__ = [
    "AT_LEAST_ONE",
    "FRACTION",
    "JOINTS",
    "NOT_NEGATIVE",
    "POSITIVE",
    "ControlStep",
    "Doc",
    "Estimate",
    "Gait",
    "Leg",
    "Observation",
    "PushObserver",
    "Range",
    "StanceEstimator",
    "Status",
    "Unit",
    "WalkerModel",
    "outputs",
]


def __getattr__(name: str) -> Any:
    for module, names in _HOMES.items():
        if name in names:
            return getattr(importlib.import_module(f"controller.{module}"), name)
    raise AttributeError(f"module 'controller' has no attribute {name!r}; it has {', '.join(__all__)}")


def __dir__() -> list[str]:
    return sorted(__all__)
