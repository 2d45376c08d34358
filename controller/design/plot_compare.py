"""A picture of two gaits: the first dashed, the second drawn through, and what separates them."""

from pathlib import Path
from typing import Any

import numpy as np

from controller.belief import WalkerModel
from controller.common.records import ROLES, TORSO
from controller.design.compare import Comparison
from controller.design.plot import COLOURS, FLOOR, label, links, panels, save

DASHED, THROUGH = "--", "-"
COSTS = ("squared_torque_N2ms", "work_J_m", "friction", "normal_share", "delta2", "speed_m_s")
COST_WORDS = ("squared torque", "work", "friction", "least normal\nforce", "delta²", "speed")


def plot_comparison(path: Path, model: WalkerModel, found: Comparison) -> None:
    """Write the picture.

    Args:
        path: File to write; its ending says the format.
        model: The walker of both.
        found: The two gaits.

    Raises:
        UserError: matplotlib is missing, or the file cannot be written.
    """
    figure, axes = panels(path)
    figure.suptitle(f"{found.second.name} (drawn through) against {found.first.name} (dashed)")
    for orbit, line, shade in zip(found.orbits, (DASHED, THROUGH), (0.5, 1.0), strict=True):
        for k in (0, -1):
            stance, swing, torso = links(model, orbit.q[k])
            for points, colour in ((stance, COLOURS[0]), (swing, COLOURS[1]), (torso, "#404752")):
                axes[0, 0].plot(*points.T, line, color=colour, alpha=shade)
        for i, (role, colour) in enumerate(zip(ROLES, COLOURS, strict=True)):
            name = role if line == THROUGH else None
            axes[0, 1].plot(orbit.s, orbit.q[:, i] - (np.pi if i < 2 else 0.0), line, color=colour, label=name)
            axes[0, 2].plot(orbit.t, orbit.u[:, i], line, color=colour)
        torso_name = "torso" if line == THROUGH else None
        axes[0, 1].plot(orbit.s, orbit.q[:, TORSO], line, color="black", label=torso_name)
        axes[1, 1].plot(orbit.foot[:, 0], orbit.foot[:, 1] * 1e3, line, color="black")
    axes[0, 0].set_aspect("equal")
    axes[0, 0].axhline(0.0, color=FLOOR)
    label(axes[0, 0], "first and last posture (stance blue, swing orange)", "x [m]", "z [m]")
    label(axes[0, 1], "joint angles", "normalised clock", "angle, hips less pi [rad]")
    figure.legend(loc="outside lower center", ncols=5)
    label(axes[0, 2], "torques", "time [s]", "torque [N.m]")
    axes[1, 1].axhline(0.0, color=FLOOR)
    label(axes[1, 1], "swing foot", "x from the stance foot [m]", "height [mm]")
    _coefficients(axes[1, 0], found)
    _ratios(axes[1, 2], found)
    save(path, figure)


def _coefficients(axis: Any, found: Comparison) -> None:
    for colour, row in zip(COLOURS, found.apart, strict=True):
        axis.plot(row, "o-", color=colour, markersize=4, linewidth=1)
    axis.axhline(0.0, color=FLOOR)
    axis.set_xticks(range(found.apart.shape[1]))
    label(axis, f"coefficients, {found.second.name} less {found.first.name}", "k of alpha_k", "difference [rad]")


def _ratios(axis: Any, found: Comparison) -> None:
    by_name = {measure.name: measure for measure in found.measures}
    ratios = [by_name[name].second / by_name[name].first for name in COSTS]
    bars = axis.barh(COST_WORDS[::-1], ratios[::-1], color=COLOURS[2])
    axis.bar_label(bars, fmt="%.2f", padding=8, fontsize=9, backgroundcolor="white")
    axis.axvline(1.0, color="black", linestyle=DASHED, zorder=0)
    axis.margins(x=0.15)
    label(axis, f"{found.second.name} by {found.first.name}", "ratio", "")
