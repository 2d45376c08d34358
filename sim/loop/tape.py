"""Who listens to a run: tapes take its ticks and events; callbacks tell how far it is and may stop it."""

from collections.abc import Callable
from typing import Protocol

from sim.interface import ControlStep, Observation, PlantState

Progress = Callable[[int, float], None]
"""Called now and then with completed steps and simulated time in [s]."""

Stop = Callable[[], str | None]
"""Asked every tick; a reason ends the run as interrupted."""


class Tape(Protocol):
    """Where ticks and events go; the recorder is one, `NoTape` another."""

    def tick(self, k: int, state: PlantState, observation: Observation, step: ControlStep, tick_s: float) -> None:
        """One tick."""

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Something that happened at a tick."""


class NoTape:
    """Forgets everything."""

    def tick(self, k: int, state: PlantState, observation: Observation, step: ControlStep, tick_s: float) -> None:
        """Forget a tick."""

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Forget an event."""


class Tapes:
    """Several tapes as one."""

    def __init__(self, *tapes: Tape) -> None:
        """Args: tapes: told everything, in this order."""
        self._tapes = tapes

    def tick(self, k: int, state: PlantState, observation: Observation, step: ControlStep, tick_s: float) -> None:
        """Hand a tick on."""
        for tape in self._tapes:
            tape.tick(k, state, observation, step, tick_s)

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Hand an event on."""
        for tape in self._tapes:
            tape.event(k, level, name, message)
