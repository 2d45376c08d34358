"""Two gaits of one walker side by side: coefficient by coefficient, cost by cost."""

from dataclasses import dataclass

import numpy as np

from controller.belief import Gait, WalkerModel
from controller.common.records import NORMAL, ROLES, TANGENTIAL, Vector
from controller.design.orbit import Orbit, periodic_orbit
from controller.design.parameters import elevate


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """One figure of both gaits.

    Attributes:
        name: Without spaces, for JSON.
        words: For people.
        unit: Empty for a ratio.
        first: Of the first gait.
        second: Of the second.
    """

    name: str
    words: str
    unit: str
    first: float
    second: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """Two gaits side by side.

    Attributes:
        first: A gait.
        second: Another.
        orbits: Their periodic orbits.
        alpha: Bezier coefficients of both in [rad], (2, 4, M + 1), M the larger of their degrees: the same
            polynomials, those of lower degree written in the higher one.
        measures: Step, stability, forces and costs.
    """

    first: Gait
    second: Gait
    orbits: tuple[Orbit, Orbit]
    alpha: Vector
    measures: tuple[Measure, ...]

    @property
    def apart(self) -> Vector:
        """Coefficients of the second less those of the first in [rad], (4, M + 1)."""
        return self.alpha[1] - self.alpha[0]

    @property
    def rms_apart(self) -> float:
        """Root mean square of `apart` in [rad]."""
        return float(np.sqrt(np.mean(self.apart**2)))


def compare(model: WalkerModel, first: Gait, second: Gait) -> Comparison:
    """Compare two gaits on their periodic orbits.

    The orbit follows from the coefficients alone; the rates before impact that a file tells only show how far it
    misses it. A gait printed to a few decimals has an orbit of its own, some way from the one that was meant.

    Args:
        model: The walker of both.
        first: A gait.
        second: Another.
    """
    degree = max(gait.alpha.shape[1] for gait in (first, second)) - 1
    orbits = periodic_orbit(model, first), periodic_orbit(model, second)
    columns = [_figures(model, gait, orbit) for gait, orbit in zip((first, second), orbits, strict=True)]
    return Comparison(
        first=first,
        second=second,
        orbits=orbits,
        alpha=np.array([elevate(gait.alpha, degree) for gait in (first, second)]),
        measures=tuple(
            Measure(name=name, words=words, unit=unit, first=a, second=b)
            for (name, words, unit, a), (*_, b) in zip(*columns, strict=True)
        ),
    )


def _figures(model: WalkerModel, gait: Gait, orbit: Orbit) -> list[tuple[str, str, str, float]]:
    weight = model.lumped.mass * model.lumped.gravity
    power = np.abs(orbit.u * orbit.dq[:, :4])
    peaks = np.abs(orbit.u).max(axis=0)
    return [
        ("step_length_m", "step length", "m", orbit.step_length),
        ("step_time_s", "step time", "s", orbit.step_time),
        ("speed_m_s", "speed", "m/s", orbit.speed),
        ("delta2", "delta^2 of the restricted Poincare map", "", orbit.delta**2),
        ("squared_torque_N2ms", "cost: squared torque by step length", "N^2 m s", orbit.cost),
        ("squared_torque_N2m2s", "cost: squared torque of a step", "N^2 m^2 s", orbit.cost * orbit.step_length),
        ("work_J_m", "cost: |torque times rate| by step length", "J/m", orbit.work),
        ("transport", "cost of transport, the same by the weight", "", orbit.work / weight),
        *(
            (f"peak_torque_{role.replace(' ', '_')}_Nm", f"peak torque, {role}", "N.m", float(peak))
            for role, peak in zip(ROLES, peaks, strict=True)
        ),
        ("peak_power_W", "peak power of a joint", "W", float(power.max())),
        ("friction", "largest |F_T / F_N| in stance", "", float(_ratio(orbit.force).max())),
        ("friction_impact", "|impulse_T / impulse_N| at the impact", "", float(_ratio(orbit.impulse))),
        ("normal_share", "smallest stance force by the weight", "", float(orbit.force[:, NORMAL].min() / weight)),
        ("touch_down_m_s", "swing foot's rate at touch-down, downward", "m/s", float(-orbit.foot[-1, 2])),
        (
            "off_orbit_rad_s",
            "rates before impact, file's from orbit's",
            "rad/s",
            float(np.abs(gait.dq_minus - orbit.dq[-1]).max()),
        ),
        ("lift_m", "highest swing foot", "m", float(orbit.foot[:, 1].max())),
    ]


def _ratio(force: Vector) -> Vector:
    return np.asarray(np.abs(force[..., TANGENTIAL] / force[..., NORMAL]))
