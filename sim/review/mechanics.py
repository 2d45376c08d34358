"""Energy and angular momentum about the stance foot, and the orbit that the gait has in them.

All at once for every tick: five rigid links in a plane, their masses from the plant's model as the scenario made it.
Where the outputs are zero, angular momentum about the foot obeys d(L^2/2)/d(theta) = I(theta) m g x(theta), with x the
centre of mass ahead of the foot and L = I(theta) d(theta)/dt; Westervelt et al., "Feedback Control of Dynamic Bipedal
Robot Locomotion", chapter 5.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.common import toml
from sim.errors import UserError
from sim.interface import COORDINATES, LEGS
from sim.log.read.attachments import unpacked
from sim.log.read.frames import Run
from sim.review.facts import scenario_of
from sim.scenario import PlantSettings

Column = NDArray[np.float64]
GRAVITY = 9.81  # [m/s^2]
POINTS = 200  # of the orbit
_LINKS = ("torso", *(f"{leg}_{part}" for leg in LEGS for part in ("femur", "tibia")))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Links:
    """The plant's links, in the order torso, left femur and tibia, right ones.

    Attributes:
        mass: In [kg], (5,).
        com: Centre of mass (x, z) from the proximal joint, the link upright, in [m], (5, 2).
        inertia: About the centre of mass in [kg m^2], (5,).
        femur: Length of each femur in [m], (2,).
        tibia: Length of each tibia in [m], (2,).
    """

    mass: Column
    com: Column
    inertia: Column
    femur: Column
    tibia: Column

    @classmethod
    def of(cls, settings: PlantSettings, mjcf: Path) -> "Links":
        """Read the model of a plant, its errors applied."""
        from sim.plant.build import build_spec
        from sim.plant.kinematics import LegGeometry
        from sim.plant.mechanics import inertia_across
        from sim.plant.mjcf import compile_spec

        model = compile_spec(build_spec(settings, mjcf), mjcf)
        rows = [model.body(name).id for name in _LINKS]
        lengths = np.array(LegGeometry.of(model).lengths)
        return cls(
            mass=model.body_mass[rows].copy(),
            com=model.body_ipos[rows][:, [0, 2]].copy(),
            inertia=np.array([inertia_across(model, row) for row in rows]),
            femur=lengths[:, 0],
            tibia=lengths[:, 1],
        )

    def about_foot(self, q: Column, dq: Column, stance: NDArray[np.int64]) -> tuple[Column, Column, Column]:
        """Energy and momentum about a foot that stands still.

        Args:
            q: Joint angles and torso angle in [rad], (n, 5).
            dq: Their rates in [rad/s], (n, 5).
            stance: Row of the foot, 0 left and 1 right, (n,).

        Returns:
            Kinetic and potential energy above the foot in [J], angular momentum about it in [N.m.s], positive forwards,
            and the centre of mass ahead of it in [m]; (n,) each.
        """
        phi, rate = _absolute(q), _absolute(dq)  # (5, n)
        away = np.array([-np.sin(phi), np.cos(phi)])  # (2, 5, n), along a link
        turned = rate * np.array([-np.cos(phi), -np.sin(phi)])
        knee = [away[:, row] * length for row, length in zip((1, 3), self.femur, strict=True)]
        dknee = [turned[:, row] * length for row, length in zip((1, 3), self.femur, strict=True)]
        foot = [at + away[:, row] * length for at, row, length in zip(knee, (2, 4), self.tibia, strict=True)]
        dfoot = [at + turned[:, row] * length for at, row, length in zip(dknee, (2, 4), self.tibia, strict=True)]
        right = stance == 1
        hip, dhip = -np.where(right, foot[1], foot[0]), -np.where(right, dfoot[1], dfoot[0])
        zero = np.zeros_like(hip)
        joints, rates = (zero, zero, knee[0], zero, knee[1]), (zero, zero, dknee[0], zero, dknee[1])
        energy = momentum = ahead = np.zeros(len(q))
        for row in range(len(_LINKS)):
            cx, cz = self.com[row]
            side = np.array([away[1, row], -away[0, row]])  # a link's own x axis
            dside = np.array([turned[1, row], -turned[0, row]])
            x, z = hip + joints[row] + cx * side + cz * away[:, row]
            vx, vz = dhip + rates[row] + cx * dside + cz * turned[:, row]
            m, inertia = self.mass[row], self.inertia[row]
            energy = energy + 0.5 * (m * (vx**2 + vz**2) + inertia * rate[row] ** 2) + m * GRAVITY * z
            momentum = momentum - (m * (x * vz - z * vx) + inertia * rate[row])
            ahead = ahead + m * x / self.mass.sum()
        return energy, momentum, ahead


def _absolute(q: Column) -> Column:
    left_hip, right_hip, left_knee, right_knee, torso = q.T
    left, right = torso + left_hip, torso + right_hip
    return np.array([torso, left, left + left_knee, right, right + right_knee])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Orbit:
    """A gait's own course through a step, by the clock, (n,) each.

    Attributes:
        theta: Clock in [rad], rising.
        dtheta: Its rate in [rad/s].
        energy: About the stance foot in [J].
        momentum: About it in [N.m.s].
    """

    theta: Column
    dtheta: Column
    energy: Column
    momentum: Column

    @classmethod
    def of(cls, gait: dict[str, Any], links: Links) -> "Orbit":
        """From a gait file and the links that it was made for."""
        alpha, clock = np.array(gait["alpha"], float), np.array(gait["clock"], float)
        last, rates = np.array(gait["q_minus"], float), np.array(gait["dq_minus"], float)
        first = last[[1, 0, 3, 2, 4]]  # the legs change places
        start, span = float(clock @ first), float(clock @ (last - first))
        s = np.linspace(0.0, 1.0, POINTS)
        h, slope = _bezier(alpha, s), _bezier((alpha.shape[1] - 1) * np.diff(alpha, axis=1), s) / span
        theta = start + s * span
        q = np.column_stack([*h, (theta - clock[:4] @ h) / clock[4]])
        dq = np.column_stack([*slope, (1.0 - clock[:4] @ slope) / clock[4]])  # for d(theta)/dt = 1
        left = np.zeros(POINTS, np.int64)  # the left leg is the one that stands
        _, inertia, ahead = links.about_foot(q, dq, left)
        gain = inertia * links.mass.sum() * GRAVITY * ahead
        half = np.concatenate(([0.0], np.cumsum(0.5 * (gain[1:] + gain[:-1]) * np.diff(theta))))
        end = inertia[-1] * float(clock @ rates)
        momentum = np.sqrt(np.maximum(end**2 + 2.0 * (half - half[-1]), 0.0)) * np.sign(end)
        dtheta = momentum / inertia
        energy, _, _ = links.about_foot(q, dq * dtheta[:, None], left)
        return cls(theta=theta, dtheta=dtheta, energy=energy, momentum=momentum)

    def at(self, theta: Column, values: Column) -> Column:
        """One of its columns at clocks of a run; NaN where the orbit does not reach."""
        return np.interp(theta, self.theta, values, left=np.nan, right=np.nan)


def _bezier(alpha: Column, s: Column) -> Column:
    """Bezier polynomials at s, (rows, n): de Casteljau."""
    points = alpha[:, :, None] * np.ones(len(s))
    while points.shape[1] > 1:
        points = (1.0 - s) * points[:, :-1] + s * points[:, 1:]
    return np.asarray(points[:, 0])


def mechanics_of(run: Run, columns: dict[str, Column]) -> dict[str, Column]:
    """Energy and momentum at every tick, and the gait's own at the same clock; nothing where a log lacks what it takes.

    Args:
        run: A log, perhaps damaged.
        columns: Its signals: angles, clock, stance.
    """
    scenario = scenario_of(run)
    if scenario is None or "/plant/state" not in run.frames:
        return {}
    try:
        with unpacked(scenario, run.log.attachments) as files:
            links = Links.of(scenario.plant, files.mjcf)
            nominal = Links.of(PlantSettings(), files.mjcf)
            gait = toml.loads(files.gait.read_text(encoding="utf-8"))
        orbit = Orbit.of(gait, nominal)
    except (UserError, ValueError, KeyError, TypeError, IndexError, OSError):
        return {}
    q = np.column_stack([columns[f"q.{name}"] for name in COORDINATES])
    dq = np.column_stack([columns[f"dq.{name}"] for name in COORDINATES])
    stance = np.nan_to_num(columns["stance"]).astype(np.int64)
    with np.errstate(all="ignore"):  # once it falls, anything goes
        energy, momentum, _ = links.about_foot(q, dq, stance)
        theta = columns["theta"]
        return {
            "energy": energy,
            "momentum": momentum,
            "energy.nominal": orbit.at(theta, orbit.energy),
            "momentum.nominal": orbit.at(theta, orbit.momentum),
            "dtheta.nominal": orbit.at(theta, orbit.dtheta),
        }
