"""What a run is put through: its start, its pushes, when it ends and what counts as a fall."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from sim.interface import LEGS, Vector
from sim.loop.judge import FallCriteria
from sim.loop.pushes import PERIOD
from sim.scenario import Push


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """One run of a walker under a controller, whatever the two are.

    Attributes:
        q: First angles in body order in [rad], (5,).
        dq: Their rates in [rad/s], (5,).
        steps: Steps after which the run is completed.
        end_time: Simulated time after which it ends anyway in [s].
        pushes: External forces.
        stance: The foot that stands at the start.
        criteria: When the run counts as a fall.
        period: Control period in [s], over which impulses are spread.
    """

    q: Vector
    dq: Vector
    steps: int
    end_time: float
    pushes: Sequence[Push] = ()
    stance: str = LEGS[0]
    criteria: FallCriteria = field(default_factory=FallCriteria)
    period: float = PERIOD
