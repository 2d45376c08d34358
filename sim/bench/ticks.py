"""The benchmark: what a tick, a solve and a run cost on this machine, and how exact they are."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from controller.common.settings import BUILT_IN
from sim.bench.figure import Figure
from sim.bench.outside import outside_path
from sim.bench.processes import memory, start_up
from sim.bench.substeps import four_substeps, in_substeps
from sim.bridge.run import ComparingSolver, compare_solvers, exact_clarabel, make_solver, run_scenario
from sim.errors import UserError
from sim.log.format.fields import STATUSES
from sim.loop import NoTape, Ticks
from sim.scenario import Scenario, load, with_values

RUNS = ("undisturbed", "push-25N", "friction-50N", "payload-x2")
"""The four runs that ticks are measured over."""

HORIZONS = (50, 100, 200, 500)  # [stages]
TABLE_SOLVERS = ("riccati", "piqp", "clarabel")
Say = Callable[[str], None]


class TickTimes(NoTape):
    """Keeps the wall time and the status of every tick."""

    def __init__(self) -> None:
        """Start empty."""
        self.seconds: list[float] = []
        self.statuses: dict[str, int] = dict.fromkeys(STATUSES, 0)

    def ticks(self, ticks: Ticks) -> None:
        """Keep them."""
        self.seconds += ticks.tick_s.tolist()
        for code, count in zip(*np.unique(ticks.step["status"], return_counts=True), strict=True):
            self.statuses[STATUSES[code]] += int(count)


def benchmark(*, quick: bool, say: Say) -> list[Figure]:
    """Measure everything.

    Args:
        quick: Shorter runs, for a look; the figures are noisier.
        say: Told what is measured next.
    """
    steps = 3 if quick else 8
    figures: list[Figure] = []
    for part in (
        loop_ticks,
        ticks,
        paired,
        against_clarabel,
        horizons,
        ltv_ticks,
        plan_ticks,
        rival_ticks,
        outside_path,
        real_time,
        start_up,
        memory,
    ):
        say(part.__doc__.splitlines()[0] if part.__doc__ else part.__name__)
        figures += in_substeps(part(steps), four_substeps())
    return figures


def _walk(name: str, steps: int, **changes: Any) -> Scenario:
    return with_values(load(name), {"steps": steps, **changes})


def loop_ticks(steps: int) -> list[Figure]:
    """Ticks of whole runs without a log, plant, law and judge, over four bare substeps."""
    figures = []
    for kind, target in (("c-mpc", "<= 4.0"), ("zd-pd", "<= 1.5")):
        scenario = _walk("undisturbed", 2 * steps, **{"controller.kind": kind})
        ratios = []
        for _ in range(3):
            four = four_substeps()
            run = run_scenario(scenario)
            ratios.append(run.time_s / run.realtime_factor / run.ticks / four)
        name = f"{kind}, tick of a run without log over four bare substeps"
        figures.append(Figure(name=name, value=min(ratios), unit="x", target=target))
    return [Figure(name="four bare substeps", value=1e3 * four_substeps(), unit="ms"), *figures]


def ticks(steps: int) -> list[Figure]:
    """Ticks of C-MPC, observation in to torque out, over the four runs."""
    tape = TickTimes()
    for name in RUNS:
        run_scenario(_walk(name, steps), tape=tape)
    ms = 1e3 * np.array(tape.seconds)
    median, p99, p999 = np.quantile(ms, [0.5, 0.99, 0.999])
    rescued = sum(count for status, count in tape.statuses.items() if status != "optimal")
    return [
        Figure(name="tick, median", value=float(median), unit="ms", target="<= 0.15"),
        Figure(name="tick, 99 %", value=float(p99), unit="ms", target="<= 0.35"),
        Figure(name="tick, 99.9 %", value=float(p999), unit="ms", target="<= 0.60"),
        Figure(name="ticks", value=float(len(ms)), unit=""),
        Figure(name="solver fall-backs", value=float(rescued), unit="", target="<= 0"),
    ]


def ltv_ticks(steps: int) -> list[Figure]:
    """Ticks of c-mpc-ltv over the same runs."""
    median, _, p999 = _tick_quantiles("c-mpc-ltv", steps)
    return [
        Figure(name="tick of c-mpc-ltv, median", value=median, unit="ms", target="<= 0.5"),
        Figure(name="tick of c-mpc-ltv, 99.9 %", value=p999, unit="ms", target="<= 1.0"),
    ]


class PlanTimes(NoTape):
    """Keeps the wall time of every tick, and whether it made a plan."""

    def __init__(self) -> None:
        """Start empty."""
        self.seconds: list[float] = []
        self.made: list[bool] = []

    def ticks(self, ticks: Ticks) -> None:
        """Keep them."""
        self.seconds += ticks.tick_s.tolist()
        self.made += [ticks.diagnostics[k]["plan made"] > 0.0 for k in range(ticks.first, ticks.first + len(ticks))]


def plan_ticks(steps: int) -> list[Figure]:
    """Ticks of c-mpc-plan under pushes, those that make a plan apart."""
    tape = PlanTimes()
    for force in (-40.0, 60.0):
        run_scenario(_walk("push-40N-first", steps, **{
            "controller.kind": "c-mpc-plan", "plant.ground.friction": 0.8, "pushes.0.force": force,
        }), tape=tape)  # fmt: skip
    ms, made = 1e3 * np.array(tape.seconds), np.array(tape.made)
    return [
        Figure(name="tick of c-mpc-plan, median", value=float(np.median(ms[~made])), unit="ms", target="<= 0.5"),
        Figure(name="tick of c-mpc-plan, 99.9 %", value=float(np.quantile(ms[~made], 0.999)), unit="ms",
               target="<= 1.0"),
        Figure(name="tick of c-mpc-plan that plans, median", value=float(np.median(ms[made])), unit="ms",
               target="<= 5"),
        Figure(name="tick of c-mpc-plan that plans, 99 %", value=float(np.quantile(ms[made], 0.99)), unit="ms"),
    ]  # fmt: skip


def rival_ticks(steps: int) -> list[Figure]:
    """Ticks of the rivals over the same runs."""
    figures = []
    for kind in ("clf-qp", "output-mpc"):
        median, p99, _ = _tick_quantiles(kind, steps)
        figures += [
            Figure(name=f"tick of {kind}, median", value=median, unit="ms"),
            Figure(name=f"tick of {kind}, 99 %", value=p99, unit="ms"),
        ]
    return figures


def ticks_of(kind: str, *, quick: bool) -> list[Figure]:
    """Ticks of one controller over the four runs; of one from outside also what the way to it costs.

    Raises:
        UserError: it broke.
    """
    tape, steps = TickTimes(), 3 if quick else 8
    for name in RUNS:
        summary = run_scenario(_walk(name, steps, **{"controller.kind": kind}), tape=tape)
        if summary.outcome == "error":
            raise UserError(summary.message)
    quantiles = np.quantile(1e3 * np.array(tape.seconds), [0.5, 0.99, 0.999]).tolist()
    names = ("median", "99 %", "99.9 %")
    figures = [Figure(name=f"tick, {name}", value=ms, unit="ms") for name, ms in zip(names, quantiles, strict=True)]
    figures.append(Figure(name="ticks", value=float(len(tape.seconds)), unit=""))
    return figures if kind in BUILT_IN else [*figures, *outside_path(steps)]


def _tick_quantiles(kind: str, steps: int) -> tuple[float, float, float]:
    """Median, 99 % and 99.9 % of a controller's ticks over the four runs in [ms]."""
    tape = TickTimes()
    for name in RUNS:
        run_scenario(_walk(name, steps, **{"controller.kind": kind}), tape=tape)
    median, p99, p999 = np.quantile(1e3 * np.array(tape.seconds), [0.5, 0.99, 0.999])
    return float(median), float(p99), float(p999)


def against_clarabel(steps: int) -> list[Figure]:
    """Answers against Clarabel's at 1e-12, problem by problem."""
    gaps: list[float] = []
    kept = []
    problems = active = 0
    objective = violation = refined = 0.0
    for name in RUNS:
        scenario = _walk(name, max(2, steps * 5 // 8))
        N = scenario.controller.horizon
        both = ComparingSolver(make_solver("riccati", N, 3), exact_clarabel(N))
        run_scenario(scenario, solver=both)
        gaps += both.torque_gaps
        kept += both.kept
        problems, active = problems + both.problems, active + both.active
        refined = max(refined, both.refined_gap)
        objective, violation = max(objective, both.objective_gap), max(violation, both.violation)
    figures = [
        Figure(name="problems compared", value=float(problems), unit="", target=">= 5000"),
        Figure(name="of them with active constraints", value=float(active), unit="", target=">= 1000"),
        Figure(name="first torque from Clarabel's, largest", value=max(gaps), unit="N.m"),
        Figure(name="the same, Clarabel's answer refined on its active set", value=refined, unit="N.m",
               target="<= 1e-3"),
        Figure(name="first torque from Clarabel's, 99 %", value=float(np.quantile(gaps, 0.99)), unit="N.m"),
        Figure(name="objective above Clarabel's, relative", value=objective, unit="", target="<= 1e-6"),
        Figure(name="torque beyond its bound", value=violation, unit="N.m", target="<= 1e-6"),
    ]  # fmt: skip
    for solver, row in compare_solvers(TABLE_SOLVERS, kept).items():
        figures += [
            Figure(name=f"solve, {solver}, median", value=row["median_ms"], unit="ms"),
            Figure(name=f"solve, {solver}, 99 %", value=row["p99_ms"], unit="ms"),
            Figure(name=f"solve, {solver}, first torque from riccati's, largest", value=row["gap_Nm"], unit="N.m"),
            Figure(name=f"solve, {solver}, failed of {len(kept)}", value=row["failed"], unit=""),
        ]
    return figures


def paired(steps: int) -> list[Figure]:
    """The same ticks with Clarabel through qpsolvers and with riccati."""
    ratios: list[float] = []
    for name in RUNS:
        seconds = {}
        for solver in ("riccati", "clarabel"):
            tape = TickTimes()
            run_scenario(_walk(name, max(2, steps // 4), **{"controller.solver": solver}), tape=tape)
            seconds[solver] = np.array(tape.seconds)
        n = min(len(ticks) for ticks in seconds.values())
        ratios += list(seconds["clarabel"][:n] / seconds["riccati"][:n])
    ratio = float(np.median(ratios))
    return [
        Figure(name="tick with clarabel over the same tick with riccati, median", value=ratio, unit="x", target=">= 50")
    ]


def horizons(steps: int) -> list[Figure]:
    """Ticks against the horizon."""
    medians = []
    for N in HORIZONS:
        tape = TickTimes()
        run_scenario(_walk("undisturbed", 1, **{"controller.horizon": N}), tape=tape)
        medians.append(1e3 * float(np.median(tape.seconds)))
    figures = [
        Figure(name=f"tick, N = {N}, median", value=m, unit="ms") for N, m in zip(HORIZONS, medians, strict=True)
    ]
    exponent = float(np.polyfit(np.log(HORIZONS), np.log(medians), 1)[0])
    return [*figures, Figure(name="growth of the tick with N, exponent", value=exponent, unit="", target="<= 1.1")]


def real_time(steps: int) -> list[Figure]:
    """Whole runs with their logs against real time."""
    with tempfile.TemporaryDirectory() as folder:
        figures = []
        for kind, target in (("c-mpc", ">= 6"), ("zd-pd", ">= 20")):
            scenario = _walk("undisturbed", 3 * steps, **{"controller.kind": kind})
            log = Path(folder) / f"{kind}.mcap"
            logged = run_scenario(scenario, log=log).realtime_factor
            figures.append(
                Figure(name=f"{kind} with log, simulated over wall time", value=logged, unit="x", target=target)
            )
        shares = []
        for again in range(3):
            scenario = _walk("undisturbed", steps, **{"controller.kind": "zd-pd"})
            logged = run_scenario(scenario, log=Path(folder) / f"{again}.mcap").realtime_factor
            plain = run_scenario(scenario).realtime_factor
            shares.append(1.0 - logged / plain)
    share = 100.0 * float(np.median(shares))
    return [*figures, Figure(name="recorder's share of a zd-pd run", value=share, unit="%", target="<= 25")]
