"""One value for each link or each joint: the small tables that settings of the plant are made of."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

from controller.common.units import (
    NOT_NEGATIVE,
    Doc,
    Metre,
    PositiveRatio,
    Radian,
    Ratio,
    Unit,
)

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class PerLimb:
    """A value for each link of the legs."""

    left_femur: float = 0.0
    left_tibia: float = 0.0
    right_femur: float = 0.0
    right_tibia: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PerLink:
    """A value for each link."""

    torso: float = 0.0
    left_femur: float = 0.0
    left_tibia: float = 0.0
    right_femur: float = 0.0
    right_tibia: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PerJoint:
    """A value for each actuated joint."""

    left_hip: float = 0.0
    right_hip: float = 0.0
    left_knee: float = 0.0
    right_knee: float = 0.0


def _each(kind: Any, help: str, default: float = 0.0) -> Callable[[type[T]], type[T]]:
    """Give every value of a table its unit and range, its help and its default.

    Args:
        kind: Annotated type of each.
        help: A sentence with {} for the link or the joint.
        default: In the unit.
    """

    def settle(cls: type[T]) -> type[T]:
        names = [field.name for field in dataclasses.fields(cls)]  # type: ignore[arg-type]
        cls.__annotations__ = {name: Annotated[kind, Doc(help.format(name.replace("_", " ")))] for name in names}
        for name in names:
            setattr(cls, name, default)
        return dataclass(frozen=True, slots=True, kw_only=True)(cls)

    return settle


@_each(PositiveRatio, "Factor of the {}.", 1.0)
class BodyFactors(PerLink):
    """A factor for each link, 1 for the walker as modelled."""


@_each(Annotated[float, Unit("kg")], "Mass added to the {}.")
class BodyMasses(PerLink):
    """A mass added to each link, 0 for the walker as modelled."""


@_each(Metre, "Displacement on the {}.")
class BodyLengths(PerLink):
    """A displacement for each link, 0 for the walker as modelled."""


@_each(PositiveRatio, "Factor of the {}.", 1.0)
class LimbFactors(PerLimb):
    """A factor for each link of the legs, 1 for the walker as modelled."""


@_each(Annotated[Ratio, NOT_NEGATIVE], "Factor of the {}.", 1.0)
class JointFactors(PerJoint):
    """A factor for each actuated joint, 1 for the walker as modelled."""


@_each(Annotated[float, Unit("N.m"), NOT_NEGATIVE], "Torque at the {}.")
class JointTorques(PerJoint):
    """A torque for each actuated joint."""


@_each(Annotated[float, Unit("kg.m^2"), NOT_NEGATIVE], "Inertia at the {}.")
class JointInertias(PerJoint):
    """A reflected inertia for each actuated joint."""


@_each(Radian, "Angle at the {}.")
class JointAngles(PerJoint):
    """An angle for each actuated joint."""


@_each(Annotated[float, Unit("rad/s")], "Rate at the {}.")
class JointRates(PerJoint):
    """A rate for each actuated joint."""


def values(table: object) -> tuple[float, ...]:
    """The values of a table in the order of its fields."""
    return tuple(getattr(table, field.name) for field in dataclasses.fields(table))  # type: ignore[arg-type]
