"""What the controller expected over its horizon, for the page: every series of every message in one block."""

from typing import Any

import numpy as np

from sim.log.format.fields import OUTPUTS, PREDICTION
from sim.log.read.frames import Run
from sim.log.read.log import time_ns
from sim.pages.packing import packed

MOST = 6_000  # messages
LONGEST = 200  # stages
BITS = 9  # dotted lines that are looked at, not read
SERIES = (*(("y", name) for name in OUTPUTS), ("contact_force", "normal"), ("contact_force", "tangential"))


def horizon(run: Run) -> dict[str, Any] | None:
    """Predictions as rows, series by series and stage by stage; None where a log has none.

    Args:
        run: A log, perhaps damaged.
    """
    if not run.log.is_own(PREDICTION.topic):
        return None
    times: list[float] = []
    series: list[list[Any]] = [[] for _ in SERIES]
    period = 0.0
    for record, message in run.log.decoded(PREDICTION.topic):
        parts = [getattr(getattr(message, group), name)[:LONGEST] for group, name in SERIES]
        if not parts[0]:
            continue
        times.append(time_ns(record) * 1e-9)
        period = period or float(message.period)
        for values, part in zip(series, parts, strict=True):
            values.append(part)
    if not times:
        return None
    stages = max(len(part) for part in series[0])
    keep = slice(None, None, max(1, -(-len(times) // MOST)))
    cube = np.full((len(SERIES), len(times), stages), np.nan)
    for row, values in enumerate(series):
        for at, part in enumerate(values):
            cube[row, at, : min(stages, len(part))] = part[:stages]
    with np.errstate(over="ignore"):
        cube = np.where(np.abs(cube) < 1e30, cube, np.nan)
    rows = cube[:, keep].transpose(0, 2, 1).reshape(len(SERIES) * stages, -1)
    return {
        "t": packed(np.array(times)[keep], bits=22),
        "series": [name for _, name in SERIES],
        "stages": stages,
        "period": period,
        "numbers": packed(rows, bits=BITS),
    }
