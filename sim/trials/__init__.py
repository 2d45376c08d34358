"""Many runs: grids, margins and Monte-Carlo studies, resumable, on all cores or a cluster."""

from sim.trials.plan.plan import Plan, load_plan
from sim.trials.run.campaign import run_plan
from sim.trials.run.result import TrialResult
from sim.trials.run.trial import TrialSpec, run_trial

__all__ = ["Plan", "TrialResult", "TrialSpec", "load_plan", "run_plan", "run_trial"]
