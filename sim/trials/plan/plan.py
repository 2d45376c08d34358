"""A plan: what to try, for which controllers, from which seed; frozen dataclasses <-> TOML."""

import contextlib
import dataclasses
import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from controller.common import outside, toml
from controller.common.settings import BUILT_IN
from controller.common.units import NOT_NEGATIVE, POSITIVE, Second, Unit
from sim.errors import UserError
from sim.scenario import Scenario, files, names_a_path
from sim.settings import tree as settings
from sim.settings.spec import leaf
from sim.trials.plan.axis import Axis, Value, changes, check_axes, label, scenario_at
from sim.trials.plan.grid import GridStudy
from sim.trials.plan.limits import shipped_limits
from sim.trials.plan.margin import MarginStudy
from sim.trials.plan.montecarlo import MonteCarloStudy
from sim.trials.plan.reliability import CertificateStudy, ReliabilityStudy, extremes

SHIPPED = Path(__file__).parent / "shipped"

MOST_TRIALS = 2_000_000  # of a study, for each controller; each could be asked for

Study = GridStudy | MarginStudy | MonteCarloStudy | ReliabilityStudy | CertificateStudy

REACH = 4.0
"""Deviations at which the values of a study that searches must still be legal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A campaign of trials.

    Trials are numbered through all studies, in the order grid, margin, montecarlo, reliability, certificate; a trial is
    a controller and an index, and the index alone seeds it, but in the last two, whose searches say what they try.

    Attributes:
        name: Short name.
        description: One sentence.
        seed: Root of every trial's seed.
        controllers: Kinds of controller; each is given the same trials. One from outside takes of
            `scenario.controller.settings` what it knows.
        wall_limit: Wall time after which a trial is given up, and its process killed if it does not answer; such a
            trial has no result, it neither survived nor fell.
        retries: How often a trial that ended its process is tried again, alone on a worker.
        logs: Whether to keep the logs of trials that did not survive.
        log_every: Keep the log of every n-th trial too; 0 for none.
        limits: File of `cmpc limit --out` whose rows are drawn beside the margins, or the name of a shipped one.
        scenario: What every trial starts from; its controller's kind and its seed are set by the trial.
        grid: Grid studies.
        margin: Margin studies.
        montecarlo: Monte-Carlo studies.
        reliability: Studies of the nearest fall and its probability.
        certificate: Certificates of a probability.
    """

    name: str = "trials"
    description: str = ""
    seed: Annotated[int, NOT_NEGATIVE] = 0
    controllers: tuple[str, ...] = ("c-mpc", "zd-pd")
    wall_limit: Annotated[Second, POSITIVE] = 120.0
    retries: Annotated[int, Unit("times"), NOT_NEGATIVE] = 2
    logs: Literal["none", "falls"] = "none"
    log_every: Annotated[int, Unit("trials"), NOT_NEGATIVE] = 0
    limits: str = ""
    scenario: Scenario = dataclasses.field(default_factory=Scenario)
    grid: tuple[GridStudy, ...] = ()
    margin: tuple[MarginStudy, ...] = ()
    montecarlo: tuple[MonteCarloStudy, ...] = ()
    reliability: tuple[ReliabilityStudy, ...] = ()
    certificate: tuple[CertificateStudy, ...] = ()

    @classmethod
    def read_as(cls, table: Mapping[str, Any]) -> tuple[type["Plan"], Mapping[str, Any]]:
        """A plan's own class; the scenario has the settings of the first controller from outside, if it names none."""
        kinds, scenario = table.get("controllers"), table.get("scenario", {})
        common = scenario.get("controller", {}) if isinstance(scenario, Mapping) else None
        words = [word for word in kinds if isinstance(word, str)] if isinstance(kinds, list) else []
        first = next((word for word in words if word not in BUILT_IN and outside.is_named(word)), None)
        if first is None or not isinstance(common, Mapping) or "kind" in common:
            return Plan, table
        return Plan, {**table, "scenario": {**scenario, "controller": {**common, "kind": first}}}

    def __post_init__(self) -> None:
        settings.check(self)
        spec = settings.spec_at(self.scenario, "controller.kind")
        for kind in self.controllers:
            leaf(kind, spec, "controllers")
            if kind not in BUILT_IN and not outside.is_inert():
                outside.find(kind)
        if not self.controllers or len(set(self.controllers)) != len(self.controllers):
            raise UserError(f"controllers = {list(self.controllers)}: must be one or more, each once")
        if not self.studies:
            raise UserError(
                "the plan has no study; must have at least one [[grid]], [[margin]], [[montecarlo]], "
                "[[reliability]] or [[certificate]]"
            )
        names = [study.name for study in self.studies]
        for name in names:
            if names.count(name) > 1:
                raise UserError(f"study name = {name!r}: is used twice; each study needs a name of its own")
        for study in self.studies:
            study.check(self.scenario)
            together = not isinstance(study, MarginStudy)
            check_axes(f"study {study.name!r}", study.axes, self.scenario, together=together)
            if study.size > MOST_TRIALS:
                raise UserError(f"study {study.name!r}: has {study.size} trials; must be {MOST_TRIALS} or fewer")
        self._check_ends()

    def _check_ends(self) -> None:
        """Build the outermost scenarios, so that an illegal value is refused before the first trial."""
        for study in self.studies:
            ends = _ends(study)
            # The axes of a margin study are tried alone, those of the others all at once.
            alone = isinstance(study, MarginStudy)
            others: dict[str, Any] = {}
            for axis, values in () if alone else ends:
                others |= changes(axis, values[0], self.scenario)
            for axis, values in ends:
                for value in values:
                    try:
                        scenario_at(self.scenario, others | changes(axis, value, self.scenario))
                    except UserError as error:
                        raise UserError(f"study {study.name!r}, axis {label(axis)!r}: {error}") from error

    @property
    def studies(self) -> tuple[Study, ...]:
        """All studies, in the order of their trials."""
        return (*self.grid, *self.margin, *self.montecarlo, *self.reliability, *self.certificate)

    def offsets(self) -> Iterator[tuple[int, Study]]:
        """Each study with the index of its first trial."""
        start = 0
        for study in self.studies:
            yield start, study
            start += study.size

    def study_of(self, index: int) -> tuple[Study, int]:
        """The study of a trial and the trial's index within it.

        Raises:
            UserError: no such index.
        """
        for start, study in self.offsets():
            if start <= index < start + study.size:
                return study, index - start
        size = sum(study.size for study in self.studies)
        raise UserError(f"trial index {index}: must be 0 to {size - 1} in plan {self.name!r}")

    def hash(self) -> str:
        """Fingerprint of everything that decides the results."""
        return hashlib.sha256(to_toml(dataclasses.replace(self, limits="")).encode()).hexdigest()


def _ends(study: Study) -> list[tuple[Axis, list[Value]]]:
    """Every axis of a study with its outermost values."""
    if isinstance(study, GridStudy):
        return [
            (axis, [axis.point(0), axis.point(axis.count - 1)] if axis.count else list(axis.points))
            for axis in study.axes
        ]
    if isinstance(study, MarginStudy):
        return [(axis, [axis.value(position) for position in axis.ends]) for axis in study.axes]
    if isinstance(study, ReliabilityStudy | CertificateStudy):
        return list(extremes(study.axes, REACH))
    found: list[tuple[Axis, list[Value]]] = []
    for axis in study.axes:
        values = [axis.centre, axis.low, axis.high, *axis.values, *axis.words]
        found.append((axis, [value for value in values if value is not None]))
    return found


def to_toml(plan: Plan) -> str:
    """The whole plan as TOML text; `from_toml` reads back an equal one."""
    return settings.to_toml(plan)


def from_toml(text: str, where: str = "plan", *, trusted: bool = True) -> Plan:
    """A plan from TOML text.

    Args:
        text: The text.
        where: What messages call it.
        trusted: Whether controllers from outside may be imported to know their settings.

    Raises:
        UserError: invalid TOML, unknown key, wrong type or illegal value, on one line.
    """
    try:
        with contextlib.nullcontext() if trusted else outside.inert():
            tree = toml.loads(text)
            other = {"gait": "cmpc run --gait", "scenario": "cmpc run"}.get(files.kind_of(tree))
            if other and {*tree} & {"alpha", "walker", "plant", "pushes", "steps", "controller"}:
                raise UserError(f"is a {files.kind_of(tree)}, must be a plan here; {other} {where}")
            plan = settings.build(Plan, tree)
            if trusted and plan.limits:  # results stay readable without
                shipped_limits(plan.limits)
            return plan
    except UserError as error:
        raise UserError(f"{where}: {error}") from error
    except ValueError as error:
        raise UserError(f"{where}: is not valid TOML: {error}") from error


def load_plan(name: str) -> Plan:
    """A shipped plan by name, or any other by the path of its .toml file.

    Raises:
        UserError: no such name (the message has the nearest and the list), or an illegal file.
    """
    path = Path(name)
    if not names_a_path(name):
        path = files.shipped_file(name, SHIPPED, "plan")
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        if path.parent == Path() and files.is_file(SHIPPED / path):
            return load_plan(path.stem)
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: is not UTF-8 text (byte {error.start})") from error
    plan = from_toml(text, str(path))
    if plan.limits.endswith(".toml"):  # to be found again from any folder
        plan = dataclasses.replace(plan, limits=str(Path(plan.limits).absolute()))
    return plan


def shipped_names() -> list[str]:
    """Names of the plans that come with the program."""
    return files.shipped_names(SHIPPED)


def differences(old: Plan, new: Plan) -> list[str]:
    """What differs between two plans, "path: old value -> new value"."""
    rows = [{row.path: row.value for row in settings.table(plan)} for plan in (old, new)]
    return [
        f"{path}: {_shown(rows[0], path)} -> {_shown(rows[1], path)}"
        for path in dict.fromkeys([*rows[0], *rows[1]])
        if rows[0].get(path, ...) != rows[1].get(path, ...)
    ]


def _shown(row: Mapping[str, Any], path: str) -> str:
    return repr(row[path]) if path in row else "(absent)"
