"""The unit in which costs compare between machines: four bare physics steps, one control period, called from Python."""

import time
from collections.abc import Iterable
from dataclasses import replace

import mujoco

from sim.bench.figure import Figure
from sim.bridge.run import build_plant, load_belief, start_state
from sim.scenario import load

STEPS = 1200  # of each try, 0.3 s of an undisturbed start
TRIES = 5
PER_TICK = 4
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}


def four_substeps() -> float:
    """Four calls of `mujoco.mj_step` on the walker at its start in [s], the best of some tries."""
    scenario = load("undisturbed")
    plant = build_plant(scenario)
    q, dq = start_state(scenario, load_belief(scenario))
    best = float("inf")
    for _ in range(TRIES):
        plant.reset(q, dq, "left")
        model, data, step = plant.model, plant.data, mujoco.mj_step
        began = time.perf_counter()
        for _ in range(STEPS):
            step(model, data)
        best = min(best, (time.perf_counter() - began) / STEPS)
    return PER_TICK * best


def in_substeps(figures: Iterable[Figure], four: float) -> list[Figure]:
    """The figures with every time also as a multiple of four bare substeps, which take `four` in [s]."""
    return [replace(f, multiple=f.value * SECONDS[f.unit] / four) if f.unit in SECONDS else f for f in figures]
