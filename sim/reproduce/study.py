"""The vocabulary of an experiment: scenarios, tasks, results, claims."""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from numpy.typing import NDArray

from sim.reproduce.panels import Panel
from sim.runner import Task
from sim.scenario import Scenario, to_toml, with_values

PLANTS = ("rigid", "mujoco")
PLANT_NAMES = {"rigid": "rigid plant", "mujoco": "MuJoCo"}
CONTROLLERS = ("zd-pd", "c-mpc")
CONTROLLER_NAMES = {"zd-pd": "ZD+PD", "c-mpc": "C-MPC"}
JOINT_NAMES = ("stance hip", "swing hip", "stance knee", "swing knee")
"""Order of torques and outputs in every result and figure."""

UNDISTURBED: Mapping[str, Any] = {"steps": 15}
PUSHED: Mapping[str, Any] = {"steps": 12, "pushes.0.force": 25.0, "pushes.0.step": 2}
"""Walks that several figures show; asked for in the same words they are run once."""

PAPER, POLISHED = "paper", "paper-polished"
"""Table I as printed, and the exactly periodic gait next to it."""

Arrays = Mapping[str, NDArray[Any]]
Results = Mapping[str, Arrays]
"""Results of an experiment's tasks, by the names `tasks` gave them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How thorough a reproduction is, and what is changed against the paper.

    Attributes:
        quick: Whether coarse versions do.
        changes: Settings changed in every scenario, by dotted path; a broken controller, say.
        beside: Whether this is the gait judged beside the paper's, for which some experiments look less finely.
    """

    quick: bool = False
    changes: Mapping[str, Any] = field(default_factory=dict)
    beside: bool = False

    @property
    def polished(self) -> "Effort | None":
        """The same with the polished gait; None where a gait was asked for."""
        if "gait" in self.changes:
            return None
        return dataclasses.replace(self, changes={**self.changes, "gait": POLISHED}, beside=True)

    def scenario(self, plant: str, controller: str, changes: Mapping[str, Any] | None = None) -> str:
        """A scenario as TOML: the level walk of ten steps with this plant and controller, then `changes`.

        Args:
            plant: A name in `PLANTS`.
            controller: A name in `CONTROLLERS`.
            changes: Settings by dotted path.
        """
        base = {
            "name": "reproduce",
            "plant.kind": plant,
            # RK4 at 1 ms is exact to 1e-8 on the rigid plant; MuJoCo's contact needs its 0.25 ms.
            "plant.timestep": 1e-3 if plant == "rigid" else 0.25e-3,
            "controller.kind": controller,
        }
        wanted = {**base, **self.changes, **(changes or {})}
        if controller != "c-mpc":
            wanted["controller.kind"] = controller  # another one takes the place of C-MPC alone
            wanted = {path: value for path, value in wanted.items() if not path.startswith("controller.settings.")}
        return to_toml(with_values(Scenario(), wanted))


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What one plant says to a claim.

    Attributes:
        text: The measured value, with unit.
        holds: Whether the claim holds; None where it says nothing about the claim.
    """

    text: str
    holds: bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A claim of the paper against both plants.

    Attributes:
        claim: What is claimed, and the criterion.
        paper: The paper's value.
        rigid: What the paper's own kind of plant says.
        mujoco: What the plant with contact says.
        polished: What both say with the polished gait, rigid first; None where it was not tried.
    """

    claim: str
    paper: str
    rigid: Finding
    mujoco: Finding
    polished: tuple[Finding, Finding] | None = None

    @classmethod
    def of(cls, claim: str, paper: str, judge: Callable[[str], Finding]) -> "Verdict":
        """Ask `judge` on each plant."""
        return cls(claim=claim, paper=paper, rigid=judge("rigid"), mujoco=judge("mujoco"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """What an experiment found.

    Attributes:
        verdicts: One for each claim.
        panels: The figure, row by row.
        tables: Data behind it: file stem -> column name with unit -> values.
        notes: Choices made where the paper leaves something open.
    """

    verdicts: tuple[Verdict, ...]
    panels: tuple[tuple[Panel, ...], ...]
    tables: Mapping[str, Mapping[str, NDArray[Any]]]
    notes: tuple[str, ...] = ()


def tasks_of(experiment: ModuleType, effort: Effort) -> dict[str, Task]:
    """What an experiment asks for, with the paper's gait and, unless one was asked for, the polished one.

    Args:
        experiment: One of `sim.reproduce.experiments`.
        effort: How thorough.

    Returns:
        Tasks by name, the gait before the experiment's own.
    """
    return {
        f"{gait}/{name}": task for gait, one in _efforts(effort).items() for name, task in experiment.tasks(one).items()
    }


def evaluation_of(experiment: ModuleType, results: Results, effort: Effort) -> Evaluation:
    """What an experiment found with each gait: verdicts side by side, figures of the paper's gait, data of both."""
    found = {
        gait: experiment.evaluate(
            {name.removeprefix(f"{gait}/"): arrays for name, arrays in results.items() if name.startswith(f"{gait}/")},
            one,
        )
        for gait, one in _efforts(effort).items()
    }
    paper: Evaluation = found[PAPER]
    if POLISHED not in found:
        return paper
    other: Evaluation = found[POLISHED]
    return Evaluation(
        verdicts=tuple(
            dataclasses.replace(verdict, polished=(polished.rigid, polished.mujoco))
            for verdict, polished in zip(paper.verdicts, other.verdicts, strict=True)
        ),
        panels=paper.panels,
        tables={**paper.tables, **{f"polished-{stem}": columns for stem, columns in other.tables.items()}},
        notes=(*paper.notes, *(f"Polished gait: {note}" for note in other.notes if note not in paper.notes)),
    )


def _efforts(effort: Effort) -> dict[str, Effort]:
    return {PAPER: effort} | ({POLISHED: effort.polished} if effort.polished else {})
