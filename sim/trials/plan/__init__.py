"""What a campaign tries: axes, grids, margins, draws."""

from sim.trials.plan.grid import GridStudy
from sim.trials.plan.margin import MarginStudy
from sim.trials.plan.montecarlo import MonteCarloStudy
from sim.trials.plan.plan import Plan, load_plan
from sim.trials.plan.reliability import AdaptiveStudy, CertificateStudy, ReliabilityStudy

__all__ = [
    "AdaptiveStudy",
    "CertificateStudy",
    "GridStudy",
    "MarginStudy",
    "MonteCarloStudy",
    "Plan",
    "ReliabilityStudy",
    "load_plan",
]
