"""A plant and a controller put together once, for many runs: other starts, pushes and ends, the same walker."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sim.interface import Controller, Plant, Vector
from sim.loop import FallCriteria, Loop, Outcome, RunSummary, Stop, Tape
from sim.plant.kinematics import LEGS
from sim.scenario import Push, Scenario
from sim.stability.sections import SectionTape, Surface
from sim.stability.step_map import Fell

FIRST_STANCE = LEGS[0]
MAP_TIME = 3.0  # [s] allowed for the one step of a step map


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rig:
    """A walker ready to start, as often as one likes; equal starts give equal runs.

    Attributes:
        scenario: What it was built from; its pushes and offsets are defaults of `run`.
        plant: The truth.
        walker: Makes the plant as the controller meets it, with new sensors and motors.
        controller: The law.
        com: Centre of mass (x, z) of each link in its own frame in [m], by link name.
        torque_limits: In [N.m], (4,), ordered as `JOINTS`.
        q_start: First angles in body order in [rad], (5,), without the scenario's offsets.
        dq_start: Their rates in [rad/s], (5,).
        x_gait: The gait's own pre-impact state in stance order, (10,): a first guess of the periodic one.
        surface: The switching surface.
        criteria: When a run counts as a fall.
    """

    scenario: Scenario
    plant: Plant
    walker: Callable[[], Plant]
    controller: Controller
    com: dict[str, tuple[float, float]]
    torque_limits: Vector
    q_start: Vector
    dq_start: Vector
    x_gait: Vector
    surface: Surface
    criteria: FallCriteria

    def run(
        self,
        tape: Tape,
        *,
        q: Vector | None = None,
        dq: Vector | None = None,
        torso_offset: float | None = None,
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
            torso_offset: Added to the torso angle alone in [rad]; by default the scenario's.
            pushes: External forces; by default the scenario's.
            steps: Steps after which the run is completed; by default the scenario's.
            end_time: Time after which it ends anyway in [s]; by default the scenario's, or 2 s for each step.
            stop: Asked every tick; a reason ends the run as interrupted.
        """
        start = self.scenario.start
        q = self.q_start + np.array(start.q_change) if q is None else np.array(q)
        dq = self.dq_start + np.array(start.dq_offset) if dq is None else np.array(dq)
        q[-1] += start.torso_offset if torso_offset is None else torso_offset
        walker = self.walker()
        walker.reset(q, dq, FIRST_STANCE)
        self.controller.reset(FIRST_STANCE)
        steps = self.scenario.steps if steps is None else steps
        return Loop(
            plant=walker,
            controller=self.controller,
            pushes=self.scenario.pushes if pushes is None else pushes,
            com=self.com,
            stance=FIRST_STANCE,
            steps=steps,
            end_time=end_time or max(self.scenario.end_time, 2.0 * steps),
            tape=tape,
            torque_limits=self.torque_limits,
            period=self.scenario.controller.period,
            criteria=self.criteria,
        ).run(stop=stop)

    def sections(self) -> SectionTape:
        """A tape for the section states of the next run."""
        return SectionTape(self.surface, self.plant, FIRST_STANCE)

    def step_map(self, x: Vector) -> Vector:
        """The section state after one undisturbed step from a section state, both (10,) in stance order.

        The run starts with the impact, in its first tick, and ends with the next one.

        Raises:
            Fell: the walker falls first.
        """
        tape = self.sections()
        summary = self.run(tape, q=x[:5], dq=x[5:], torso_offset=0.0, pushes=(), steps=2, end_time=MAP_TIME)
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
        summary = self.run(tape, torso_offset=0.0, pushes=(), steps=steps)
        if summary.outcome != Outcome.COMPLETED.value:
            raise Fell(f"falls in step {summary.steps + 1}: {summary.fall_reason or summary.message}")
        return np.array(tape.states[-keep:])
