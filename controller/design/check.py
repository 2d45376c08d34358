"""Judge a gait: on its zero dynamics, and again by simulating the full model under ZD+PD."""

from dataclasses import dataclass, fields

import numpy as np

from controller.belief import Gains, Gait, WalkerModel
from controller.common.records import ACTUATED
from controller.design.orbit import Orbit, periodic_orbit
from controller.design.poincare import NoReturn, ReturnMap, return_map
from controller.design.requirements import Margin, Requirements, margins

PERIODIC = 1e-6
"""[rad], [rad/s]: how far an exact gait may miss itself after an impact and after a step."""

AGREEMENT = 0.01
"""Between delta^2 and the eigenvalue of the full map nearest to it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One line of a report.

    Attributes:
        name: What was looked at.
        value: What was found, in words with its unit.
        legal: What is legal, empty for a line that only informs.
        holds: Whether it is; None for a line that only informs.
    """

    name: str
    value: str
    legal: str = ""
    holds: bool | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report:
    """What a check found.

    Attributes:
        gait: The gait.
        orbit: Its periodic orbit on the zero dynamics.
        margins: How it keeps the requirements.
        invariance: Largest error of outputs [rad] and rates [rad/s] after the impact.
        residual: Largest |P(x-) - x-| of the full model in [rad], [rad/s]; NaN if it does not come back.
        section: Linearised map of the full model, None if it does not come back.
        findings: All of it in lines.
    """

    gait: Gait
    orbit: Orbit
    margins: tuple[Margin, ...]
    invariance: float
    residual: float
    section: ReturnMap | None
    findings: tuple[Finding, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing is violated."""
        return all(finding.holds is not False for finding in self.findings)


def requirements_of(model: WalkerModel, gait: Gait, **changes: object) -> Requirements:
    """The default requirements at the gait's own step length and speed, some of them changed."""
    orbit = periodic_orbit(model, gait)
    legal = {field.name for field in fields(Requirements)}
    assert set(changes) <= legal
    return Requirements(**{"step_length": orbit.step_length, "speed": orbit.speed, **changes})  # type: ignore[arg-type]


def check(model: WalkerModel, gait: Gait, need: Requirements) -> Report:
    """Re-simulate a gait and compare it with what it should be.

    Args:
        model: The walker.
        gait: The gait with its rates before impact.
        need: Requirements; the speed is reported, not judged.
    """
    orbit = periodic_orbit(model, gait)
    kept = margins(model, gait, orbit, need)
    invariance = invariance_error(model, gait)
    gains = Gains(kp=np.array(need.kp), kd=np.array(need.kd))
    section: ReturnMap | None
    try:
        section = return_map(model, gait, gains)
        residual = section.residual
    except NoReturn:
        section, residual = None, float("nan")
    lines = [
        Finding(name="step length", value=f"{orbit.step_length:.6f} m"),
        Finding(name="step time", value=f"{orbit.step_time:.6f} s"),
        Finding(name="speed", value=f"{orbit.speed:.6f} m/s"),
        Finding(name="cost, squared torque", value=f"{orbit.cost:.1f} N^2 m s"),
        Finding(name="cost, mechanical work", value=f"{orbit.work:.2f} J/m"),
        Finding(name="peak torque", value=", ".join(f"{u:.1f}" for u in np.abs(orbit.u).max(axis=0)) + " N.m"),
        Finding(
            name="invariance under the impact",
            value=f"{invariance:.1e} rad, rad/s",
            legal=f"up to {PERIODIC:.0e}",
            holds=invariance <= PERIODIC,
        ),
        Finding(
            name="periodicity of the full model",
            value="never returns" if section is None else f"{residual:.1e} rad, rad/s",
            legal=f"up to {PERIODIC:.0e}",
            holds=bool(residual <= PERIODIC),
        ),
        *_eigenvalue_lines(orbit, section),
        *(
            Finding(
                name=m.name,
                value=f"margin {m.worst:+.4g} {m.unit}".rstrip(),
                legal=m.legal,
                holds=m.worst >= 0.0,
            )
            for m in kept
        ),
    ]
    return Report(
        gait=gait,
        orbit=orbit,
        margins=kept,
        invariance=invariance,
        residual=residual,
        section=section,
        findings=tuple(lines),
    )


def invariance_error(model: WalkerModel, gait: Gait) -> float:
    """Largest error of the outputs [rad] and their rates [rad/s] just after the gait's own impact."""
    q, dq = gait.post_impact(model)
    value, slope, _ = gait.desired(float(gait.clock @ q))
    rates = dq[ACTUATED] - slope * float(gait.clock @ dq)
    return float(max(np.abs(q[ACTUATED] - value).max(), np.abs(rates).max()))


def _eigenvalue_lines(orbit: Orbit, section: ReturnMap | None) -> list[Finding]:
    restricted = orbit.delta**2
    lines = [Finding(name="delta^2 of the restricted map", value=f"{restricted:.5f}")]
    if section is None:
        return lines
    nearest = float(np.abs(section.eigenvalues)[np.abs(section.eigenvalues - restricted).argmin()])
    return [
        *lines,
        Finding(
            name="the full map's eigenvalue nearest to it",
            value=f"{nearest:.5f}",
            legal=f"within {AGREEMENT:g} of it",
            holds=abs(nearest - restricted) <= AGREEMENT,
        ),
        Finding(
            name="largest eigenvalue of the full map",
            value=f"{section.largest:.5f}",
            legal="below 1",
            holds=section.largest < 1.0,
        ),
    ]
