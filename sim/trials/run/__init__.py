"""Running a campaign: trials, workers, results."""

from sim.trials.run.campaign import Results, run_plan
from sim.trials.run.result import TrialResult
from sim.trials.run.trial import TrialSpec, run_trial

__all__ = [
    "Results",
    "TrialResult",
    "TrialSpec",
    "run_plan",
    "run_trial",
]
