"""The loop between the worlds: look, decide, hold; 1000 times a second."""

import math
import time

import numpy as np

from sim.errors import ControllerFailed, PlantDiverged
from sim.interface import JOINTS, Controller, ControlStep, Plant
from sim.loop.course import Course
from sim.loop.judge import Judge, TouchDown
from sim.loop.metrics import Metrics
from sim.loop.outcome import FallReason, Outcome, RunSummary
from sim.loop.pushes import active_forces
from sim.loop.tape import Progress, Stop, Tape

PROGRESS_TICKS = 50
_ONES = np.ones(len(JOINTS))


class Loop:
    """One run of one walker, from its start to its end."""

    def __init__(self, *, plant: Plant, controller: Controller, course: Course, tape: Tape) -> None:
        """Put plant and controller at the start.

        Args:
            plant: The truth.
            controller: The law.
            course: What the run is put through.
            tape: Where ticks and events go.
        """
        self._plant, self._controller, self._course, self._tape = plant, controller, course, tape
        self._judge = Judge(course.stance, course.criteria)
        self._metrics = Metrics()
        plant.reset(course.q, course.dq, course.stance)
        self._broken = ""
        try:
            controller.reset(course.stance)
        except ControllerFailed as error:
            self._broken = str(error)
        self._fallback = False
        self._pushed = False
        self._followed = 0.0

    def run(self, *, progress: Progress | None = None, stop: Stop | None = None, log: str = "") -> RunSummary:
        """Run to the end.

        Args:
            progress: Told about every 50 ticks.
            stop: Asked every tick.
            log: Path of the log, for the summary.
        """
        began = time.perf_counter()
        outcome, reason, detail = self._walk(progress, stop)
        self._tape.event(
            self._metrics.ticks,
            "info" if outcome is Outcome.COMPLETED else "warning",
            outcome.value,
            f"{outcome.value} after {self._judge.steps} steps: {reason.value} {detail}".strip(),
        )
        return self._metrics.summary(
            outcome=outcome,
            reason=reason,
            detail=detail,
            final=self._state,
            wall_s=time.perf_counter() - began,
            torque_limits=self._plant.torque_limits,
            criteria=self._course.criteria,
            log=log,
            scuffing=self._judge.scuffing,
        )

    def _walk(self, progress: Progress | None, stop: Stop | None) -> tuple[Outcome, FallReason, str]:
        plant, controller, course = self._plant, self._controller, self._course
        judge, metrics = self._judge, self._metrics
        if self._broken:
            self._state = plant.state()
            return Outcome.ERROR, FallReason.NONE, self._broken
        k = 0
        while True:
            observation, state = plant.observe(), plant.state()
            self._state = state
            touch_down = judge.touch_down(state)
            if touch_down:
                self._landed(k, touch_down)
            scuff = judge.scuff(state)
            if scuff:
                self._tape.event(k, "warning", "scuff", scuff)
            reason, detail = judge.fall(state)
            if reason is not FallReason.NONE:
                return Outcome.FELL, reason, detail
            if judge.steps >= course.steps:
                return Outcome.COMPLETED, FallReason.NONE, ""
            if state.t >= course.end_time:
                return Outcome.FELL, FallReason.STALLED, f"time limit of {course.end_time} s"
            interruption = stop() if stop else None
            if interruption:
                return Outcome.INTERRUPTED, FallReason.NONE, interruption

            started = time.perf_counter()
            try:
                step = controller.step(observation)
            except ControllerFailed as error:
                return Outcome.ERROR, FallReason.NONE, str(error)
            tick_s = time.perf_counter() - started
            forces = active_forces(
                course.pushes,
                state.t,
                judge.steps + 1,
                plant.com,
                step_began=judge.last_impact,
                period=course.period,
            )
            self._tape.tick(k, state, observation, step, tick_s)
            if not math.isfinite(step.u_total.dot(_ONES)):
                return Outcome.ERROR, FallReason.NONE, _not_finite(step, controller)
            self._note(k, step, bool(forces))
            metrics.tick(state, step, judge, tick_s)
            try:
                plant.hold(step.u_total, forces)
            except PlantDiverged as error:
                return Outcome.FELL, FallReason.DIVERGED, str(error)
            k += 1
            if progress and k % PROGRESS_TICKS == 0:
                progress(judge.steps, state.t)

    def _landed(self, k: int, event: TouchDown) -> None:
        self._metrics.touch_down(event)
        self._tape.event(
            k,
            "info",
            "impact",
            f"step {event.number}: {event.foot} foot, {event.duration:.3f} s, {event.length:.3f} m",
        )

    def _note(self, k: int, step: ControlStep, pushed: bool) -> None:
        """Say when a push begins or ends, when the controller takes another gait and when it falls back."""
        if pushed != self._pushed:
            self._tape.event(k, "info", "push", "push begins" if pushed else "push ends")
            self._pushed = pushed
        if step.followed != self._followed:
            how = f"{abs(step.followed):.3f} m/s {'faster' if step.followed > 0.0 else 'slower'} than its own"
            self._tape.event(k, "info", "gait", f"follows a gait {how}" if step.followed else "follows its own gait")
            self._followed = step.followed
        if step.fallback and not self._fallback:
            self._tape.event(k, "warning", "fallback", f"saturated ZD+PD for this tick: {step.status}")
        self._fallback = step.fallback


def _not_finite(step: ControlStep, controller: Controller) -> str:
    torques = ", ".join(f"{name} {value:g}" for name, value in zip(JOINTS, step.u_total.tolist(), strict=True))
    return f"{getattr(controller, 'where', 'the controller')}: commanded torque is not finite: {torques} [N.m]"
