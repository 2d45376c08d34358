"""What came of a trial: a row of the results database."""

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sim.loop import Outcome, RunSummary
from sim.trials.falls.cause import decisive
from sim.trials.plan.axis import Value

TIMING = ("wall_s", "solve_median_ms", "solve_p99_ms", "solve_max_ms", "tick_median_ms")
"""Fields of a result that differ from run to run; all others depend on plan, controller and index alone."""

LEAST_SPEED = "least_speed_m_s"
"""Least forward speed of the hip in a walk, among its evidence."""

GAVE_UP = "gave up"
ERROR = Outcome.ERROR.value
WITH_RESULT = (Outcome.COMPLETED.value, Outcome.FELL.value)
"""Outcomes that say something about the controller; the others are no result, neither survived nor fallen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """What came of a trial; a row of the results database. Fields of a `RunSummary` have its names and units.

    Attributes:
        controller: Kind of controller.
        trial: Number of the trial.
        study: Name of its study.
        values: Values of the study's axes by name, as JSON.
        seed: Seed of the scenario.
        outcome: "completed", "fell", "error" for an exception or a lost process, or "gave up" for a trial that was
            stopped at its wall limit; the last two are no result.
        survived: Whether the steps asked for were completed.
        fading: Whether it survived, but lost energy about the stance foot at each of its last steps, so that it would
            stop if it went on.
        message: Detail of an error.
        peak_torque_max_Nm: Largest applied torque of any joint in [N.m].
        torque_share_max: Largest share of a joint's limit that was applied.
        rms_torque_all_Nm: RMS of all joint torques in [N.m].
        solve_median_ms: Median solver time in [ms].
        solve_p99_ms: Its 99 % quantile.
        solve_max_ms: Its maximum.
        tick_median_ms: Median controller time in [ms].
        wall_s: Wall time of the trial in [s].
        log: Name of the log in the results' folder, empty if none was kept.
        cause: What finally broke, the value of a `sim.trials.falls.cause.Cause`; empty unless it fell.
        evidence: Least forward speed of the hip in the walk in [m/s], and fields of the
            `sim.trials.falls.cause.Evidence` for the cause, as JSON.
        judged_by: Criteria of steps and falls, a `RunSummary`'s `judged_by`, as JSON; empty without a result.
        origin: Key of what it ran with: `Store.origins`.
    """

    controller: str
    trial: int
    study: str
    values: str
    seed: int
    outcome: str
    survived: bool
    fading: bool = False
    fall_reason: str = ""
    message: str = ""
    steps: int = 0
    ticks: int = 0
    time_s: float = 0.0
    speed_m_s: float | None = None
    step_time_s: float | None = None
    step_length_m: float | None = None
    peak_torque_max_Nm: float | None = None
    torque_share_max: float | None = None
    rms_torque_all_Nm: float | None = None
    output_error_rms_rad: float | None = None
    friction_ratio_max: float | None = None
    slip_m: float | None = None
    fallbacks: int = 0
    slack_max_N: float = 0.0
    state_digest: str = ""
    scuff_depth_m: float = 0.0
    scuff_time_s: float = 0.0
    solve_median_ms: float | None = None
    solve_p99_ms: float | None = None
    solve_max_ms: float | None = None
    tick_median_ms: float | None = None
    wall_s: float = 0.0
    log: str = ""
    cause: str = ""
    evidence: str = ""
    judged_by: str = ""
    origin: str = ""

    @property
    def known(self) -> bool:
        """Whether there is a result: the walker walked to the end or fell."""
        return self.outcome in WITH_RESULT

    @property
    def fell(self) -> bool:
        """Whether the walker fell."""
        return self.outcome == Outcome.FELL.value

    @property
    def axis_values(self) -> Mapping[str, Value]:
        """Values of the study's axes by name."""
        found: dict[str, Value] = json.loads(self.values)
        return found

    @property
    def least_speed_m_s(self) -> float:
        """Least forward speed of the hip in [m/s]: how near the walk came to a stop; NaN where it is not recorded."""
        found = json.loads(self.evidence or "{}").get(LEAST_SPEED)
        return math.nan if found is None else float(found)

    @property
    def proof(self) -> str:
        """The figures that speak for the cause, in words; empty where there is no cause."""
        return decisive(self.cause, json.loads(self.evidence)) if self.cause else ""

    @property
    def why(self) -> str:
        """Why it did not survive, empty if it did."""
        return "" if self.survived else self.fall_reason or self.message or self.outcome


def result_without_times(result: TrialResult) -> TrialResult:
    """The part of a result that is a pure function of plan, controller and index, whatever it ran with."""
    blank: dict[str, Any] = dict.fromkeys(TIMING, None) | {"wall_s": 0.0, "origin": ""}
    return dataclasses.replace(result, **blank)


_SHARED = [
    field.name
    for field in dataclasses.fields(RunSummary)
    if field.name in TrialResult.__dataclass_fields__ and field.name not in ("log", "judged_by")
]


def figures_of(summary: RunSummary) -> dict[str, Any]:
    """A run's summary as fields of a result; what is not finite becomes None, a run stopped early gave up."""
    peaks, limits = summary.peak_torque_Nm, summary.torque_limit_Nm
    rms = summary.rms_torque_Nm.values()
    figures = {name: getattr(summary, name) for name in _SHARED} | {
        "outcome": GAVE_UP if summary.outcome == Outcome.INTERRUPTED.value else summary.outcome,
        "survived": summary.outcome == Outcome.COMPLETED.value,
        "peak_torque_max_Nm": max(peaks.values(), default=None),
        "torque_share_max": max((peaks[j] / limit for j, limit in limits.items() if limit > 0.0), default=None),
        "rms_torque_all_Nm": math.sqrt(sum(value**2 for value in rms) / len(rms)) if rms else None,
        "solve_median_ms": summary.solve_ms.get("median"),
        "solve_p99_ms": summary.solve_ms.get("p99"),
        "solve_max_ms": summary.solve_ms.get("max"),
        "tick_median_ms": summary.tick_ms.get("median"),
        "judged_by": json.dumps(summary.judged_by),
    }
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in figures.items()
    }
