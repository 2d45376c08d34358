"""An MJCF read and compiled by MuJoCo, what it complains of in one line."""

import warnings
from pathlib import Path

import mujoco

from sim.errors import UserError


def read_spec(path: Path, name: str) -> mujoco.MjSpec:
    """An MJCF as it is.

    Args:
        path: The file.
        name: What an error calls it.

    Raises:
        UserError: not an MJCF.
    """
    mujoco.set_mju_user_warning(_unsaid)
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise UserError(f"{name}: {_in_one_line(error)}") from error


def compile_spec(spec: mujoco.MjSpec, name: str) -> mujoco.MjModel:
    """MuJoCo's model of it.

    Args:
        spec: What was read, maybe changed.
        name: What an error calls it.

    Raises:
        UserError: MuJoCo cannot compile it.
    """
    try:
        with warnings.catch_warnings(action="ignore"):  # what it warns of, a run or a proof of the walker shows
            return spec.compile()
    except ValueError as error:
        raise UserError(f"{name}: {_in_one_line(error)}") from error


def _unsaid(message: str) -> None:
    """MuJoCo's warnings while it reads: what matters of them is an error, and said as one."""


def _in_one_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return "; ".join(lines[:2]) if lines else "unreadable"
