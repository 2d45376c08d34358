"""A stretch of ticks as columns: what listeners of a run are given, a row a tick."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.interface import (
    LEGS,
    OBSERVATION,
    PLAIN,
    STATE,
    STEP,
    AppliedForce,
    ControlStep,
    Observation,
    Plan,
    PlantState,
    Rows,
    Status,
    observation_of,
)

STATUSES = tuple(Status)

JUDGED = np.dtype(
    [
        ("steps", np.int64),  # completed
        ("stance", np.int64),  # row of the foot that stands
        ("last_impact", float),  # [s]
        ("settled", np.int8),  # whether contact forces are those of walking
        ("pushed", np.int8),  # whether an external force acts in the hold that follows
    ],
    align=True,
)
"""What the judge makes of a tick."""


class Frame(NamedTuple):
    """What a tick has besides its row, kept now and then for those who draw.

    Attributes:
        applied: External forces over the last hold.
        plan: What the controller expects.
    """

    applied: tuple[AppliedForce, ...] = ()
    plan: Plan | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ticks:
    """Consecutive ticks, views that are good until the listener returns; (n,) each.

    Attributes:
        first: Number of the first tick.
        state: Truth at each tick, rows of `STATE`.
        seen: What the controller saw at it, rows of `OBSERVATION`.
        step: What it decided, rows of `STEP`.
        judged: What the judge made of it, rows of `JUDGED`.
        tick_s: Controller wall time in [s], observation in to torque out.
        texts: Tick -> how its torque came about, where that is not in `Status`.
        diagnostics: Tick -> figures of the law's own (`ControlStep.diagnostics`), where it has any.
        frames: Tick -> what it has besides, where a listener has asked for it.
    """

    first: int
    state: Rows
    seen: Rows
    step: Rows
    judged: Rows
    tick_s: NDArray[np.float64]
    texts: dict[int, str] = field(default_factory=dict)
    diagnostics: dict[int, Mapping[str, float]] = field(default_factory=dict)
    frames: dict[int, Frame] = field(default_factory=dict)

    @classmethod
    def room(cls, n: int) -> "Ticks":
        """Room for n ticks."""
        return cls(
            first=0,
            state=np.zeros(n, STATE),
            seen=np.zeros(n, OBSERVATION),
            step=np.zeros(n, STEP),
            judged=np.zeros(n, JUDGED),
            tick_s=np.zeros(n),
            texts={},
            diagnostics={},
            frames={},
        )

    def __len__(self) -> int:
        return len(self.tick_s)

    def part(self, start: int, end: int, first: int) -> "Ticks":
        """Rows from `start` to before `end`, the first of which is tick `first`."""
        part = slice(start, end)
        return Ticks(
            first=first,
            state=self.state[part],
            seen=self.seen[part],
            step=self.step[part],
            judged=self.judged[part],
            tick_s=self.tick_s[part],
            texts=self.texts,
            diagnostics=self.diagnostics,
            frames=self.frames,
        )

    def records(self, row: int) -> tuple[PlantState, Observation, ControlStep]:
        """A row as the records that the two worlds exchange, copies."""
        k = self.first + row
        frame = self.frames.get(k, Frame())
        state = PlantState.of(self.state[row], frame.applied)
        return state, observation_of(self.seen[row]), step_of(self.step[row], self.texts.get(k), frame.plan)


def step_of(row: np.void, status: str | None = None, plan: Plan | None = None) -> ControlStep:
    """A row of `STEP` as a record, a copy; status and plan are what the row does not hold."""
    values = {name: row[name].copy() if row[name].shape else row[name].item() for name in PLAIN}
    return ControlStep(
        stance=LEGS[row["stance"]],
        status=STATUSES[row["status"]] if status is None else status,  # type: ignore[arg-type]
        fallback=bool(row["fallback"]),
        plan=plan,
        **values,
    )
