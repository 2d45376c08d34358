"""What trials cost on this machine: the campaign's share of one, trials a second, what a second worker brings."""

import dataclasses
import time
from collections.abc import Callable
from typing import Any

from sim.bench.figure import Figure
from sim.bench.substeps import four_substeps, in_substeps
from sim.runner import cores
from sim.scenario import Scenario, with_values
from sim.trials.plan import MonteCarloStudy, Plan
from sim.trials.plan.montecarlo import RandomAxis
from sim.trials.run import run_plan
from sim.trials.run.campaign import Progress
from sim.trials.run.trial import TrialSpec, run_trial

STEPS = 5
TRIES = 7  # trials of which the fastest counts
PLANTS: dict[str, dict[str, Any]] = {
    "rigid": {"plant.kind": "rigid", "plant.timestep": 1e-3},
    "mujoco": {"plant.kind": "mujoco"},
}
TARGETS = {"c-mpc": ">= 6", "zd-pd": ">= 20"}
"""Trials a second asked for on two cores."""

Say = Callable[[str], None]


def benchmark(controllers: tuple[str, ...], trials: int, say: Say) -> list[Figure]:
    """Measure each controller on walks of five steps that it survives.

    Args:
        controllers: Kinds of controller.
        trials: Trials for each measurement; those that warm the workers up are not counted.
        say: Told what is measured next.
    """
    workers = min(2, cores())
    figures = []
    for kind in controllers:
        say(f"{kind}: CPU time of a ten-step trial on each plant")
        figures += [cpu_of_a_trial(kind, plant) for plant in PLANTS]
        say(f"{kind}: {trials} trials in this process, {trials} in {workers} others")
        plan = _plan(kind, trials)
        one, cpu = _rate(plan, 1)
        figures += [
            Figure(name=f"{kind}, CPU time of the campaign's process a trial", value=cpu, unit="s"),
            Figure(name=f"{kind}, 1 worker", value=one, unit="trials/s"),
        ]
        if workers > 1:
            both, _ = _rate(plan, workers)
            target = TARGETS.get(kind, "")
            figures += [
                Figure(name=f"{kind}, {workers} workers", value=both, unit="trials/s", target=target),
                Figure(name=f"{kind}, efficiency of {workers} workers", value=both / (workers * one), unit="x",
                       target=">= 0.95"),
            ]  # fmt: skip
    return in_substeps(figures, four_substeps())


def cpu_of_a_trial(kind: str, plant: str) -> Figure:
    """CPU time of one trial in this process, the least of some: plant built, ten steps, what became of it.

    Args:
        kind: Of the controller.
        plant: Its kind.
    """
    plan = _plan(kind, TRIES + 1)
    plan = dataclasses.replace(plan, scenario=with_values(plan.scenario, {"steps": 10, **PLANTS[plant]}))
    times = []
    for index in range(TRIES + 1):
        began = time.process_time()
        run_trial(TrialSpec(plan=plan, controller=kind, index=index))
        times.append(time.process_time() - began)
    return Figure(name=f"{kind}, CPU time of a ten-step trial, {plant} plant", value=min(times[1:]), unit="s")


def _plan(kind: str, trials: int) -> Plan:
    """Small errors of the torso's mass: each trial builds a plant of its own and walks to the end."""
    axis = RandomAxis(paths=("plant.mass_factor.torso",), distribution="uniform", low=0.95, high=1.05)
    study = MonteCarloStudy(trials=trials, axes=(axis,))
    return Plan(controllers=(kind,), scenario=dataclasses.replace(Scenario(), steps=STEPS), montecarlo=(study,))


def _rate(plan: Plan, workers: int) -> tuple[float, float]:
    """Trials a second once all workers are warm, and CPU time of this process for each in [s]."""
    seen: list[tuple[float, float]] = []

    def look(progress: Progress) -> None:
        seen.append((time.perf_counter(), time.process_time()))

    run_plan(plan, workers=workers, report=look)
    (wall_0, cpu_0), (wall_1, cpu_1) = seen[workers - 1], seen[-1]
    counted = len(seen) - workers
    return counted / (wall_1 - wall_0), (cpu_1 - cpu_0) / counted
