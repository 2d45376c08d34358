"""The loop between the worlds: look, judge, decide, hold; 1000 times a second.

A tick is a few compiled calls on one row of a block; all else is done for many ticks at once, from columns: what
listeners are told, the texts of events, the figures of the run. Controllers, sensors and motors that are plain Python
sit in the same loop.
"""

import time
from typing import Any

import numpy as np

from sim.errors import ControllerFailed, PlantDiverged
from sim.interface import JOINTS, Controller, NoTorque, Plant, Vector
from sim.loop.course import Course
from sim.loop.judge import ENDED, LANDED, SCUFF_BEGAN, SCUFF_ENDED, Judge
from sim.loop.law import Foreseen, rows_law
from sim.loop.metrics import Metrics
from sim.loop.outcome import FallReason, Outcome, RunSummary
from sim.loop.pushes import Pushes
from sim.loop.ride import FINE, LOOKED, ride, ride_of
from sim.loop.tape import Patient, Progress, Stop, Tape
from sim.loop.ticks import STATUSES, Frame, Ticks

BLOCK = 256  # [ticks]
PROGRESS_TICKS = 50
End = tuple[Outcome, FallReason, str]


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
        self._plant, self._course, self._tape = plant, course, tape
        self._judge = Judge(course.stance, course.criteria, steps=course.steps, end_time=course.end_time)
        self._metrics = Metrics()
        self._pushes = Pushes(course.pushes, plant.com, course.period)
        plant.reset(course.q, course.dq, course.stance)
        plant.load(self._pushes.forces)
        self._broken = ""
        try:
            controller.reset(course.stance)
        except ControllerFailed as error:
            self._broken = str(error)
        self._controller = controller
        self._block = Ticks.room(BLOCK)
        self._frames = self._block.frames
        self._law = rows_law(controller, self._block)
        self._ride = ride_of(plant, controller, self._block, self._pushes, self._judge)
        self._first = self._told = self._whole = 0  # ticks: first of the block, told to the tape, decided
        self._unheld = 0  # ticks at the end whose torque is none
        self._noted: dict[str, Any] = {"pushed": 0, "followed": 0.0, "fallback": 0}

    def run(self, *, progress: Progress | None = None, stop: Stop | None = None, log: str = "") -> RunSummary:
        """Run to the end.

        Args:
            progress: Told about every 50 ticks.
            stop: Asked every tick; less often if it is `Patient`.
            log: Path of the log, for the summary.
        """
        began = time.perf_counter()
        try:
            outcome, reason, detail = self._walk(progress, stop)
        finally:
            self._tell()
        self._settle()
        self._tape.event(
            self._whole,
            "info" if outcome is Outcome.COMPLETED else "warning",
            outcome.value,
            f"{outcome.value} after {self._judge.steps} steps: {reason.value} {detail}".strip(),
        )
        return self._metrics.summary(
            outcome=outcome,
            reason=reason,
            detail=detail,
            final=self._final,
            wall_s=time.perf_counter() - began,
            torque_limits=self._plant.torque_limits,
            criteria=self._course.criteria,
            log=log,
            scuffing=self._judge.scuffing,
        )

    def _walk(self, progress: Progress | None, stop: Stop | None) -> End:
        plant, law, judge, pushes = self._plant, self._law, self._judge, self._pushes
        state, seen, step, judged = self._block.state, self._block.seen, self._block.step, self._block.judged
        tick_s, clock, frame_every = self._block.tick_s, time.perf_counter, self._tape.frame_every
        pushed, acting = bool(pushes.forces), pushes.acting
        riding = self._ride if stop is None or isinstance(stop, Patient) else None
        k = i = found = 0
        ended = FINE  # as a ride through uneventful ticks has: FINE before a tick, LOOKED within one, else behind it
        if self._broken:
            plant.look(state, seen, 0)
            self._final = state[0]
            return Outcome.ERROR, FallReason.NONE, self._broken
        while True:
            if ended == FINE:
                plant.look(state, seen, i)
                found = judge.look(state, judged, i)
            self._final = state[i]
            if ended in (FINE, LOOKED):
                if found and (end := self._heed(k, found)):
                    return end
                interruption = stop() if stop else None
                if interruption:
                    return Outcome.INTERRUPTED, FallReason.NONE, interruption

                started = clock() - (tick_s[i] if ended == LOOKED else 0.0)
                try:
                    law.decide(seen, step, i)
                    tick_s[i] = clock() - started
                    if frame_every and k % frame_every == 0:
                        self._frames[k] = Frame(pushes.applied, Foreseen.of(law.plan()))
                except ControllerFailed as error:
                    return Outcome.ERROR, FallReason.NONE, str(error)
                if pushed:
                    t, last = float(state["t"][i]), judge.last_impact
                    judged["pushed"][i] = pushes.look(t, judge.steps + 1, last)
            k += 1
            self._whole = k
            try:
                if ended in (FINE, LOOKED):
                    plant.move(step, i, acting)
                else:
                    plant.heed(ended, step, i)  # type: ignore[attr-defined]  # of a plant that rides
            except NoTorque:
                self._unheld = 1
                return Outcome.ERROR, FallReason.NONE, self._not_finite(step["u_total"][i])
            except PlantDiverged as error:
                return Outcome.FELL, FallReason.DIVERGED, str(error)
            i += 1
            if i == BLOCK:
                self._settle()
                i = 0
            if progress and k % PROGRESS_TICKS == 0:
                progress(judge.steps, float(state["t"][i - 1]))
            ended = FINE
            if riding:
                row, ended, found = ride(riding, i, i + self._uneventful(k, i, progress))
                k += row - i
                self._whole, i = k, row

    def _uneventful(self, k: int, i: int, progress: Progress | None) -> int:
        """Ticks from tick `k` in row `i` on before one that Python has to see for other reasons than its events."""
        ticks, frame_every = BLOCK - 1 - i, self._tape.frame_every
        if progress:
            ticks = min(ticks, -(k + 1) % PROGRESS_TICKS)
        return min(ticks, -k % frame_every) if frame_every else ticks

    def _not_finite(self, u: Vector) -> str:
        torques = ", ".join(f"{name} {value:g}" for name, value in zip(JOINTS, u.tolist(), strict=True))
        where = getattr(self._controller, "where", "the controller")
        return f"{where}: commanded torque is not finite: {torques} [N.m]"

    def _heed(self, k: int, found: int) -> End | None:
        """Tell what the judge has found at a tick; how the run ends, if it does."""
        judge = self._judge
        if found & LANDED:
            step = judge.touch_down()
            self._metrics.touch_down(step)
            text = f"step {step.number}: {step.foot} foot, {step.duration:.3f} s, {step.length:.3f} m"
            self._event(k, "info", "impact", text)
        if found & (SCUFF_BEGAN | SCUFF_ENDED):
            self._event(k, "warning", "scuff", judge.scuff())
        return judge.end(self._final) if found & ENDED else None

    def _event(self, k: int, level: str, name: str, message: str) -> None:
        """Tell an event after all ticks before it."""
        self._tell()
        self._tape.event(k, level, name, message)

    def _settle(self) -> None:
        """Close the block: tell the rest of it, add up its figures."""
        self._tell()
        self._metrics.take(self._block.part(0, self._whole - self._unheld - self._first, self._first))
        self._first = self._whole
        self._frames.clear()
        for memory in (self._block.texts, self._block.diagnostics):
            memory.clear()

    def _tell(self) -> None:
        """Tell the ticks decided since the last time, each event after its tick."""
        start, end = self._told - self._first, self._whole - self._first
        while start < end:
            row, events = self._next_events(start, end)
            stretch = self._block.part(start, row, self._told)
            start, self._told = row, self._first + row
            self._tape.ticks(stretch)
            for event in events:
                self._tape.event(*event)

    def _next_events(self, start: int, end: int) -> tuple[int, list[tuple[int, str, str, str]]]:
        """The events of the first row from `start` that has any, and the row behind it; `end` where there are none.

        A push begins or ends, the controller takes another gait, or falls back.
        """
        step = self._block.step
        columns = {"pushed": self._block.judged["pushed"], "followed": step["followed"], "fallback": step["fallback"]}
        while True:
            changed = np.zeros(end - start, dtype=bool)
            for name, column in columns.items():
                changed |= column[start:end] != self._noted[name]
            if not changed.any():
                return end, []
            start += int(changed.argmax())
            before, self._noted = self._noted, {name: column[start].item() for name, column in columns.items()}
            if events := self._events(self._first + start, before, self._noted, int(step["status"][start])):
                return start + 1, events

    def _events(
        self, k: int, before: dict[str, Any], now: dict[str, Any], status: int
    ) -> list[tuple[int, str, str, str]]:
        events = []
        if now["pushed"] != before["pushed"]:
            events.append((k, "info", "push", "push begins" if now["pushed"] else "push ends"))
        if (followed := now["followed"]) != before["followed"]:
            how = f"{abs(followed):.3f} m/s {'faster' if followed > 0.0 else 'slower'} than its own"
            events.append((k, "info", "gait", f"follows a gait {how}" if followed else "follows its own gait"))
        if now["fallback"] and not before["fallback"]:
            text = self._block.texts.get(k, STATUSES[status])
            events.append((k, "warning", "fallback", f"saturated ZD+PD for this tick: {text}"))
        return events
