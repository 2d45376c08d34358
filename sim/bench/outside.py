"""What the way through a controller from outside costs a tick."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from controller.common import outside
from sim.bench.figure import Figure
from sim.bridge.run import run_scenario
from sim.interface import ControlStep, Observation
from sim.loop import NoTape, Ticks
from sim.scenario import load, with_values

TRIES = 3


class Decisions(NoTape):
    """Keeps what was decided, and how long each decision took in [s]."""

    def __init__(self) -> None:
        """Start empty."""
        self.steps: list[ControlStep] = []
        self.seconds: list[float] = []

    def ticks(self, ticks: Ticks) -> None:
        """Keep them."""
        self.steps += [ticks.records(row)[2] for row in range(len(ticks))]
        self.seconds += ticks.tick_s.tolist()


class Answers:
    """A controller that knows its answers beforehand: what a tick takes then is the way to it and back."""

    def __init__(self, answers: Sequence[Any]) -> None:
        """Args: answers: a torque (4,) in [N.m] or a `ControlStep` for each tick."""
        self._answers = answers
        self._next: Iterator[Any] = iter(answers)

    def reset(self, stance: str) -> None:
        """Begin anew."""
        self._next = iter(self._answers)

    def step(self, observation: Observation) -> Any:
        """The next answer."""
        return next(self._next)


def outside_path(steps: int) -> list[Figure]:
    """Ticks of a controller from outside that gives the answers of zd-pd without working them out.

    From what is seen to a torque checked and written, nothing subtracted for what a built-in's own way costs.
    """
    walk = with_values(load("undisturbed"), {"steps": steps, "controller.kind": "zd-pd"})
    told = Decisions()
    ended = run_scenario(walk, tape=told)
    figures = []
    for given, answers in (("a torque", [step.u_total for step in told.steps]), ("a ControlStep", told.steps)):
        medians = []
        for _ in range(TRIES):
            timed = Decisions()
            kind = outside.give(Answers(answers))
            again = run_scenario(with_values(walk, {"controller.kind": kind}), tape=timed)
            assert (again.steps, again.ticks) == (ended.steps, ended.ticks)
            medians.append(float(np.median(timed.seconds)))
        name = f"way to a controller from outside and back, {given}, median"
        figures.append(Figure(name=name, value=1e6 * min(medians), unit="us", target="<= 10"))
    return figures
