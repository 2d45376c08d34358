"""A plant and a controller put together once, for many runs: other starts, pushes and ends, the same walker."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sim.errors import UserError
from sim.interface import Controller, Plant, Vector
from sim.loop import Course, Loop, Outcome, RunSummary, Stop, Tape
from sim.scenario import Push, Scenario
from sim.stability.sections import SectionTape, Surface
from sim.stability.step_map import Fell

MAP_TIME = 3.0  # [s] allowed for the one step of a step map


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rig:
    """A walker ready to start, as often as one likes; equal starts give equal runs.

    Attributes:
        scenario: What it was built from; its name and its settings are for reports.
        plant: The truth.
        walker: Makes the plant as the controller meets it, with new sensors and motors.
        controller: The law.
        q_start: First angles in body order in [rad], (5,), without the scenario's offsets.
        course: What the scenario puts the walker through.
        x_gait: The gait's own pre-impact state in stance order, (10,): a first guess of the periodic one.
        surface: The switching surface.
    """

    scenario: Scenario
    plant: Plant
    walker: Callable[[], Plant]
    controller: Controller
    q_start: Vector
    course: Course
    x_gait: Vector
    surface: Surface

    def run(
        self,
        tape: Tape,
        *,
        q: Vector | None = None,
        dq: Vector | None = None,
        pushes: Sequence[Push] | None = None,
        steps: int | None = None,
        end_time: float | None = None,
        stop: Stop | None = None,
    ) -> RunSummary:
        """One run from its start to its end.

        Args:
            tape: Where ticks and events go.
            q: First angles in body order in [rad], (5,); by default the scenario's start.
            dq: First rates in [rad/s], (5,).
            pushes: External forces; by default the scenario's.
            steps: Steps after which the run is completed; by default the scenario's.
            end_time: Time after which it ends anyway in [s]; by default the scenario's, and 2 s for each of `steps`.
            stop: Asked every tick; a reason ends the run as interrupted.

        Raises:
            UserError: the controller broke.
        """
        if end_time is None:
            end_time = self.course.end_time if steps is None else max(self.course.end_time, 2.0 * steps)
        steps = self.course.steps if steps is None else steps
        course = dataclasses.replace(
            self.course,
            q=self.course.q if q is None else q,
            dq=self.course.dq if dq is None else dq,
            pushes=self.course.pushes if pushes is None else pushes,
            steps=steps,
            end_time=end_time,
        )
        summary = Loop(plant=self.walker(), controller=self.controller, course=course, tape=tape).run(stop=stop)
        if summary.outcome == Outcome.ERROR.value:
            raise UserError(summary.message)  # of a controller from outside; no fall, and no property of the walk
        return summary

    def sections(self) -> SectionTape:
        """A tape for the section states of the next run."""
        return SectionTape(self.surface, self.plant, self.course.stance)

    def step_map(self, x: Vector) -> Vector:
        """The section state after one undisturbed step from a section state, both (10,) in stance order.

        The run starts with the impact, in its first tick, and ends with the next one.

        Raises:
            Fell: the walker falls first.
        """
        tape = self.sections()
        summary = self.run(tape, q=x[:5], dq=x[5:], pushes=(), steps=2, end_time=MAP_TIME)
        if summary.outcome != Outcome.COMPLETED.value:
            raise Fell(summary.fall_reason or summary.message)
        following: Vector = tape.states[-1]
        if not np.isfinite(following).all():
            raise Fell("the state before the impact is not finite")
        return following

    def settled(self, steps: int, keep: int) -> Vector:
        """Section states of the last `keep` of an undisturbed walk's `steps` steps, (keep, 10).

        Raises:
            Fell: the walker falls on the way.
        """
        tape = self.sections()
        q = self.q_start + np.array(self.scenario.start.q_change)  # the torso not tilted
        summary = self.run(tape, q=q, pushes=(), steps=steps)
        if summary.outcome != Outcome.COMPLETED.value:
            raise Fell(f"falls in step {summary.steps + 1}: {summary.fall_reason or summary.message}")
        return np.array(tape.states[-keep:])
