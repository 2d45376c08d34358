"""The paper's plant: stance foot pinned, rigid instantaneous impact with leg exchange, events to machine accuracy.

The MJCF of `sim.plant.mujoco_plant`, with the same modelling errors; MuJoCo supplies the inertia matrix and the bias,
and none of its contact, actuation or integration. Between impacts a fixed-step RK4 integrates the pinned walker
under the held torque. The pin pulls as well as it pushes and never slips: a normal force below zero or a ratio
above the floor's friction is not prevented, but stands in the log.
"""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.errors import PlantDiverged, UserError
from sim.interface import JOINTS, LEGS, Rows, Vector
from sim.plant import rigid_kernels as kernels
from sim.plant.body import DETECTED_LINKS, Body, check_start, no_torque
from sim.plant.rigid_walker import PinnedWalker
from sim.scenario import PlantSettings
from sim.scenario.per_link import JointTorques

ON_GROUND = 1e-9  # [m] a swing foot this close to the ground at reset stands on it
EPS = float(np.finfo(float).eps)
HEIGHT = 1  # of what `swing_height` returns


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


def refuse_resistance(model: mujoco.MjModel, path: Path) -> None:
    """Raises `UserError` where the joints have what the rigid plant has not."""
    joints = [model.joint(name).id for name in JOINTS]
    dofs = model.jnt_dofadr[joints]
    for what, values, switch in (
        ("dry friction", model.dof_frictionloss[dofs], "plant.joint_friction_factor.* = 0"),
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
    integrator is RK4 whatever the settings say.

    Attributes:
        impacts: All since the start.
    """

    def _refuse(self, settings: PlantSettings) -> None:
        """Refuse dry friction, before it is put into the model."""
        if settings.joint_friction != JointTorques():
            raise UserError('plant.joint_friction: the rigid plant has none; must be 0, or plant.kind = "mujoco"')

    def _prepare(self) -> None:
        """Set up the pinned walker on the compiled model, which must have no resistance in its joints."""
        refuse_resistance(self.model, self.sources[0])
        self._walker = PinnedWalker(self.model, self.data, self.legs, self._forces)
        work = self._work = self._walker.work
        sizes = [self.model.geom(name).size for name in DETECTED_LINKS]
        work["capsules"] = [(2.0 * float(size[1]), float(size[0])) for size in sizes]
        work["bodies"], work["limits"] = self._body_ids, self.torque_limits
        work["period"], work["substeps"] = self.period, self.substeps
        self._begin()

    def _begin(self) -> None:
        work = self._work
        work["ticks"] = work["now"] = work["torque"] = work["push"] = work["force_time"] = 0
        self._walker.leg, self._walker.foothold[:] = 0, (0.0, self.terrain.height(0.0))
        self._applied = ()
        self.impacts: list[Impact] = []

    @property
    def impact(self) -> Impact | None:
        """The last impact, None before the first."""
        return self.impacts[-1] if self.impacts else None

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
            self._land(0.0)

    def look(self, state: Rows, seen: Rows, i: int) -> None:
        """Fill row `i` of `state` with the truth now and of `seen` with what ideal sensors read; see `Plant`."""
        kernels.look(self._work, self._ground, state, seen, i)

    def move(self, step: Rows, i: int, acting: NDArray[np.bool_]) -> None:
        """Hold what row `i` commands, forces at their points of the moving links; see `Plant`.

        Raises:
            ValueError: the torque is not finite: a defect of the controller.
            PlantDiverged: the state is not finite any more.
        """
        work, walker = self._work, self._walker
        walker.forces, walker.acting = self._forces, acting
        if not kernels.start_hold(work, step, i, self._forces, acting):
            raise no_torque(step[i]["u_total"])
        ticks = int(work["ticks"][0])
        duration = self.period / self.substeps
        substep = kernels.hold(work, self._ground, self._forces, acting, 0)
        while substep != kernels.ALL:
            self._advance(ticks * self.period + substep * duration, duration)
            substep = kernels.hold(work, self._ground, self._forces, acting, substep + 1)
        if not np.isfinite(work["now"]).all():
            raise PlantDiverged(
                f"the plant diverged in the hold up to t = {(ticks + 1) * self.period:.3f} s: "
                f"q = {walker.q.tolist()}, dq = {walker.dq.tolist()}"
            )

    def _advance(self, t: float, duration: float) -> None:
        """One step of integration, cut at an impact if there is one in it."""
        walker, work, ground = self._walker, self._work, self._ground
        q, dq = walker.q.copy(), walker.dq.copy()
        y = walker.after(q, dq, duration)
        _, before, _ = kernels.swing_height(work, ground, q, dq)
        ahead, height, _ = kernels.swing_height(work, ground, y[:5], y[5:10])
        if not (height <= 0.0 < before and ahead > 0.0):
            kernels.take(work)
            return

        def height_at(tau: float) -> float:
            there = walker.after(q, dq, tau)
            found: float = kernels.swing_height(work, ground, there[:5], there[5:10])[HEIGHT]
            return found

        from scipy.optimize import brentq  # 0.2 s to import; at the first impact

        tau = float(brentq(height_at, 0.0, duration, xtol=EPS * duration, rtol=4 * EPS))
        walker.after(q, dq, tau)
        kernels.take(work)
        self._land(t + tau)
        if tau < duration:
            self._advance(t + tau, duration - tau)

    def _land(self, t: float) -> None:
        """The swing foot becomes the stance foot."""
        walker = self._walker
        stance, q, dq = LEGS[walker.leg], walker.q.copy(), walker.dq.copy()
        after, impulse, old_foot = walker.strike()
        self.impacts.append(Impact(t=t, stance=stance, q=q, dq=dq, dq_after=after, impulse=impulse, old_foot=old_foot))
