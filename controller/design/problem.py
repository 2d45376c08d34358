"""A request for a gait as one vector function of the free numbers: what the optimiser sees."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from controller.belief import WalkerModel
from controller.common.records import Vector
from controller.design.orbit import periodic_orbit, quadrature
from controller.design.parameters import NoPosture, Parametrisation
from controller.design.requirements import Requirements, margins

Cost = Literal["torque", "work"]

NODES = 31  # of the optimiser; the answer is judged on those of `orbit.NODES`
DIFFERENCE = 1e-6  # [rad], [m]
FAR = 1e3  # stands for cost and violation where there is no posture


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """The request as functions of the free numbers.

    Attributes:
        space: What the numbers mean.
        need: What is asked.
        cost: Which cost.
        cost_scale: What counts as 1 of it.
        held_back: Scaled margin kept in hand; some margins keep a share of it.
    """

    space: Parametrisation
    need: Requirements
    cost: Cost
    cost_scale: float
    held_back: float

    @property
    def reserve(self) -> Vector:
        """What each scaled margin must keep, (number of margins,)."""
        return self.held_back * _reserve(self.space.model, self.need)

    def vector(self, p: Vector) -> Vector:
        """Scaled cost, relative error of the speed, scaled margins, square roots of the torque cost's summands.

        Finite everywhere: an optimiser's step may go where there is no gait.
        """
        model = self.space.model
        try:
            gait = self.space.gait(p)
        except NoPosture:
            return np.r_[FAR, FAR, np.full(self.reserve.shape, -FAR), np.zeros(4 * NODES)]
        orbit = periodic_orbit(model, gait, NODES)
        scaled = [m.values / m.scale for m in margins(model, gait, orbit, self.need)]
        cost = orbit.cost if self.cost == "torque" else orbit.work
        _, integrals = quadrature(NODES)
        share = integrals[-1] * gait.table.theta_span / (orbit.step_length * orbit.dtheta * self.cost_scale)
        roots = np.sqrt(np.maximum(share, 0.0))[:, None] * orbit.u
        values = np.concatenate([[cost / self.cost_scale, orbit.speed / self.need.speed - 1.0], *scaled, roots.ravel()])
        return np.clip(np.nan_to_num(values, nan=-FAR), -FAR, FAR)

    def jacobian(self, p: Vector) -> Vector:
        """Central differences of `vector`, (its length, size)."""
        columns = []
        for i in range(p.shape[0]):
            e = np.zeros_like(p)
            e[i] = DIFFERENCE
            columns.append((self.vector(p + e) - self.vector(p - e)) / (2.0 * DIFFERENCE))
        return np.array(columns).T


COST, SPEED = 0, 1
MARGINS = slice(2, -4 * NODES)
ROOTS = slice(-4 * NODES, None)
"""Parts of `Problem.vector`."""


@lru_cache(maxsize=8)
def _reserve(model: WalkerModel, need: Requirements) -> Vector:
    """Share of the reserve that each margin keeps; the same for any gait, so one with straight legs will do."""
    space = Parametrisation(model=model, degree=4, step_length=min(need.step_length, 0.5 * model.leg_length))
    p = np.zeros(space.size)
    p[:2] = -0.1
    gait = space.gait(p)
    found = margins(model, gait, periodic_orbit(model, gait, NODES), need)
    return np.concatenate([np.broadcast_to(m.reserve, m.values.shape) for m in found])


def violation_of(vector: Vector) -> float:
    """Largest scaled violation, what is held back not counted; below 0 if there is room."""
    return max(abs(float(vector[SPEED])), float(-vector[MARGINS].min()))
