"""Figures of a run, gathered tick by tick in constant memory."""

import dataclasses
import hashlib
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.interface import JOINTS, Vector
from sim.loop.judge import FallCriteria, Scuffing, TouchDown
from sim.loop.outcome import FallReason, Outcome, RunSummary
from sim.loop.ticks import Ticks


class Durations:
    """Distribution of wall times on a logarithmic grid of 1 % width; memory does not grow with the run."""

    _SHORTEST = 1e-7  # [s]
    _RATIO = math.log(1.01)

    def __init__(self) -> None:
        """Start empty."""
        self._counts = np.zeros(2048, dtype=np.int64)
        self._longest = 0.0

    def add(self, seconds: ArrayLike) -> None:
        """Count durations in [s]."""
        times = np.asarray(seconds, dtype=float)
        if not times.size:
            return
        self._longest = max(self._longest, float(times.max(initial=0.0)))
        classes = (np.log(np.maximum(times, self._SHORTEST) / self._SHORTEST) / self._RATIO).astype(int)
        self._counts += np.bincount(np.minimum(classes, len(self._counts) - 1), minlength=len(self._counts))

    def quantile(self, fraction: float) -> float:
        """Quantile in [s], within 1 %; 0 if nothing was counted."""
        total = int(self._counts.sum())
        if total == 0 or self._longest == 0.0:
            return 0.0
        index = int(np.searchsorted(np.cumsum(self._counts), fraction * total))
        return min(self._SHORTEST * math.exp((index + 0.5) * self._RATIO), self._longest)

    def milliseconds(self) -> dict[str, float]:
        """Median, 99 % quantile and maximum in [ms]."""
        figures = {"median": self.quantile(0.5), "p99": self.quantile(0.99), "max": self._longest}
        return {name: round(1e3 * value, 4) for name, value in figures.items()}


class Metrics:
    """Accumulates what `RunSummary` reports."""

    def __init__(self) -> None:
        """Start empty."""
        self.ticks = 0
        self.slip = 0.0  # [m]
        self.friction_ratio = 0.0
        self.fallbacks = 0
        self.slack = 0.0
        self.solve = Durations()
        self.tick_time = Durations()
        self._peak_torque: Vector = np.zeros(4)
        self._torque2: Vector = np.zeros(4)
        self._y2 = self._zd2 = self._mpc2 = 0.0
        self._start_x: float | None = None
        self._foot: tuple[int, float] | None = None  # that stood at the last tick, and its x in [m]
        self._step_times = self._step_lengths = 0.0
        self._steps = 0

    def take(self, ticks: Ticks) -> None:
        """Take in ticks; sums depend on how a run is cut in their last digits, so that it is cut the same each time."""
        if not len(ticks):
            return
        state, step, judged = ticks.state, ticks.step, ticks.judged
        self.ticks += len(ticks)
        self.tick_time.add(ticks.tick_s)
        self.solve.add(step["solve_s"][step["solve_s"] > 0.0])
        self.fallbacks += int(np.count_nonzero(step["fallback"]))
        self.slack = float(np.fmax.reduce(step["slack"], initial=self.slack))
        torque, y, u_zd, u_mpc = (
            np.ascontiguousarray(column) for column in (state["torque"], step["y"], step["u_zd"], step["u_mpc"])
        )
        np.maximum(self._peak_torque, np.abs(state["torque"].T).max(axis=1), out=self._peak_torque)
        self._torque2 += np.square(torque).sum(axis=0)
        self._y2 += float(np.square(y).sum())
        self._zd2 += float(np.square(u_zd).sum())
        self._mpc2 += float(np.square(u_mpc).sum())
        if self._start_x is None:
            self._start_x = float(state["hip"][0, 0])
        rows, stance = np.arange(len(ticks)), judged["stance"]
        self._slide(state["foot"][rows, stance, 0], stance, state["contact"][rows, stance] != 0)
        tangential, normal = state["contact_force"][rows, stance].T
        counts = (judged["settled"] != 0) & (normal > 0.0)
        ratios = np.abs(tangential[counts]) / normal[counts]
        self.friction_ratio = float(np.fmax.reduce(ratios, initial=self.friction_ratio))

    def _slide(self, x: Vector, stance: NDArray[np.int64], touches: NDArray[np.bool_]) -> None:
        """Add up how far the stance foot moves along the ground while it touches it."""
        foot, before = self._foot or (-1, 0.0)
        same = np.empty(len(x), dtype=np.bool_)
        same[0], same[1:] = foot == stance[0], stance[1:] == stance[:-1]
        moved = np.empty(len(x) + 1)
        moved[0], moved[1], moved[2:] = self.slip, x[0] - before, x[1:] - x[:-1]
        slid = np.abs(moved)[np.concatenate(([True], same & touches))]
        self.slip = float(np.add.accumulate(slid)[-1])
        self._foot = int(stance[-1]), float(x[-1])

    def touch_down(self, event: TouchDown) -> None:
        """Take in one completed step."""
        self._steps += 1
        self._step_times += event.duration
        self._step_lengths += event.length

    def summary(
        self,
        *,
        outcome: Outcome,
        reason: FallReason,
        detail: str,
        final: np.void,
        wall_s: float,
        torque_limits: Vector,
        criteria: FallCriteria,
        log: str,
        scuffing: Scuffing | None = None,
    ) -> RunSummary:
        """The figures so far.

        Args:
            outcome: How the run ended.
            reason: Why it counts as a fall.
            detail: Figures of the fall, or the message of an error or interruption.
            final: The last state, a row of `STATE`.
            wall_s: Wall time in [s].
            torque_limits: In [N.m], (4,), ordered as `JOINTS`.
            criteria: What the run was judged by.
            log: Path of the log.
            scuffing: The swing foot below the ground.
        """
        fell = outcome is Outcome.FELL
        finite = np.isfinite(torque_limits)
        time_s = float(final["t"])
        started = self._start_x if self._start_x is not None else float(final["hip"][0])
        rms = np.sqrt(self._torque2 / self.ticks) if self.ticks else self._torque2
        return RunSummary(
            outcome=outcome.value,
            fall_reason=f"{reason.value} ({detail})" if fell and detail else reason.value if fell else "",
            steps=self._steps,
            time_s=round(time_s, 9),
            step_time_s=self._step_times / self._steps if self._steps else None,
            step_length_m=self._step_lengths / self._steps if self._steps else None,
            peak_torque_Nm=dict(zip(JOINTS, self._peak_torque.tolist(), strict=True)),
            torque_limit_Nm={
                name: value
                for name, value, is_finite in zip(JOINTS, torque_limits.tolist(), finite, strict=True)
                if is_finite
            },
            rms_torque_Nm=dict(zip(JOINTS, rms.tolist(), strict=True)),
            speed_m_s=(float(final["hip"][0]) - started) / time_s if time_s > 0.0 else None,
            slip_m=self.slip if self.ticks else None,
            ticks=self.ticks,
            state_digest=digest(final),
            scuff_depth_m=scuffing.depth if scuffing else 0.0,
            scuff_time_s=round(scuffing.ticks * time_s / self.ticks, 9) if scuffing and self.ticks else 0.0,
            friction_ratio_max=self.friction_ratio if self.ticks else None,
            output_error_rms_rad=math.sqrt(self._y2 / (4 * self.ticks)) if self.ticks else None,
            mpc_torque_share=math.sqrt(self._mpc2 / self._zd2) if self._zd2 else None,
            solve_ms=self.solve.milliseconds(),
            tick_ms=self.tick_time.milliseconds(),
            fallbacks=self.fallbacks,
            slack_max_N=self.slack,
            realtime_factor=time_s / wall_s if wall_s > 0.0 else 0.0,
            log=log,
            judged_by={name: value for name, value in dataclasses.asdict(criteria).items() if math.isfinite(value)},
            message="" if fell else detail,
        )


def digest(state: np.void) -> str:
    """Fingerprint of a row of `STATE`: equal for states that are equal bit for bit."""
    parts = (state[name] for name in ("q", "dq", "hip", "dhip"))
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()[:16]
