"""A picture of a gait: postures, joint angles, torques, phase portrait, forces, swing foot."""

from pathlib import Path
from typing import Any

import numpy as np

from controller.belief import Gait, WalkerModel
from controller.common.errors import UserError
from controller.common.records import (
    NORMAL,
    ROLES,
    STANCE_HIP,
    STANCE_KNEE,
    SWING_HIP,
    SWING_KNEE,
    TANGENTIAL,
    TORSO,
    Vector,
    swap_legs,
)
from controller.design.orbit import Orbit

COLOURS = ("#2176b5", "#e66b19", "#7fb2d9", "#f2ab7a")
POSTURES = 6
FLOOR = "#888888"


def plot(path: Path, model: WalkerModel, gait: Gait, orbit: Orbit) -> None:
    """Write the picture.

    Args:
        path: File to write; its ending says the format.
        model: The walker.
        gait: The gait.
        orbit: Its periodic orbit.

    Raises:
        UserError: matplotlib is missing, or the file cannot be written.
    """
    figure, axes = panels(path)
    figure.suptitle(
        f"{gait.name}: {orbit.step_length:.3f} m in {orbit.step_time:.3f} s, {orbit.speed:.2f} m/s, "
        f"delta² = {orbit.delta**2:.3f}, cost {orbit.cost:.0f} N² m s"
    )
    _postures(axes[0, 0], model, orbit)
    for i, (name, colour) in enumerate(zip(ROLES, COLOURS, strict=True)):
        axes[0, 1].plot(orbit.t, orbit.q[:, i] - (np.pi if i < 2 else 0.0), color=colour, label=name)
        axes[0, 2].plot(orbit.t, orbit.u[:, i], color=colour, label=name)
        _cycle(axes[1, 0], orbit, i, colour)
    axes[0, 1].plot(orbit.t, orbit.q[:, TORSO], color="black", label="torso")
    _cycle(axes[1, 0], orbit, TORSO, "black")
    label(axes[0, 1], "joint angles", "time [s]", "angle, hips less pi [rad]")
    label(axes[0, 2], "torques", "time [s]", "torque [N.m]")
    label(axes[1, 0], "phase portrait (dotted: impact)", "angle, hips less pi [rad]", "rate [rad/s]")
    axes[1, 1].plot(orbit.t, orbit.force[:, NORMAL], color="black", label="normal")
    axes[1, 1].plot(orbit.t, orbit.force[:, TANGENTIAL], color=COLOURS[1], label="tangential")
    label(axes[1, 1], "stance force", "time [s]", "force [N]")
    axes[1, 2].plot(orbit.foot[:, 0], orbit.foot[:, 1] * 1e3, color="black")
    axes[1, 2].axhline(0.0, color=FLOOR)
    label(axes[1, 2], "swing foot", "x from the stance foot [m]", "height [mm]")
    for axis in (axes[0, 1], axes[1, 1]):
        axis.legend(fontsize=8)
    save(path, figure)


def panels(path: Path) -> tuple[Any, Any]:
    """A figure of 2 x 3 panels, and its axes.

    Raises:
        UserError: matplotlib is missing; the message names the file that was wanted.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise UserError(
            f"{path}: a plot needs matplotlib; install it with pip install 'cmpc-walker[design]'"
        ) from error
    figure = Figure(figsize=(13, 7.5), layout="constrained")
    return figure, figure.subplots(2, 3)


def save(path: Path, figure: Any) -> None:
    """Write a figure; the file's ending says the format.

    Raises:
        UserError: it cannot be written.
    """
    try:
        figure.savefig(path, dpi=110)
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be written: {error}") from error


def _postures(axis: Any, model: WalkerModel, orbit: Orbit) -> None:
    for k, t in enumerate(np.linspace(0.0, orbit.step_time, POSTURES)):
        q = np.array([np.interp(t, orbit.t, orbit.q[:, i]) for i in range(5)])
        stance, swing, torso = links(model, q)
        alpha = 0.35 + 0.65 * k / (POSTURES - 1)
        for points, colour in ((stance, COLOURS[0]), (swing, COLOURS[1]), (torso, "#404752")):
            axis.plot(*points.T, color=colour, alpha=alpha, linewidth=2)
    axis.axhline(0.0, color=FLOOR)
    axis.set_aspect("equal")
    label(axis, "postures (stance blue, swing orange)", "x [m]", "z [m]")


def links(model: WalkerModel, q: Vector) -> tuple[Vector, Vector, Vector]:
    """Points (x, z) of stance leg, swing leg and torso in [m], stance foot at the origin."""

    def along(length: float, phi: float) -> Vector:
        return length * np.array([-np.sin(phi), np.cos(phi)])

    def leg(hip: int, knee: int) -> tuple[Vector, Vector]:
        thigh = along(model.femur.length, q[TORSO] + q[hip])
        return thigh, thigh + along(model.tibia.length, q[TORSO] + q[hip] + q[knee])

    stance_knee, stance_foot = leg(STANCE_HIP, STANCE_KNEE)
    swing_knee, swing_foot = leg(SWING_HIP, SWING_KNEE)
    hip = -stance_foot
    top = along(2.0 * model.torso.com, q[TORSO])
    return (
        np.array([hip, hip + stance_knee, hip + stance_foot]),
        np.array([hip, hip + swing_knee, hip + swing_foot]),
        np.array([hip, hip + top]),
    )


def _cycle(axis: Any, orbit: Orbit, i: int, colour: str) -> None:
    """One coordinate over a step, then dotted to where the impact and the exchange of legs leave it; hips from pi."""
    other = int(swap_legs(np.arange(5.0))[i])
    shift = np.pi if i in (STANCE_HIP, SWING_HIP) else 0.0
    axis.plot(orbit.q[:, i] - shift, orbit.dq[:, i], color=colour)
    angle = [orbit.q[-1, i] - shift, orbit.q[0, other] - shift]
    axis.plot(angle, [orbit.dq[-1, i], orbit.dq[0, other]], color=colour, linestyle=":")


def label(axis: Any, title: str, x: str, y: str) -> None:
    """Title and axes of a panel."""
    axis.set_title(title, fontsize=10)
    axis.set_xlabel(x)
    axis.set_ylabel(y)
    axis.grid(alpha=0.3)
