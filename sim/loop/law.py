"""Any controller as the loop asks it: from a row of what is seen to a row of what is done."""

from dataclasses import dataclass

import numpy as np

from sim.interface import Controller, Plan, RowController, Rows, Vector, observation_of, write_step
from sim.loop.ticks import Ticks


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Foreseen:
    """A plan worked out, which its controller's next decision leaves alone.

    Attributes:
        y: Predicted outputs in [rad], (N + 1, 4).
        force: Predicted stance contact forces in [N], (N, 2).
    """

    y: Vector
    force: Vector

    @classmethod
    def of(cls, plan: Plan | None) -> "Foreseen | None":
        """Work a plan out."""
        return None if plan is None else cls(y=np.array(plan.outputs()), force=np.array(plan.contact_forces()))

    def outputs(self) -> Vector:
        """Predicted outputs in [rad], (N + 1, 4)."""
        return self.y

    def contact_forces(self) -> Vector:
        """Predicted stance contact forces in [N], (N, 2)."""
        return self.force


class Recorded:
    """A controller that decides from record to record, as one that does from row to row."""

    def __init__(self, controller: Controller, ticks: Ticks) -> None:
        """Args: controller: the law; ticks: filled with what rows do not hold, by tick: statuses, diagnostics."""
        self._controller = controller
        self._fill = getattr(controller, "fill", None)  # of a guarded one: fills the row itself where it can
        self._texts = ticks.texts
        self._diagnostics = ticks.diagnostics
        self._plan: Plan | None = None
        self._k = 0

    def decide(self, seen: Rows, step: Rows, i: int) -> None:
        """Fill row `i` of `step` from row `i` of `seen`."""
        k, self._k = self._k, self._k + 1
        decided = self._fill(seen, step, i) if self._fill else self._controller.step(observation_of(seen[i]))
        self._plan = None if decided is None else decided.plan
        if decided is None:
            return
        if not write_step(step, i, decided):
            self._texts[k] = decided.status
        if decided.diagnostics:
            self._diagnostics[k] = dict(decided.diagnostics)  # the law may reuse its own

    def plan(self) -> Plan | None:
        """What the last decision expects."""
        return self._plan


def rows_law(controller: Controller, ticks: Ticks) -> "RowController | Recorded":
    """The controller itself where it decides from row to row."""
    return controller if isinstance(controller, RowController) else Recorded(controller, ticks)
