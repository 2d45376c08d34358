"""Studies that ask as they learn: what they ask next, from their seed and the results there are.

The course of such a study is gone through again from its beginning with the answers in the database, so that it goes
on after a kill as it would have without. Which walks a batch holds does not depend on how many workers run them.
"""

import json
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sim.errors import UserError
from sim.trials.plan import AdaptiveStudy, Plan
from sim.trials.reliability.asking import Array, Batch, Search
from sim.trials.reliability.procedure import Certified, Found, course, noise_seed
from sim.trials.reliability.space import Space
from sim.trials.run.result import TrialResult
from sim.trials.run.store import Store
from sim.trials.run.trial import Point

Asked = tuple[str, int, Point]


@dataclass(slots=True, kw_only=True, eq=False)
class Replay:
    """A study of one controller as far as its answers go.

    Attributes:
        search: Its course.
        batch: What it asks for next; None when it is over.
        first: Index of the first trial of that batch within the study.
        found: What it found, once it is over.
        points: Everything asked for and answered, in standard normal space, by index.
        fell: The answers.
        margins: Least forward speed of the hip of each walk in [m/s], NaN where it is not recorded.
    """

    search: Search[Found | Certified]
    batch: Batch | None = None
    first: int = 0
    found: Found | Certified | None = None
    points: list[Array] = field(default_factory=list)
    fell: list[Array] = field(default_factory=list)
    margins: list[Array] = field(default_factory=list)

    def go_on(self, answers: Array | None) -> None:
        """Hand the answers of the batch in; the next one is there then, or the end."""
        if self.batch is not None and answers is not None:
            self.first += len(self.batch)
            self.points.append(self.batch.u)
            self.fell.append(answers[:, 0] if self.batch.guided else answers)
        try:
            self.batch = next(self.search) if answers is None else self.search.send(answers)
        except StopIteration as end:
            self.batch, self.found = None, end.value


class Replays:
    """The studies of a plan, gone through with the results of a store."""

    def __init__(self, plan: Plan, store: Store) -> None:
        """Go through nothing yet."""
        self._plan, self._store = plan, store
        self._there: dict[tuple[str, str], Replay] = {}
        self._spaces: dict[str, Space] = {}

    def space(self, study: AdaptiveStudy) -> Space:
        """Standard normal space of a study."""
        if study.name not in self._spaces:
            self._spaces[study.name] = Space(study, self._plan.scenario)
        return self._spaces[study.name]

    def replay(self, study: AdaptiveStudy, start: int, controller: str) -> Replay:
        """A study as far as its answers go.

        Args:
            study: The study.
            start: Number of its first trial.
            controller: Kind of controller.

        Raises:
            UserError: a row is not what the study asks for.
        """
        here = self._there.get((study.name, controller))
        if here is None:
            here = self._there[study.name, controller] = Replay(search=course(study, self._plan.seed))
            here.go_on(None)
        rows: dict[int, TrialResult] = {}
        known_to = -1
        while here.batch is not None:
            first, last = start + here.first, start + here.first + len(here.batch)
            if last - start > study.size:
                raise UserError(f"study {study.name!r}: asks for more than {study.size} trials of {controller}")
            if last > known_to:
                known_to = last + LOOK_AHEAD
                rows = {row.trial: row for row in self._store.results(controller, first, known_to)}
            if any(number not in rows for number in range(first, last)):
                break
            self._check(study, controller, here.batch, rows[first])
            there = [rows[number] for number in range(first, last)]
            fell = np.array([_fell(row) for row in there])
            margin = np.array([row.least_speed_m_s for row in there])
            here.margins.append(margin)
            here.go_on(np.column_stack((fell, margin)) if here.batch.guided else fell)
        return here

    def missing(self, study: AdaptiveStudy, start: int, controller: str) -> list[Asked]:
        """The trials of the next batch that have no row yet."""
        here = self.replay(study, start, controller)
        if here.batch is None:
            return []
        first = start + here.first
        rows = self._store.results(controller, first, first + len(here.batch))
        done = {row.trial for row in rows}
        return [
            (controller, first + k, self._point(study, here.batch, k))
            for k in range(len(here.batch))
            if first + k not in done
        ]

    def _point(self, study: AdaptiveStudy, batch: Batch, k: int) -> Point:
        seed = noise_seed(self._plan.seed, study.name, int(batch.noise[k]))
        return Point(values=self.space(study).values(batch.u[k]), seed=seed)

    def _check(self, study: AdaptiveStudy, controller: str, batch: Batch, row: TrialResult) -> None:
        """Refuse rows that another version of the search asked for."""
        point = self._point(study, batch, 0)
        there = list(json.loads(row.values).values())
        if row.seed != point.seed or not all(map(_alike, there, point.values)):
            raise UserError(
                f"study {study.name!r}: trial {controller}/{row.trial} is not what the search asks for there; its "
                "results are of another version of the program: use another folder, or --restart"
            )


LOOK_AHEAD = 500  # rows read at a time


def _alike(one: Any, other: Any) -> bool:
    numbers = isinstance(one, int | float) and isinstance(other, int | float)
    return math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-9) if numbers else bool(one == other)


def _fell(row: TrialResult) -> float:
    return float(row.fell) if row.known else math.nan
