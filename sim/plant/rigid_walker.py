"""The walker pinned at one foot: the numbers of its equations, a fixed-step RK4, and the rigid impact."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.interface import Vector
from sim.plant import rigid_equations as equations
from sim.plant import rigid_kernels as kernels
from sim.plant.five_links import FiveLinks
from sim.plant.rows import FORCE

IMPACTS = 4 * kernels.MOST_LANDINGS  # that are kept until they are asked for; a hold has a fourth of them at most


class PinnedWalker:
    """Equations of motion of a walker whose stance foot is a hinge on the ground.

    Attributes:
        work: One record of `rigid_equations.WORK`, which compiled code reads and writes.
        foothold: Where the pinned foot is, (x, z) in [m], (2,).
        q: Its angles now in [rad], (5,).
        dq: Their rates in [rad/s], (5,).
        torque: Held at its joints in [N.m], (4,).
        impacts: The last landings, rows of `rigid_kernels.IMPACT`; number n since the start is row n modulo all.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Args: model: the compiled walker."""
        self.work = work = np.zeros(1, equations.WORK)
        self.impacts = np.zeros(IMPACTS, kernels.IMPACT)
        self._leg, self.foothold, self._y = work["leg"], work["foothold"][0], work["y"][0]
        self.q, self.dq, self.torque = work["now"][0, :5], work["now"][0, 5:], work["torque"][0]
        links = FiveLinks.of(model)
        work["mass"], work["gravity"], work["lengths"] = links.mass.sum(), links.gravity, links.legs.lengths
        work["damping"], work["friction"], work["turning"] = links.damping, links.friction, links.turning()
        for leg in range(2):
            work["along"][0, leg], work["cross"][0, leg], work["moment"][0, leg] = links.sums(leg)

    @property
    def leg(self) -> int:
        """The pinned foot, 0 left, 1 right."""
        return int(self._leg[0])

    @leg.setter
    def leg(self, leg: int) -> None:
        self._leg[0] = leg

    def after(self, q: Vector, dq: Vector, h: float) -> Vector:
        """Angles and rates h [s] later under the held torque, and the ground's impulse over h in [N.s], (12,)."""
        kernels.after(self.work, NO_FORCES, NOTHING, q, dq, h)
        return self._y.copy()

    def land(self, t: float) -> NDArray[np.void]:
        """Impact of the swing foot at t [s], which is the pinned one afterwards: a row of `rigid_kernels.IMPACT`."""
        row = self.work["landings"][0] % len(self.impacts)
        kernels.land(self.work, self.impacts, t)
        return self.impacts[row : row + 1].copy()


NO_FORCES, NOTHING = np.zeros(0, FORCE), np.zeros(0, dtype=bool)
