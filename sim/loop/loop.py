"""The loop between the worlds: look, decide, hold; 1000 times a second."""

import time
from collections.abc import Sequence

from sim.errors import PlantDiverged
from sim.interface import Controller, ControlStep, Plant, Vector
from sim.loop.judge import FallCriteria, Judge, TouchDown
from sim.loop.metrics import Metrics
from sim.loop.outcome import FallReason, Outcome, RunSummary
from sim.loop.pushes import PERIOD, CentresOfMass, active_forces
from sim.loop.tape import Progress, Stop, Tape
from sim.scenario import Push

PROGRESS_TICKS = 50


class Loop:
    """One run of one walker, from its start to its end."""

    def __init__(
        self,
        *,
        plant: Plant,
        controller: Controller,
        pushes: Sequence[Push],
        com: CentresOfMass,
        stance: str,
        steps: int,
        end_time: float,
        tape: Tape,
        torque_limits: Vector,
        period: float = PERIOD,
        criteria: FallCriteria | None = None,
    ) -> None:
        """Put the parts together; plant and controller must have been reset.

        Args:
            plant: The truth.
            controller: The law.
            pushes: External forces of the scenario.
            com: Centres of mass of the links, where pushes attack by default.
            stance: The foot that stands at the start.
            steps: Steps after which the run is completed.
            end_time: Simulated time after which it ends anyway in [s].
            tape: Where ticks and events go.
            torque_limits: In [N.m], (4,), for the summary.
            period: Control period in [s], over which impulses are spread.
            criteria: When a run counts as a fall; RABBIT's by default.
        """
        self._plant, self._controller, self._tape = plant, controller, tape
        self._pushes, self._com = tuple(pushes), com
        self._steps, self._end_time = steps, end_time
        self._torque_limits = torque_limits
        self._period = period
        self._judge = Judge(stance, criteria)
        self._metrics = Metrics()
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
            torque_limits=self._torque_limits,
            log=log,
            scuffing=self._judge.scuffing,
        )

    def _walk(self, progress: Progress | None, stop: Stop | None) -> tuple[Outcome, FallReason, str]:
        plant, controller, judge, metrics = self._plant, self._controller, self._judge, self._metrics
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
            if judge.steps >= self._steps:
                return Outcome.COMPLETED, FallReason.NONE, ""
            if state.t >= self._end_time:
                return Outcome.FELL, FallReason.STALLED, f"time limit of {self._end_time} s"
            interruption = stop() if stop else None
            if interruption:
                return Outcome.INTERRUPTED, FallReason.NONE, interruption

            started = time.perf_counter()
            step = controller.step(observation)
            tick_s = time.perf_counter() - started
            forces = active_forces(
                self._pushes,
                state.t,
                judge.steps + 1,
                self._com,
                step_began=judge.last_impact,
                period=self._period,
            )
            self._tape.tick(k, state, observation, step, tick_s)
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
