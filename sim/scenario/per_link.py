"""One value for each link or each joint: the small tables that settings of the plant are made of."""

import dataclasses
from dataclasses import dataclass
from typing import Annotated

from controller.units import (
    NOT_NEGATIVE,
    Metre,
    PositiveRatio,
    Radian,
    Ratio,
    Unit,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyFactors:
    """A factor for each link, 1 for the walker as modelled.

    Attributes:
        torso: Factor of the torso.
        left_femur: Factor of the left femur.
        left_tibia: Factor of the left tibia.
        right_femur: Factor of the right femur.
        right_tibia: Factor of the right tibia.
    """

    torso: PositiveRatio = 1.0
    left_femur: PositiveRatio = 1.0
    left_tibia: PositiveRatio = 1.0
    right_femur: PositiveRatio = 1.0
    right_tibia: PositiveRatio = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyMasses:
    """A mass added to each link, 0 for the walker as modelled.

    Attributes:
        torso: Mass added to the torso.
        left_femur: Mass added to the left femur.
        left_tibia: Mass added to the left tibia.
        right_femur: Mass added to the right femur.
        right_tibia: Mass added to the right tibia.
    """

    torso: Annotated[float, Unit("kg")] = 0.0
    left_femur: Annotated[float, Unit("kg")] = 0.0
    left_tibia: Annotated[float, Unit("kg")] = 0.0
    right_femur: Annotated[float, Unit("kg")] = 0.0
    right_tibia: Annotated[float, Unit("kg")] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyLengths:
    """A displacement for each link, 0 for the walker as modelled.

    Attributes:
        torso: Displacement on the torso.
        left_femur: Displacement on the left femur.
        left_tibia: Displacement on the left tibia.
        right_femur: Displacement on the right femur.
        right_tibia: Displacement on the right tibia.
    """

    torso: Metre = 0.0
    left_femur: Metre = 0.0
    left_tibia: Metre = 0.0
    right_femur: Metre = 0.0
    right_tibia: Metre = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LimbFactors:
    """A factor for each link of the legs, 1 for the walker as modelled.

    Attributes:
        left_femur: Factor of the left femur.
        left_tibia: Factor of the left tibia.
        right_femur: Factor of the right femur.
        right_tibia: Factor of the right tibia.
    """

    left_femur: PositiveRatio = 1.0
    left_tibia: PositiveRatio = 1.0
    right_femur: PositiveRatio = 1.0
    right_tibia: PositiveRatio = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JointFactors:
    """A factor for each actuated joint, 1 for the walker as modelled.

    Attributes:
        left_hip: Factor of the left hip.
        right_hip: Factor of the right hip.
        left_knee: Factor of the left knee.
        right_knee: Factor of the right knee.
    """

    left_hip: Annotated[Ratio, NOT_NEGATIVE] = 1.0
    right_hip: Annotated[Ratio, NOT_NEGATIVE] = 1.0
    left_knee: Annotated[Ratio, NOT_NEGATIVE] = 1.0
    right_knee: Annotated[Ratio, NOT_NEGATIVE] = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTorques:
    """A torque for each actuated joint.

    Attributes:
        left_hip: Torque at the left hip.
        right_hip: Torque at the right hip.
        left_knee: Torque at the left knee.
        right_knee: Torque at the right knee.
    """

    left_hip: Annotated[float, Unit("N.m"), NOT_NEGATIVE] = 0.0
    right_hip: Annotated[float, Unit("N.m"), NOT_NEGATIVE] = 0.0
    left_knee: Annotated[float, Unit("N.m"), NOT_NEGATIVE] = 0.0
    right_knee: Annotated[float, Unit("N.m"), NOT_NEGATIVE] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JointInertias:
    """A reflected inertia for each actuated joint.

    Attributes:
        left_hip: Inertia at the left hip.
        right_hip: Inertia at the right hip.
        left_knee: Inertia at the left knee.
        right_knee: Inertia at the right knee.
    """

    left_hip: Annotated[float, Unit("kg.m^2"), NOT_NEGATIVE] = 0.0
    right_hip: Annotated[float, Unit("kg.m^2"), NOT_NEGATIVE] = 0.0
    left_knee: Annotated[float, Unit("kg.m^2"), NOT_NEGATIVE] = 0.0
    right_knee: Annotated[float, Unit("kg.m^2"), NOT_NEGATIVE] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JointAngles:
    """An angle for each actuated joint.

    Attributes:
        left_hip: Angle at the left hip.
        right_hip: Angle at the right hip.
        left_knee: Angle at the left knee.
        right_knee: Angle at the right knee.
    """

    left_hip: Radian = 0.0
    right_hip: Radian = 0.0
    left_knee: Radian = 0.0
    right_knee: Radian = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JointRates:
    """A rate for each actuated joint.

    Attributes:
        left_hip: Rate at the left hip.
        right_hip: Rate at the right hip.
        left_knee: Rate at the left knee.
        right_knee: Rate at the right knee.
    """

    left_hip: Annotated[float, Unit("rad/s")] = 0.0
    right_hip: Annotated[float, Unit("rad/s")] = 0.0
    left_knee: Annotated[float, Unit("rad/s")] = 0.0
    right_knee: Annotated[float, Unit("rad/s")] = 0.0


def values(table: object) -> tuple[float, ...]:
    """The values of a table in the order of its fields."""
    return tuple(getattr(table, field.name) for field in dataclasses.fields(table))  # type: ignore[arg-type]
