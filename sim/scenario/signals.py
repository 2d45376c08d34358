"""Settings of what stands between the worlds: the sensors' errors one way, the motors' the other."""

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Literal

from controller.common.units import FRACTION, NOT_NEGATIVE, Radian, Second, Unit, whole
from sim.scenario.per_link import JointAngles, JointFactors, JointRates

RadianPerSecond = Annotated[float, Unit("rad/s")]
Ticks = Annotated[int, Unit("ticks"), whole(0, 10_000)]
Torque = Annotated[float, Unit("N.m"), NOT_NEGATIVE]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSettings:
    """From the true state to what the controller is told; noises are white, Gaussian, one sample a tick.

    The order is: bias and drift, noise, quantisation, rates by difference, contact flags, latency.

    Attributes:
        angle_resolution: Step of the joint encoders; 0 for none.
        angle_noise: Standard deviation of the noise on joint angles.
        angle_bias: Biases of the joint angles.
        rates: Whether rates are measured, or differentiated from the angles of two ticks, the torso's too.
        rate_cutoff: Corner frequency of the first-order low-pass on differentiated rates; 0 for none.
        rate_noise: Standard deviation of the noise on measured joint rates.
        rate_bias: Biases of measured joint rates.
        torso_noise: Standard deviation of the noise on the torso angle.
        torso_bias: Bias of the torso angle.
        torso_drift: Rate at which the torso angle drifts away from the truth.
        torso_rate_noise: Standard deviation of the noise on the measured torso rate.
        torso_rate_bias: Bias of the measured torso rate.
        contact_delay: Ticks by which contact flags come late.
        contact_dropout: Probability that a raised contact flag reads as lowered, each tick and foot anew.
        latency: Ticks by which the whole observation comes late.
    """

    angle_resolution: Annotated[Radian, NOT_NEGATIVE] = 0.0
    angle_noise: Annotated[Radian, NOT_NEGATIVE] = 0.0
    angle_bias: JointAngles = dataclasses.field(default_factory=JointAngles)
    rates: Literal["measured", "differentiated"] = "measured"
    rate_cutoff: Annotated[float, Unit("Hz"), NOT_NEGATIVE] = 0.0
    rate_noise: Annotated[RadianPerSecond, NOT_NEGATIVE] = 0.0
    rate_bias: JointRates = dataclasses.field(default_factory=JointRates)
    torso_noise: Annotated[Radian, NOT_NEGATIVE] = 0.0
    torso_bias: Radian = 0.0
    torso_drift: RadianPerSecond = 0.0
    torso_rate_noise: Annotated[RadianPerSecond, NOT_NEGATIVE] = 0.0
    torso_rate_bias: RadianPerSecond = 0.0
    contact_delay: Ticks = 0
    contact_dropout: Annotated[float, Unit("probability"), FRACTION] = 0.0
    latency: Ticks = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ActuationSettings:
    """From the commanded torque to the one the joints feel, before the plant saturates it.

    The order is: latency, quantisation, motor constant, first-order lag, noise.

    Attributes:
        latency: Ticks by which commands come late.
        resolution: Step of the torque command; 0 for none.
        motor_constant_factor: Factors between the torque asked of a motor and what it gives.
        lag: Time constant of the first-order lag; 0 for none.
        noise: Standard deviation of white Gaussian torque noise, one sample a tick and joint.
    """

    latency: Ticks = 0
    resolution: Torque = 0.0
    motor_constant_factor: JointFactors = dataclasses.field(default_factory=JointFactors)
    lag: Annotated[Second, NOT_NEGATIVE] = 0.0
    noise: Torque = 0.0
