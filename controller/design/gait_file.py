"""A gait as the text of a file that `controller.belief.gait.load_gait` reads."""

from controller.belief import Gait, WalkerModel
from controller.common.records import Vector
from controller.common.toml import comment, quoted
from controller.design.orbit import Orbit


def to_toml(model: WalkerModel, gait: Gait, orbit: Orbit, remarks: tuple[str, ...] = ()) -> str:
    """A gait as TOML text with every digit, so that reading gives the same gait.

    Args:
        model: The walker it is for; its fingerprint goes along.
        gait: The gait, rates before impact included.
        orbit: Its periodic orbit: speed and the like for the reader.
        remarks: Comment lines for the top.
    """
    rows = ",\n".join(f"  {_numbers(row)}" for row in gait.alpha)
    lines = [
        *map(comment, remarks),
        "# Units: rad, rad/s, m, s. q = (stance hip, swing hip, stance knee, swing knee, torso).",
        f"name = {quoted(gait.name)}",
        f"walker = {quoted(model.path.stem)}",
        f"fingerprint = {quoted(model.fingerprint)}  # of the links it was made for",
        f"source = {quoted(gait.source)}",
        "",
        f"degree = {gait.alpha.shape[1] - 1}",
        f"clock = {_numbers(gait.clock)}",
        f"q_minus = {_numbers(gait.q_minus)}",
        f"dq_minus = {_numbers(gait.dq_minus)}",
        "alpha = [",
        rows + ",",
        "]",
        "",
        "periodicity_tolerance_rad = 1e-8",
        "periodicity_tolerance_rad_s = 1e-7",
        "",
        "# What follows is told of the gait, not read from it.",
        "[orbit]",
        f"step_length = {orbit.step_length:.9g}  # [m]",
        f"step_time = {orbit.step_time:.9g}  # [s]",
        f"speed = {orbit.speed:.9g}  # [m/s]",
        f"eigenvalue = {orbit.delta**2:.6g}  # delta^2 of the restricted Poincare map",
        f"cost = {orbit.cost:.6g}  # integral of squared torque by step length [N^2 m s]",
        f"work = {orbit.work:.6g}  # integral of |torque times rate| by step length [J/m]",
        f"peak_torque = [{', '.join(f'{u:.4g}' for u in abs(orbit.u).max(axis=0))}]  # [N.m]",
    ]
    return "\n".join(lines) + "\n"


def _numbers(values: Vector) -> str:
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"
