"""Where the reviews of a campaign's trials are, once `cmpc review DIR` has made them, within its folder."""

from pathlib import PurePosixPath

from controller.common.outside import file_label
from sim.trials.run import TrialResult

REVIEWS = "reviews"
"""Folder of the trials that were run again: their logs, pages and films."""


def review_of(row: TrialResult) -> str:
    """The page of a trial."""
    return f"{REVIEWS}/{file_label(row.controller)}-{row.trial}.html"


def log_of(row: TrialResult) -> str:
    """The log of a trial."""
    return str(PurePosixPath(review_of(row)).with_suffix(".mcap"))


def beside_of(survivor: TrialResult, fall: TrialResult, suffix: str = ".html") -> str:
    """The page of a survivor beside a fall, or with another suffix their film."""
    name = f"{PurePosixPath(review_of(survivor)).stem}-beside-{PurePosixPath(review_of(fall)).stem}"
    return f"{REVIEWS}/{name}{suffix}"
