"""The paper's plant: stance foot pinned, rigid instantaneous impact with leg exchange, events to machine accuracy.

The MJCF of `sim.plant.mujoco_plant`, with the same modelling errors; MuJoCo supplies the inertia matrix and the bias,
and none of its contact, actuation or integration. Between impacts a fixed-step RK4 integrates the pinned walker
under the held torque. The pin pulls as well as it pushes and never slips: a normal force below zero or a ratio
above the floor's friction is not prevented, but stands in the log.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from sim.errors import PlantDiverged, UserError
from sim.interface import LEGS, AppliedForce, Observation, PlantState, Vector
from sim.plant.body import DETECTED_LINKS, Body, check_start, check_torque
from sim.plant.rigid_walker import PinnedWalker
from sim.scenario import PlantSettings
from sim.scenario.per_link import JointTorques

ON_GROUND = 1e-9  # [m] a swing foot this close to the ground at reset stands on it
EPS = float(np.finfo(float).eps)
HEIGHT = 1  # of what `_swing_foot` returns


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


class RigidPlant(Body):
    """Five-link walker pinned at its stance foot. Implements `sim.interface.Plant`.

    The feet are points: the sphere of the MJCF plays no part.

    Attributes:
        impact: The last impact, None before the first.
    """

    def __init__(
        self,
        settings: PlantSettings,
        model_path: Path,
        control_period: float,
        *,
        seed: int = 0,
        walk_length: float = 20.0,
    ) -> None:
        """Read, modify and compile the model.

        Args:
            settings: Time step, ground and modelling errors; the integrator is RK4 whatever they say, and friction
                and stiffness of the ground play no part.
            model_path: MJCF file of the walker.
            control_period: Duration of one hold in [s].
            seed: The scenario's seed, for rough ground.
            walk_length: How far rough ground has to reach in [m].

        Raises:
            UserError: the file is missing or unreadable, or a setting is not legal.
        """
        if settings.joint_friction != JointTorques():
            raise UserError('plant.joint_friction: the rigid plant has none; must be 0, or plant.kind = "mujoco"')
        super().__init__(settings, model_path, control_period, seed=seed, walk_length=walk_length)
        self._walker = PinnedWalker(self.model, self.data, self.legs)
        sizes = [self.model.geom(name).size for name in DETECTED_LINKS]
        self._capsules = [(2.0 * float(size[1]), float(size[0])) for size in sizes]  # [m] length, thickness
        self._begin()

    def _begin(self) -> None:
        self._ticks = 0
        self._q, self._dq = np.zeros(5), np.zeros(5)
        self._walker.leg, self._walker.foothold[:] = 0, (0.0, self.terrain.height(0.0))
        self._torque = np.zeros(4)  # [N.m]
        self._force_time = np.zeros((2, 2))  # [N.s] ground force (x, z) on each foot, integrated over the hold
        self._push = np.zeros(2)  # [N]
        self._forces: tuple[AppliedForce, ...] = ()
        self.impact: Impact | None = None

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
        self._q, self._dq = np.array(q, dtype=float), np.array(dq, dtype=float)
        self._walker.leg = leg
        ahead, height, rate = self._swing_foot(self._q, self._dq)
        if abs(height) <= ON_GROUND and ahead > 0.0 and rate < 0.0:
            self._land(0.0)

    def observe(self) -> Observation:
        """What ideal sensors read now."""
        return Observation(t=self._ticks * self.period, q=self._q.copy(), dq=self._dq.copy(), contact=self._contact())

    def state(self) -> PlantState:
        """The truth now; contact forces leave the impulse of an impact out, and are zero before the first hold."""
        walker = self._walker
        hip, dhip = walker.place(self._q, self._dq)
        other = walker.foothold + walker.swing_foot(self._q, self._dq)[:2]
        foot = np.array((walker.foothold, other) if walker.leg == 0 else (other, walker.foothold))
        clearance, contact_force = [], []
        for (x, z), (fx, fz) in zip(foot.tolist(), (self._force_time / self.period).tolist(), strict=True):
            ground = self.terrain.under(x)
            cos, sin = math.cos(ground.angle), math.sin(ground.angle)
            clearance.append((z - ground.height(x)) * cos)
            contact_force.append((fx * cos + fz * sin, fz * cos - fx * sin))
        return PlantState(
            t=self._ticks * self.period,
            q=self._q.copy(),
            dq=self._dq.copy(),
            hip=hip,
            dhip=dhip,
            foot=foot,
            clearance=np.array(clearance),
            torque=self._torque.copy(),
            contact=self._contact(),
            contact_force=np.array(contact_force),
            push=self._push.copy(),
            penetrating=self._penetrating(hip.tolist()),
            applied=self._forces,
        )

    def hold(self, u: Vector, forces: Sequence[AppliedForce] = ()) -> None:
        """Hold a commanded torque and external forces for one control period.

        Args:
            u: Commanded joint torque in [N.m], (4,), ordered as `JOINTS`; saturated at the limits.
            forces: External forces throughout the hold, each at its point of the moving link.

        Raises:
            ValueError: `u` is not finite or not four numbers: a defect of the controller.
            PlantDiverged: the state is not finite any more.
        """
        check_torque(u)
        self._check_forces(forces)
        self._torque = np.clip(u, -self.torque_limits, self.torque_limits)
        self._forces = tuple(forces)
        self._push = np.sum([applied.force for applied in forces], axis=0) if forces else np.zeros(2)
        self._walker.load(self._torque, self._forces)
        self._force_time[:] = 0.0
        step = self.period / self.substeps
        for substep in range(self.substeps):
            self._advance(self._ticks * self.period + substep * step, step)
        self._ticks += 1
        if not math.isfinite(sum(self._q.tolist()) + sum(self._dq.tolist())):
            raise PlantDiverged(
                f"the plant diverged in the hold up to t = {self._ticks * self.period:.3f} s: "
                f"q = {self._q.tolist()}, dq = {self._dq.tolist()}"
            )

    def _advance(self, t: float, duration: float) -> None:
        """One step of integration, cut at an impact if there is one in it."""
        y = self._walker.after(self._q, self._dq, duration)
        before = self._swing_foot(self._q, self._dq)[HEIGHT]
        ahead, height, _ = self._swing_foot(y[:5], y[5:10])
        if not (height <= 0.0 < before and ahead > 0.0):
            self._take(y)
            return

        def height_at(tau: float) -> float:
            there = self._walker.after(self._q, self._dq, tau)
            return self._swing_foot(there[:5], there[5:10])[HEIGHT]

        tau = float(brentq(height_at, 0.0, duration, xtol=EPS * duration, rtol=4 * EPS))
        self._take(self._walker.after(self._q, self._dq, tau))
        self._land(t + tau)
        if tau < duration:
            self._advance(t + tau, duration - tau)

    def _take(self, y: Vector) -> None:
        """Make the result of a step the present."""
        self._q, self._dq = y[:5], y[5:10]
        self._force_time[self._walker.leg] += y[10:]

    def _land(self, t: float) -> None:
        """The swing foot becomes the stance foot."""
        stance = LEGS[self._walker.leg]
        after, impulse, old_foot = self._walker.strike(self._q, self._dq)
        self.impact = Impact(
            t=t,
            stance=stance,
            q=self._q,
            dq=self._dq,
            dq_after=after,
            impulse=impulse,
            old_foot=old_foot,
        )
        self._dq = after

    def _swing_foot(self, q: Vector, dq: Vector) -> tuple[float, float, float]:
        """Swing foot: distance ahead of the stance foot, height over the ground in [m], its rate in [m/s]."""
        x, z, dx, dz = self._walker.swing_foot(q, dq)
        foot_x, foot_z = self._walker.foothold.tolist()
        at = foot_x + x
        ground = self.terrain.under(at)
        height = foot_z + z - ground.height(at)
        return x, height, dz - math.tan(ground.angle) * dx

    def _contact(self) -> tuple[bool, bool]:
        return self._walker.leg == 0, self._walker.leg == 1

    def _penetrating(self, hip: Sequence[float]) -> tuple[str, ...]:
        """Links whose capsule reaches the ground, of those the other plant senses."""
        left, right, _, _, torso = self._q.tolist()
        x, z = hip
        hip_height = z - self.terrain.height(x)
        found = []
        for name, angle, (length, thickness) in zip(
            DETECTED_LINKS, (torso, torso + left, torso + right), self._capsules, strict=True
        ):
            end_x, end_z = x - length * math.sin(angle), z + length * math.cos(angle)
            if hip_height < thickness or end_z - self.terrain.height(end_x) < thickness:
                found.append(name)
        return tuple(found)
