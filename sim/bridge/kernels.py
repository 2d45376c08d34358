"""Where the controller's compiled kernels lie, and whether they are there."""

from pathlib import Path

from controller.cmpc.prediction import roll_out
from controller.common.compiled import on_disk


def kernels() -> tuple[Path, bool]:
    """The folder that kernels are kept in, and whether those of C-MPC need no compiling."""
    return Path(roll_out.stats.cache_path).parent, on_disk(roll_out)
