"""What a campaign tries: axes, grids, margins, draws."""

from sim.trials.plan.grid import GridStudy
from sim.trials.plan.margin import MarginStudy
from sim.trials.plan.montecarlo import MonteCarloStudy
from sim.trials.plan.plan import Plan, load_plan

__all__ = [
    "GridStudy",
    "MarginStudy",
    "MonteCarloStudy",
    "Plan",
    "load_plan",
]
