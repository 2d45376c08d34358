"""The vocabulary of an experiment: scenarios, tasks, results, claims."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.reproduce.panels import Panel
from sim.runner import Task as Task
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

TORQUE_LIMITS = np.array([75.0, 75.0, 50.0, 50.0])  # [N.m], Sec. IV

Arrays = Mapping[str, NDArray[Any]]
Results = Mapping[str, Arrays]
"""Results of an experiment's tasks, by the names `tasks` gave them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How thorough a reproduction is, and what is changed against the paper.

    Attributes:
        quick: Whether coarse versions do.
        changes: Settings changed in every scenario, by dotted path; a broken controller, say.
    """

    quick: bool = False
    changes: Mapping[str, Any] = field(default_factory=dict)

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
        return to_toml(with_values(Scenario(), {**base, **self.changes, **(changes or {})}))


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
    """

    claim: str
    paper: str
    rigid: Finding
    mujoco: Finding

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
