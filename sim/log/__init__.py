"""The MCAP log of a run."""
