"""The paper's plant: stance foot pinned, rigid instantaneous impact with leg exchange, events to machine accuracy.

The MJCF of `sim.plant.mujoco_plant`, with the same modelling errors, as MuJoCo compiles it: its masses, lengths,
inertia, damping and dry friction, and none of MuJoCo's arithmetic. Between impacts a fixed-step RK4 integrates the
pinned walker under the held torque. The pin pulls as well as it pushes and never slips: a normal force below zero or
a ratio above the floor's friction is not prevented, but stands in the log.
"""

import functools
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.common.entry import Bound, bind
from sim.errors import PlantDiverged, UserError
from sim.interface import COORDINATES, JOINTS, LEGS, Rows, Vector
from sim.plant import rigid_kernels as kernels
from sim.plant.body import DETECTED_LINKS, Body, check_start, no_torque
from sim.plant.engine import address
from sim.plant.five_links import refuse_shape
from sim.plant.rigid_walker import PinnedWalker
from sim.plant.rows import DIVERGED, FINE, NO_TORQUE
from sim.scenario import PlantSettings

ON_GROUND = 1e-9  # [m] a swing foot this close to the ground at reset stands on it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Impact:
    """The last impact, as it happened within a tick.

    Attributes:
        t: Time since the start of the run in [s].
        stance: The foot that stood before it, "left" or "right".
        q: Joint angles and torso angle in [rad], (5,), ordered as `COORDINATES`.
        dq: Their rates just before it in [rad/s], (5,).
        dq_after: Their rates just after it in [rad/s], (5,).
        impulse: The ground's impulse (x, z) on the landing foot in [N.s], (2,).
        old_foot: Velocity (x, z) with which the old stance foot leaves the ground in [m/s], (2,); a negative z
            would be a foot pressed into the ground, which the model does not stop.
    """

    t: float
    stance: str
    q: Vector
    dq: Vector
    dq_after: Vector
    impulse: Vector
    old_foot: Vector

    @classmethod
    def of(cls, row: np.void) -> "Impact":
        """A row of `rigid_kernels.IMPACT`, a copy."""
        arrays = {name: row[name].copy() for name in ("q", "dq", "dq_after", "impulse", "old_foot")}
        return cls(t=float(row["t"]), stance=LEGS[row["leg"]], **arrays)


def refuse_resistance(model: mujoco.MjModel, path: Path) -> None:
    """Raises `UserError` where the joints have what the rigid plant has not."""
    joints = [model.joint(name).id for name in JOINTS]
    for what, values, switch in (
        ("springs", model.jnt_stiffness[joints], "plant.stiffness_factor.* = 0"),
        ("joint stops", model.jnt_limited[joints], "plant.joint_limits = false"),
    ):
        if values.any():
            raise UserError(
                f'model file {path}: the rigid plant has no {what}; must be {switch}, or plant.kind = "mujoco"'
            )


class RigidPlant(Body):
    """Five-link walker pinned at its stance foot. Implements `sim.interface.Plant`.

    The feet are points: the sphere of the MJCF plays no part. Nor do friction and stiffness of the ground, and the
    integrator is RK4 whatever the settings say. Dry friction in the joints is smooth (`rigid_equations.drive`).
    """

    def _refuse(self, settings: PlantSettings) -> None:
        """Refuse nothing yet: what it has not is in the model."""

    def _prepare(self) -> None:
        """Set up the pinned walker, whose links must hang on one another as the equations have it.

        Raises:
            UserError: they do not, or there are springs or stops in the joints.
        """
        refuse_resistance(self.model, self.sources[0])
        refuse_shape(self.model, self.sources[0])
        self._walker = PinnedWalker(self.model)
        work = self._work = self._walker.work
        sizes = [self.model.geom(name).size for name in DETECTED_LINKS]
        work["capsules"] = [(2.0 * float(size[1]), float(size[0])) for size in sizes]
        work["limits"], work["period"], work["substeps"] = self.torque_limits, self.period, self.substeps
        self._begin()

    @functools.cached_property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data, for viewers: from the first time they are asked for each look writes the walker there."""
        data, work = mujoco.MjData(self.model), self._work
        dofs = [int(self.model.jnt_dofadr[self.model.joint(name).id]) for name in ("hip_x", "hip_z", *COORDINATES)]
        work["hip"], work["q"] = dofs[:2], dofs[2:]
        work["qpos"], work["qvel"] = address(data.qpos), address(data.qvel)
        return data

    def _begin(self) -> None:
        work = self._work
        work["ticks"] = work["now"] = work["torque"] = work["push"] = work["force_time"] = work["landings"] = 0
        self._walker.leg, self._walker.foothold[:] = 0, (0.0, self.terrain.height(0.0))
        self._applied = ()
        self._impacts: list[Impact] = []

    @property
    def impacts(self) -> list[Impact]:
        """All impacts since the start."""
        self._remember()
        return self._impacts

    @property
    def impact(self) -> Impact | None:
        """The last impact, None before the first."""
        return self.impacts[-1] if self.impacts else None

    def _remember(self) -> None:
        """Keep the landings that have come since the last time, before others take their rows."""
        rows, landings = self._walker.impacts, int(self._work["landings"][0])
        self._impacts += [Impact.of(rows[n % len(rows)]) for n in range(len(self._impacts), landings)]

    def reset(self, q: Vector, dq: Vector, stance: str) -> None:
        """Put the walker on its stance foot.

        A state of the switching surface, its swing foot on the ground ahead and going down, is taken through the
        impact at once: the walker then stands on that foot, which the contact flags tell.

        Args:
            q: Joint angles and torso angle in [rad], (5,), ordered as `COORDINATES`.
            dq: Their rates in [rad/s], (5,).
            stance: "left" or "right".

        Raises:
            UserError: `stance` is not a leg, or an angle or a rate is not finite.
        """
        leg = check_start(q, dq, stance)
        self._begin()
        walker = self._walker
        walker.q[:], walker.dq[:], walker.leg = q, dq, leg
        ahead, height, rate = kernels.swing_height(self._work, self._ground, walker.q, walker.dq)
        if abs(height) <= ON_GROUND and ahead > 0.0 and rate < 0.0:
            walker.land(0.0)

    def look(self, state: Rows, seen: Rows, i: int) -> None:
        """Fill row `i` of `state` with the truth now and of `seen` with what ideal sensors read; see `Plant`."""
        kernels.look(self._work, self._ground, state, seen, i)

    def move(self, step: Rows, i: int, acting: NDArray[np.bool_]) -> None:
        """Hold what row `i` commands, forces at their points of the moving links; see `Plant`.

        Raises:
            ValueError: the torque is not finite: a defect of the controller.
            PlantDiverged: the state is not finite any more.
        """
        end = kernels.move(self._work, self._ground, self._walker.impacts, step, i, self._forces, acting)
        if end != FINE:
            self.heed(end, step, i)

    def heed(self, end: int, step: Rows, i: int) -> None:
        """Note landings in the hold of row `i`; raises as `move` does."""
        if end == NO_TORQUE:
            raise no_torque(step[i]["u_total"])
        self._remember()
        if end == DIVERGED:
            q, dq = self._walker.q.tolist(), self._walker.dq.tolist()
            t = self._work["ticks"][0] * self.period
            raise PlantDiverged(f"the plant diverged in the hold up to t = {t:.3f} s: q = {q}, dq = {dq}")

    def bound(self, state: Rows, seen: Rows, step: Rows, acting: NDArray[np.bool_]) -> tuple[Bound, Bound] | None:
        """The kernels of `look` and `move` for `sim.loop.ride`, with these forces and rows of these types."""
        if type(self) is not RigidPlant:
            return None  # one that may do more
        look = bind(kernels.look, (self._work, self._ground), (state, seen, 0))
        own = (self._work, self._ground, self._walker.impacts)
        return look, bind(kernels.move, own, (step, 0, self._forces, acting))
