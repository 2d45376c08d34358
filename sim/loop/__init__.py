"""Look, decide, hold, judge: one run from its start to its outcome."""
