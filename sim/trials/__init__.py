"""Many runs: grids, margins and Monte-Carlo studies, resumable, on all cores or a cluster."""

from sim.trials.plan import Plan, load_plan
from sim.trials.run import TrialResult, TrialSpec, run_plan, run_trial

__all__ = ["Plan", "TrialResult", "TrialSpec", "load_plan", "run_plan", "run_trial"]
