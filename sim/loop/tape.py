"""Who listens to a run: tapes take its ticks and events; callbacks tell how far it is and may stop it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from sim.interface import ControlStep, Observation, PlantState
from sim.loop.ticks import Ticks

Progress = Callable[[int, float], None]
"""Called now and then with completed steps and simulated time in [s]."""

Stop = Callable[[], str | None]
"""Asked every tick; a reason ends the run as interrupted. One that is `Patient` is asked less often."""


@dataclass(frozen=True, slots=True)
class Patient:
    """A wish to stop that depends on time or events alone: asked at every event and every 20 ms of wall time.

    Attributes:
        ask: The wish.
    """

    ask: Stop

    def __call__(self) -> str | None:
        """The reason, if there is one."""
        return self.ask()


class Tape(Protocol):
    """Where ticks and events go, in order; the recorder is one, `NoTape` another.

    Ticks come in stretches: up to each event, and a few hundred at most.

    Attributes:
        frame_every: Ticks from one to the next whose `Ticks.frames` the tape looks at; 0 for none.
    """

    frame_every: int

    def ticks(self, ticks: Ticks) -> None:
        """The ticks since the last call."""

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Something that happened at tick `k`; a landing before the tick itself is told, other things after it."""


class NoTape:
    """Forgets everything."""

    frame_every = 0

    def ticks(self, ticks: Ticks) -> None:
        """Forget ticks."""

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Forget an event."""


class EachTick(NoTape):
    """Takes a run tick by tick, as records; slow, for tests and for looking at short runs."""

    def ticks(self, ticks: Ticks) -> None:
        """Hand every tick on."""
        for row in range(len(ticks)):
            self.tick(ticks.first + row, *ticks.records(row), float(ticks.tick_s[row]))

    def tick(self, k: int, state: PlantState, observation: Observation, step: ControlStep, tick_s: float) -> None:
        """One tick."""


class Tapes:
    """Several tapes as one."""

    def __init__(self, *tapes: Tape) -> None:
        """Args: tapes: told everything, in this order; the frames are those that the first to ask asks for."""
        self._tapes = tapes
        self.frame_every = next((tape.frame_every for tape in tapes if tape.frame_every), 0)

    def ticks(self, ticks: Ticks) -> None:
        """Hand ticks on."""
        for tape in self._tapes:
            tape.ticks(ticks)

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Hand an event on."""
        for tape in self._tapes:
            tape.event(k, level, name, message)
