"""What a tick, a solve, a run and a trial cost."""
