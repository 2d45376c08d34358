"""The controller's world: what it believes of the walker, and the laws; for a law of your own, by name.

Loaded when first asked for. See docs/own-controller.md.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from controller.belief import Gait as Gait
    from controller.belief import StanceEstimator as StanceEstimator
    from controller.belief import WalkerModel as WalkerModel
    from controller.facade import outputs as outputs
    from controller.records import JOINTS as JOINTS
    from controller.records import ControlStep as ControlStep
    from controller.records import Leg as Leg
    from controller.records import Observation as Observation
    from controller.records import Status as Status
    from controller.units import AT_LEAST_ONE as AT_LEAST_ONE
    from controller.units import FRACTION as FRACTION
    from controller.units import NOT_NEGATIVE as NOT_NEGATIVE
    from controller.units import POSITIVE as POSITIVE
    from controller.units import Doc as Doc
    from controller.units import Range as Range
    from controller.units import Unit as Unit

_HOMES = {
    "belief": ("Gait", "StanceEstimator", "WalkerModel"),
    "facade": ("outputs",),
    "records": ("JOINTS", "ControlStep", "Leg", "Observation", "Status"),
    "units": ("AT_LEAST_ONE", "FRACTION", "NOT_NEGATIVE", "POSITIVE", "Doc", "Range", "Unit"),
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
    "Gait",
    "Leg",
    "Observation",
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
