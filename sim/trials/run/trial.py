"""One trial: a pure function of plan, controller and index."""

import errno
import functools
import json
import math
import os
import signal
import threading
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim.errors import UserError
from sim.interface import JOINTS
from sim.loop import Outcome, RunSummary, Tape
from sim.scenario import Scenario
from sim.trials.falls.witness import Witness
from sim.trials.plan import GridStudy, MarginStudy, Plan
from sim.trials.plan.axis import Value, changes, label, scenario_at
from sim.trials.run.result import TrialResult

WARM_UP_PUSH = 60.0  # [N], enough for torques to saturate
LONGEST_MESSAGE = 300  # characters of an exception that a result keeps


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSpec:
    """Which trial.

    Attributes:
        plan: The plan.
        controller: Kind of controller, one of the plan's.
        index: Number of the trial through all studies of the plan.
        logs: Folder for logs the plan asks for; None to keep none.
    """

    plan: Plan
    controller: str
    index: int
    logs: str | None = None


def axis_values(plan: Plan, index: int) -> tuple[str, dict[str, Value], dict[str, Any]]:
    """What a trial tries.

    Args:
        plan: The plan.
        index: Number of the trial.

    Returns:
        Name of the study, values by axis name, changes of the plan's scenario by dotted path.

    Raises:
        UserError: no such trial.
    """
    study, local = plan.study_of(index)
    base = plan.scenario
    if isinstance(study, MarginStudy):
        number, position = study.place(local)
        axis = study.axes[number]
        pairs: list[tuple[Any, Value]] = [(axis, axis.value(position))]
    elif isinstance(study, GridStudy):
        pairs = list(zip(study.axes, study.point(local), strict=True))
    else:
        generator = np.random.default_rng(_sequence(plan, index))
        pairs = list(zip(study.axes, study.draw(generator, base), strict=True))
    merged: dict[str, Any] = {}
    for axis, value in pairs:
        merged |= changes(axis, value, base)
    return study.name, {label(axis): value for axis, value in pairs}, merged


def _sequence(plan: Plan, index: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(plan.seed, spawn_key=(index,))


def trial_seed(plan: Plan, index: int) -> int:
    """Seed of a trial's scenario: the same for every controller, whoever runs it and when."""
    return int(_sequence(plan, index).generate_state(1, np.uint64)[0] >> np.uint64(1))


def trial_scenario(plan: Plan, controller: str, index: int) -> Scenario:
    """The scenario of a trial; `cmpc run` runs it to the same end.

    Raises:
        UserError: no such trial, or its values are not legal.
    """
    if controller not in plan.controllers:
        raise UserError(f"controller {controller!r}: must be one of the plan's, {', '.join(plan.controllers)}")
    _, _, merged = axis_values(plan, index)
    own = {
        "name": f"{plan.name}-{index}",
        "controller.kind": controller,
        "seed": trial_seed(plan, index),
    }
    return scenario_at(plan.scenario, merged | own)


def run_trial(spec: TrialSpec) -> TrialResult:
    """Run one trial. An exception is an outcome, and wall time is bounded.

    Args:
        spec: Which trial of which plan.

    Raises:
        UserError: the disk is full: no fault of the trial, and no result of it.
    """
    plan, index = spec.plan, spec.index
    began = time.perf_counter()
    identity: dict[str, Any] = {"controller": spec.controller, "trial": index, "seed": trial_seed(plan, index)}
    study, values = "", "{}"
    try:
        study, found, _ = axis_values(plan, index)
        values = json.dumps(found)
        scenario = trial_scenario(plan, spec.controller, index)
        _warm_up(scenario.walker, scenario.gait, scenario.controller.kind, scenario.controller.solver)
        began = time.perf_counter()
        witness = Witness(scenario.controller.period)
        summary, log = _run(scenario, spec, began + plan.wall_limit, witness)
        figures = _figures(summary) | _cause(summary, witness)
    except Exception as error:
        if _disk_full(error):
            raise UserError(f"{spec.logs}: the disk is full; free some and give the same command again") from error
        message = " ".join(f"{type(error).__name__}: {error}".split())[:LONGEST_MESSAGE]
        wall = time.perf_counter() - began
        failed: dict[str, Any] = {"outcome": Outcome.ERROR.value, "survived": False, "message": message}
        return TrialResult(**identity, study=study, values=values, wall_s=wall, **failed)
    return TrialResult(**identity, study=study, values=values, wall_s=time.perf_counter() - began, log=log, **figures)


def _disk_full(error: BaseException | None) -> bool:
    """Whether an error, or what caused it, is that of a full disk."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        error = error.__cause__ or error.__context__
    return False


@functools.cache
def _warm_up(walker: str, gait: str, kind: str, solver: str) -> None:
    """One step under a push, once a process, so that compiling the controller is not on a trial's clock."""
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

    def stop() -> str | None:
        return f"gave up after {plan.wall_limit:g} s of wall time" if time.perf_counter() > deadline else None

    always = plan.log_every > 0 and spec.index % plan.log_every == 0
    if spec.logs is None or not (always or plan.logs == "falls"):
        return run_scenario(scenario, stop=stop, belief=belief, tape=tape), ""
    folder = Path(spec.logs)
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{spec.controller}-{spec.index}.mcap"
    growing = folder / f"{name}.{os.getpid()}-{threading.get_ident()}.partial"
    try:
        summary = run_scenario(scenario, stop=stop, log=growing, belief=belief, tape=tape)
        if always or summary.outcome == Outcome.FELL.value:
            os.replace(growing, folder / name)
            return summary, name
        return summary, ""
    finally:
        growing.unlink(missing_ok=True)


def _figures(summary: RunSummary) -> dict[str, Any]:
    """A run's summary as fields of a result; an interrupted run is one that was given up."""
    given_up = summary.outcome == Outcome.INTERRUPTED.value
    peaks, limits = summary.peak_torque_Nm, summary.torque_limit_Nm
    rms = summary.rms_torque_Nm.values()
    figures = {
        "outcome": Outcome.ERROR.value if given_up else summary.outcome,
        "survived": summary.outcome == Outcome.COMPLETED.value,
        "reason": summary.fall_reason,
        "message": summary.message,
        "steps": summary.steps,
        "ticks": summary.ticks,
        "time_s": summary.time_s,
        "speed_m_s": summary.speed_m_s,
        "step_time_s": summary.step_time_s,
        "step_length_m": summary.step_length_m,
        "peak_torque_Nm": max(peaks.values(), default=None),
        "peak_torque_ratio": max((peaks[j] / limit for j, limit in limits.items() if limit > 0.0), default=None),
        "rms_torque_Nm": math.sqrt(sum(value**2 for value in rms) / len(rms)) if rms else None,
        "error_rms_rad": summary.output_error_rms_rad,
        "friction_max": summary.friction_ratio_max,
        "slip_m": summary.slip_m,
        "fallbacks": summary.fallbacks,
        "slack_max_N": summary.slack_max_N,
        "state_digest": summary.state_digest,
        "scuff_depth_m": summary.scuff_depth_m,
        "scuff_time_s": summary.scuff_time_s,
        "solve_median_ms": summary.solve_ms.get("median"),
        "solve_p99_ms": summary.solve_ms.get("p99"),
        "solve_max_ms": summary.solve_ms.get("max"),
        "tick_median_ms": summary.tick_ms.get("median"),
    }
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in figures.items()
    }


def _cause(summary: RunSummary, witness: Witness) -> dict[str, str]:
    """What broke, as fields of a result; nothing for a run that did not fall."""
    if summary.outcome != Outcome.FELL.value:
        return {}
    limits = np.array([summary.torque_limit_Nm.get(joint, math.inf) for joint in JOINTS])
    cause, evidence = witness.verdict(limits)
    return {"cause": cause.value, "evidence": evidence.to_json()}


def work(spec: TrialSpec) -> TrialResult:
    """`run_trial` in a worker process.

    Ctrl-C is for the parent, which then asks no more of its workers; what solvers warn of is counted in the
    results, and would bury the progress.
    """
    warnings.simplefilter("ignore")
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return run_trial(spec)
