"""Running a campaign: trials, workers, results."""
