"""One trial: a pure function of plan, controller and index."""

import dataclasses
import errno
import functools
import json
import math
import os
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controller.common import outside
from controller.common.settings import BUILT_IN
from sim.errors import UserError
from sim.interface import JOINTS
from sim.loop import Outcome, Patient, RunSummary, Tape
from sim.plant import Energy
from sim.scenario import Scenario
from sim.trials.falls.witness import Witness
from sim.trials.plan import CertificateStudy, GridStudy, MarginStudy, Plan, ReliabilityStudy
from sim.trials.plan.axis import Value, changes, label, scenario_at
from sim.trials.run.result import ERROR, LEAST_SPEED, TrialResult, figures_of

WARM_UP_PUSH = 60.0  # [N], enough for torques to saturate
LONGEST_MESSAGE = 300  # characters of an exception that a result keeps


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """What a trial of a study that asks as it learns tries; for all others it follows from the index.

    Attributes:
        values: Of the study's axes, in their order.
        seed: Of the scenario.
    """

    values: tuple[Value, ...]
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSpec:
    """Which trial.

    Attributes:
        plan: The plan.
        controller: Kind of controller, one of the plan's.
        index: Number of the trial through all studies of the plan.
        logs: Folder for logs the plan asks for; None to keep none.
        point: Of a trial of a study that asks as it learns.
    """

    plan: Plan
    controller: str
    index: int
    logs: str | None = None
    point: Point | None = None


def axis_values(plan: Plan, index: int, point: Point | None = None) -> tuple[str, dict[str, Value], dict[str, Any]]:
    """What a trial tries.

    Args:
        plan: The plan.
        index: Number of the trial.
        point: Of a trial of a study that asks as it learns.

    Returns:
        Name of the study, values by axis name, changes of the plan's scenario by dotted path.

    Raises:
        UserError: no such trial.
    """
    study, local = plan.study_of(index)
    base = plan.scenario
    merged: dict[str, Any] = {}
    if isinstance(study, MarginStudy):
        number, position = study.place(local)
        axis = study.axes[number]
        pairs: list[tuple[Any, Value]] = [(axis, axis.value(position))]
        merged |= _nudged(plan, study, index, study.draw(local))
    elif isinstance(study, GridStudy):
        pairs = list(zip(study.axes, study.point(local), strict=True))
    elif isinstance(study, ReliabilityStudy | CertificateStudy):
        if point is None:
            raise UserError(f"trial index {index}: study {study.name!r} has not asked for it yet")
        pairs = list(zip(study.axes, point.values, strict=True))
    else:
        pairs = list(zip(study.axes, study.draw(plan.seed, local, base), strict=True))
    for axis, value in pairs:
        merged |= changes(axis, value, base)
    return study.name, {label(axis): value for axis, value in pairs}, merged


def _nudged(plan: Plan, study: MarginStudy, index: int, draw: int) -> dict[str, Any]:
    """Changes of the start of a draw of a margin study, none for the first."""
    if draw == 0:
        return {}
    offsets = np.random.default_rng(_sequence(plan, index)).normal(0.0, study.blur, 5)  # [rad]
    return {"start.q_offset": tuple((np.array(plan.scenario.start.q_offset) + offsets).tolist())}


def _sequence(plan: Plan, index: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(plan.seed, spawn_key=(index,))


def trial_seed(plan: Plan, index: int) -> int:
    """Seed of a trial's scenario: the same for every controller, whoever runs it and when."""
    return int(_sequence(plan, index).generate_state(1, np.uint64)[0] >> np.uint64(1))


def trial_scenario(plan: Plan, controller: str, index: int, point: Point | None = None) -> Scenario:
    """The scenario of a trial; `cmpc run` runs it to the same end.

    Raises:
        UserError: no such trial, or its values are not legal.
    """
    if controller not in plan.controllers:
        raise UserError(f"controller {controller!r}: must be one of the plan's, {', '.join(plan.controllers)}")
    _, _, merged = axis_values(plan, index, point)
    own = {
        "name": f"{plan.name}-{index}",
        "controller.kind": controller,
        "seed": trial_seed(plan, index) if point is None else point.seed,
    }
    if plan.scenario.controller.kind in BUILT_IN:
        return scenario_at(plan.scenario, merged | own)
    return scenario_at(scenario_at(plan.scenario, merged), own)  # settings that this controller has not stay behind


def run_trial(spec: TrialSpec) -> TrialResult:
    """Run one trial. An exception is an outcome, and wall time is bounded.

    Args:
        spec: Which trial of which plan.

    Raises:
        UserError: the disk is full: no fault of the trial, and no result of it.
    """
    plan, began = spec.plan, time.perf_counter()
    try:
        scenario = trial_scenario(plan, spec.controller, spec.index, spec.point)
        warm_up(spec)
        began = time.perf_counter()
        witness = Witness(scenario.controller.period)
        summary, log = _run(scenario, spec, began + plan.wall_limit, witness)
        found = figures_of(summary) | _cause(summary, witness) | {"log": log}
        found["fading"] = bool(found["survived"]) and fading(witness, scenario)
    except Exception as error:
        if _disk_full(error):
            raise UserError(f"{spec.logs}: the disk is full; free some and give the same command again") from error
        failed = result_without_run(spec, ERROR, f"{type(error).__name__}: {error}")
        return dataclasses.replace(failed, wall_s=time.perf_counter() - began, log=_kept_log(spec))
    return TrialResult(**_identity(spec), **found, wall_s=time.perf_counter() - began)


def fading(witness: Witness, scenario: Scenario) -> bool:
    """Whether the walk of a scenario loses energy step by step, by its plant's own model."""
    from sim.bridge.run import plant_model

    return witness.fading(Energy(plant_model(scenario)))


def result_without_run(spec: TrialSpec, outcome: str, message: str) -> TrialResult:
    """Result of a trial that came to no end.

    Args:
        spec: Which trial.
        outcome: `ERROR` or `GAVE_UP`.
        message: What went wrong.
    """
    words = " ".join(message.split())[:LONGEST_MESSAGE]
    return TrialResult(**_identity(spec), outcome=outcome, survived=False, message=words)


def _identity(spec: TrialSpec) -> dict[str, Any]:
    study, values, _ = axis_values(spec.plan, spec.index, spec.point)
    return {
        "controller": spec.controller,
        "trial": spec.index,
        "study": study,
        "values": json.dumps(values),
        "seed": trial_seed(spec.plan, spec.index) if spec.point is None else spec.point.seed,
    }


def _disk_full(error: BaseException | None) -> bool:
    """Whether an error, or what caused it, is that of a full disk."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        error = error.__cause__ or error.__context__
    return False


def warm_up(spec: TrialSpec) -> None:
    """Compile and load what a trial needs, once a process, so that it is not on the trial's clock."""
    compile_for(*what_to_compile(spec.plan.scenario, spec.controller))


def what_to_compile(scenario: Scenario, controller: str) -> tuple[str, str, str, str]:
    """Arguments of `compile_for`; for a controller from outside, which may count its ticks, what is around it."""
    if controller in BUILT_IN:
        return scenario.walker, scenario.gait, controller, scenario.controller.solver
    return scenario.walker, scenario.gait, "zd-pd", Scenario().controller.solver


@functools.cache
def compile_for(walker: str, gait: str, kind: str, solver: str) -> None:
    """Walk one step under a push."""
    from sim.bridge.run import known_belief, run_scenario

    changes = {"walker": walker, "gait": gait, "controller.kind": kind, "controller.solver": solver, "steps": 1}
    push = {"pushes.0.force": WARM_UP_PUSH, "pushes.0.step": 1}
    run_scenario(scenario_at(Scenario(), changes | push), belief=known_belief(walker, gait))


def _run(scenario: Scenario, spec: TrialSpec, deadline: float, tape: Tape) -> tuple[RunSummary, str]:
    """Run the scenario; keep its log if the plan asks for it.

    A log grows under a name of its own and gets its final one when it is complete, so that a killed campaign
    leaves no half log under a name that counts.
    """
    from sim.bridge.run import known_belief, run_scenario

    plan = spec.plan
    belief = known_belief(scenario.walker, scenario.gait)

    @Patient
    def stop() -> str | None:
        return f"gave up after {plan.wall_limit:g} s of wall time" if time.perf_counter() > deadline else None

    always = plan.log_every > 0 and spec.index % plan.log_every == 0
    if spec.logs is None or not (always or plan.logs == "falls"):
        return run_scenario(scenario, stop=stop, belief=belief, tape=tape), ""
    folder = Path(spec.logs)
    folder.mkdir(parents=True, exist_ok=True)
    growing = folder / f"{_log_name(spec)}.{os.getpid()}-{threading.get_ident()}.partial"
    try:
        summary = run_scenario(scenario, stop=stop, log=growing, belief=belief, tape=tape)
        if not always and summary.outcome == Outcome.COMPLETED.value:
            return summary, ""
        os.replace(growing, folder / _log_name(spec))
        return summary, _log_name(spec)
    except Exception as error:
        if growing.is_file() and not _disk_full(error):
            os.replace(growing, folder / _log_name(spec))
        raise
    finally:
        growing.unlink(missing_ok=True)


def _log_name(spec: TrialSpec) -> str:
    return f"{outside.file_label(spec.controller)}-{spec.index}.mcap"


def _kept_log(spec: TrialSpec) -> str:
    """Name of the log of a trial that raised, empty if it left none."""
    return _log_name(spec) if spec.logs and (Path(spec.logs) / _log_name(spec)).is_file() else ""


def _cause(summary: RunSummary, witness: Witness) -> dict[str, str]:
    """How near it came to a stop, and what broke if it fell, as fields of a result."""
    near = {LEAST_SPEED: float(f"{witness.least_speed:.4g}")} if math.isfinite(witness.least_speed) else {}
    if summary.outcome != Outcome.FELL.value:
        return {"evidence": json.dumps(near)}
    limits = np.array([summary.torque_limit_Nm.get(joint, math.inf) for joint in JOINTS])
    cause, evidence = witness.verdict(limits)
    return {"cause": cause.value, "evidence": json.dumps(json.loads(evidence.to_json()) | near)}
