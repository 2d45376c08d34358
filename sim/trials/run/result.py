"""What came of a trial: a row of the results database."""

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sim.trials.falls.cause import decisive
from sim.trials.plan.axis import Value

TIMING = ("wall_s", "solve_median_ms", "solve_p99_ms", "solve_max_ms", "tick_median_ms")
"""Fields of a result that differ from run to run; all others depend on plan, controller and index alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """What came of a trial; a row of the results database.

    Attributes:
        controller: Kind of controller.
        trial: Number of the trial.
        study: Name of its study.
        values: Values of the study's axes by name, as JSON.
        seed: Seed of the scenario.
        outcome: Value of `sim.loop.outcome.Outcome`; "error" for an exception or a trial given up.
        survived: Whether the steps asked for were completed: no fall, no NaN, no error.
        reason: Why it fell.
        message: Detail of an error.
        steps: Completed steps.
        ticks: Control ticks.
        time_s: Simulated time in [s]; of the fall, if it fell.
        speed_m_s: Mean forward speed in [m/s].
        step_time_s: Mean step time in [s].
        step_length_m: Mean step length in [m].
        peak_torque_Nm: Largest applied torque of any joint in [N.m].
        peak_torque_ratio: Largest share of a joint's limit that was applied.
        rms_torque_Nm: RMS of all joint torques in [N.m].
        error_rms_rad: RMS of the outputs in [rad].
        friction_max: Worst |F_T/F_N| of the stance foot.
        slip_m: Distance the stance foot slid in [m].
        fallbacks: Ticks in which the controller fell back.
        slack_max_N: Largest softening of a contact-force row in [N].
        state_digest: Fingerprint of the last state.
        scuff_depth_m: Largest depth of the swing foot below the ground outside landings in [m].
        scuff_time_s: Time it spent there in [s].
        solve_median_ms: Median solver time in [ms].
        solve_p99_ms: Its 99 % quantile.
        solve_max_ms: Its maximum.
        tick_median_ms: Median controller time in [ms].
        wall_s: Wall time of the trial in [s].
        log: Name of the log in the results' folder, empty if none was kept.
        cause: What finally broke, the value of a `sim.trials.falls.cause.Cause`; empty unless it fell.
        evidence: Fields of the `sim.trials.falls.cause.Evidence` for it, as JSON.
    """

    controller: str
    trial: int
    study: str
    values: str
    seed: int
    outcome: str
    survived: bool
    reason: str = ""
    message: str = ""
    steps: int = 0
    ticks: int = 0
    time_s: float = 0.0
    speed_m_s: float | None = None
    step_time_s: float | None = None
    step_length_m: float | None = None
    peak_torque_Nm: float | None = None
    peak_torque_ratio: float | None = None
    rms_torque_Nm: float | None = None
    error_rms_rad: float | None = None
    friction_max: float | None = None
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

    @property
    def axis_values(self) -> Mapping[str, Value]:
        """Values of the study's axes by name."""
        found: dict[str, Value] = json.loads(self.values)
        return found

    @property
    def proof(self) -> str:
        """The figures that speak for the cause, in words; empty where there is no cause."""
        return decisive(self.cause, json.loads(self.evidence)) if self.cause else ""

    @property
    def why(self) -> str:
        """Why it did not survive, empty if it did."""
        return "" if self.survived else self.reason or self.message or self.outcome


def result_without_times(result: TrialResult) -> TrialResult:
    """The part of a result that is a pure function of plan, controller and index."""
    blank: dict[str, Any] = dict.fromkeys(TIMING, None) | {"wall_s": 0.0}
    return dataclasses.replace(result, **blank)
