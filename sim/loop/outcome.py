"""How a run can end, and what is reported of it."""

from dataclasses import dataclass, field
from enum import Enum
from html import escape


class Outcome(Enum):
    """End of a run. A fall is a result; an error is a defect or an impossible plant state."""

    COMPLETED = "completed"
    FELL = "fell"
    ERROR = "error"
    INTERRUPTED = "interrupted"


class FallReason(Enum):
    """Why a run counts as a fall; the value is the sentence users read."""

    NONE = ""
    TRIPPED = "the swing foot went into the ground"
    HIP_LOW = "the hip sank below the fall height"
    TORSO_TILT = "the torso tilted beyond the fall angle"
    BODY_CONTACT = "a link other than a foot touched the ground"
    STALLED = "no step within the stall time"
    DIVERGED = "the plant's state is not finite any more"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSummary:
    """The figures of one run; `cmpc run --json` prints exactly these fields.

    Attributes:
        outcome: Value of `Outcome`.
        fall_reason: Value of `FallReason` (with detail), empty unless the walker fell.
        steps: Completed steps (touch-downs ahead of the stance foot).
        time_s: Simulated time in [s].
        step_time_s: Mean step time in [s]; None before the first completed step.
        step_length_m: Mean step length in [m]; None before the first completed step.
        peak_torque_Nm: Largest applied torque of each joint in [N.m].
        torque_limit_Nm: Limit of each joint in [N.m].
        friction_ratio_max: Worst |F_T/F_N| of the stance foot, without the 20 ms after each impact.
        output_error_rms_rad: RMS of the four outputs over the run in [rad].
        mpc_torque_share: RMS of the MPC's torque over the RMS of ZD+PD's.
        solve_ms: Solver wall time in [ms]: "median", "p99", "max".
        tick_ms: Controller wall time, observation in to torque out, in [ms]: "median", "p99", "max".
        fallbacks: Ticks in which the fall-back policy was used.
        slack_max_N: Largest softening of a contact-force row in [N].
        realtime_factor: Simulated over wall time.
        log: Path of the log, empty if none was written.
        message: Detail of an error or an interruption.
        rms_torque_Nm: RMS of the applied torque of each joint in [N.m].
        speed_m_s: Mean forward speed of the hip in [m/s].
        slip_m: Distance the stance foot slid along the ground in [m].
        ticks: Control ticks.
        state_digest: Fingerprint of the last state; equal for states that are equal bit for bit.
        scuff_depth_m: Largest depth of the swing foot below the ground outside landings in [m].
        scuff_time_s: Time it spent there in [s].
        judged_by: Lengths in [m], the angle in [rad] and the time in [s] of `FallCriteria`, by their names.
    """

    outcome: str
    fall_reason: str
    steps: int
    time_s: float
    step_time_s: float | None
    step_length_m: float | None
    peak_torque_Nm: dict[str, float]
    torque_limit_Nm: dict[str, float]
    friction_ratio_max: float | None
    output_error_rms_rad: float | None
    mpc_torque_share: float | None
    solve_ms: dict[str, float]
    tick_ms: dict[str, float]
    fallbacks: int
    slack_max_N: float
    realtime_factor: float
    log: str = ""
    message: str = ""
    rms_torque_Nm: dict[str, float] = field(default_factory=dict)
    speed_m_s: float | None = None
    slip_m: float | None = None
    ticks: int = 0
    state_digest: str = ""
    scuff_depth_m: float = 0.0
    scuff_time_s: float = 0.0
    judged_by: dict[str, float] = field(default_factory=dict)

    def _repr_html_(self) -> str:
        """A few figures for a notebook; `sim.read(summary.log)` shows the run itself."""
        figures = {
            "outcome": f"{self.outcome} {self.fall_reason or self.message}",
            "steps": f"{self.steps} in {self.time_s:.2f} s",
            "speed": f"{self.speed_m_s:.3f} m/s" if self.speed_m_s is not None else "",
            "peak torque": ", ".join(f"{peak:.1f}" for peak in self.peak_torque_Nm.values()) + " N.m",
            "worst |F_T / F_N|": f"{self.friction_ratio_max:.3f}" if self.friction_ratio_max is not None else "",
            "log": self.log,
        }
        cells = (f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in figures.items() if text)
        return f"<table>{''.join(cells)}</table>"
