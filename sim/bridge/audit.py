"""Audit of a run: does its energy add up, and what does the ground do that a rigid one would not?

Work is power times time, step by step of the physics. MuJoCo's steps are accounted for where they happen, through its
control callback, with the mean of the velocities before and after each: for constant inertia that is the change of
kinetic energy to the last digit. The rigid plant has exact work of motors and pushes from one tick to the next, and
its impacts lose energy at once.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import mujoco
import numpy as np

from sim.bridge.run import build_rig
from sim.bridge.steadiness import Steadiness, Steady
from sim.errors import UserError
from sim.interface import JOINTS, LEGS, ControlStep, Observation, PlantState, Vector
from sim.loop import RunSummary, Tapes
from sim.loop.tape import EachTick
from sim.plant import Energy, MujocoPlant, RigidPlant
from sim.plant.rigid_equations import SLIDING
from sim.plant.rigid_walker import PinnedWalker
from sim.scenario import Scenario

SETTLING = 0.02  # [s] after an impact, in which forces and penetration are those of the impact
WINDOW = 10  # ticks over which MuJoCo's impact is summed; the steady force of the next as many is taken off


@dataclass(slots=True, kw_only=True)
class Balance:
    """Where a run's energy went, all in [J]; what is put in is positive.

    Attributes:
        motors: Work of the motors.
        motors_moved: The same without signs: the sum of the magnitudes of what each step's motors did.
        damping: Work of the joints' damping, 0 or below.
        pushes: Work of external forces.
        contact: Work of the ground, and of dry friction in the joints.
        change: Of kinetic and potential energy.
    """

    motors: float = 0.0
    motors_moved: float = 0.0
    damping: float = 0.0
    pushes: float = 0.0
    contact: float = 0.0
    change: float = 0.0

    @property
    def residual(self) -> float:
        """What does not add up in [J]."""
        return self.change - self.motors - self.damping - self.pushes - self.contact


@dataclass(slots=True, kw_only=True)
class Findings:
    """What an audit found.

    Attributes:
        energy: The balance.
        penetration_impact: Deepest contact within `SETTLING` of an impact in [m].
        penetration: Deepest contact at other times in [m].
        flight_share: Share of physics steps without any contact, impacts left out.
        impulses: Of each landing, the ground's impulse (x, z) and that of the rigid impact map in [N.s].
        steadiness: Of the stance force, and torques after landings.
    """

    energy: Balance = field(default_factory=Balance)
    penetration_impact: float = 0.0
    penetration: float = 0.0
    flight_share: float = 0.0
    impulses: list[tuple[Vector, Vector]] = field(default_factory=list)
    steadiness: Steadiness = field(default_factory=lambda: Steady(0).found())

    @property
    def impulse_error(self) -> float | None:
        """Mean difference of the impulses' magnitudes, relative to the rigid map's; None without a landing."""
        if not self.impulses:
            return None
        return float(np.mean([np.linalg.norm(a) / np.linalg.norm(b) - 1.0 for a, b in self.impulses]))


class Audit(EachTick):
    """Listens to a run of one plant; `watching` has to be entered around it."""

    frame_every = 1  # the forces of every tick

    def __init__(self, plant: MujocoPlant | RigidPlant) -> None:
        """Args: plant: whose run is audited.

        Raises:
            UserError: the integrator has steps within steps.
        """
        self.found = Findings()
        self._plant = plant
        self._rigid = isinstance(plant, RigidPlant)
        model = plant.model
        if not self._rigid and model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            raise UserError('plant.integrator = "RK4": --audit needs one without inner steps, such as "implicitfast"')
        self._data = mujoco.MjData(model)  # of its own, for energies and impact maps
        self._energies = Energy(model, self._data)
        self._joints = [int(model.jnt_dofadr[model.joint(name).id]) for name in JOINTS]
        self._damping, self._friction = np.array(model.dof_damping), np.array(model.dof_frictionloss)
        self._h = float(model.opt.timestep)
        self._before: tuple[Vector, Vector] | None = None  # velocity at the start of a step, its pushes
        self._impacts = [0.0]  # [s]; the start counts as one
        self._counted = 0  # impacts of the rigid plant
        self._depths: list[tuple[float, float]] = []  # [s] and [m] of every physics step, -1 without contact
        self._last: PlantState | None = None
        self._first_energy: float | None = None
        self._landing: tuple[int, int, Vector] | None = None  # tick, foot, the rigid map's impulse
        self._ground: list[Vector] = []

    @contextmanager
    def watching(self) -> Iterator["Audit"]:
        """While the run goes on; its end closes the books."""
        if not self._rigid:
            mujoco.set_mjcb_control(self._step)
        try:
            yield self
        finally:
            mujoco.set_mjcb_control(None)
        if not self._rigid:
            self._account(self._plant.data)
        e = self.found.energy
        if self._last is not None and self._first_energy is not None:
            state = self._plant.state()
            if self._rigid:
                self._between(self._last, state)
            e.change = self._energy(state) - self._first_energy
        self._look_at_depths()

    def _look_at_depths(self) -> None:
        """Penetration and time without contact, near impacts and away from them."""
        if not self._depths:
            return
        t, depth = np.array(self._depths).T
        since = t - np.array(self._impacts)[np.searchsorted(self._impacts, t + self._plant.period, side="right") - 1]
        settled = since > SETTLING  # an impact is seen at the first tick after it began
        self.found.penetration_impact = float(depth[~settled].max(initial=0.0))
        self.found.penetration = float(depth[settled].max(initial=0.0))
        self.found.flight_share = float((depth[settled] < 0.0).mean()) if settled.any() else 0.0

    # MuJoCo, physics step by physics step

    def _step(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Called by MuJoCo between the velocities and the forces of a step: the last step is over."""
        self._account(data)
        self._before = np.array(data.qvel), self._pushed(model, data)

    def _account(self, data: mujoco.MjData) -> None:
        """Add up the step that has just ended; its forces still stand in the data."""
        if self._before is None:
            return
        (before, push), self._before = self._before, None
        after = np.array(data.qvel)
        moved = 0.5 * self._h * (before + after)  # [rad] or [m]
        e = self.found.energy
        motors = float(data.qfrc_actuator @ moved)
        e.motors += motors
        e.motors_moved += abs(motors)
        e.damping -= float((self._damping * after) @ moved)  # taken at the end of the step
        e.contact += float(data.qfrc_constraint @ moved)
        e.pushes += float(push @ moved)
        depth = max((-contact.dist for contact in data.contact), default=0.0) if data.ncon else -1.0
        self._depths.append((float(data.time), depth))

    def _pushed(self, model: mujoco.MjModel, data: mujoco.MjData) -> Vector:
        """Generalised forces of what pushes the links."""
        total = np.zeros(model.nv)
        for body in np.flatnonzero(data.xfrc_applied.any(axis=1)).tolist():
            force = data.xfrc_applied[body]
            mujoco.mj_applyFT(model, data, force[:3], force[3:], data.xipos[body], body, total)
        return total

    # Ticks

    def tick(self, k: int, state: PlantState, observation: Observation, step: ControlStep, tick_s: float) -> None:
        """Follow the energy, and the impulse of a landing."""
        if self._first_energy is None:
            self._first_energy = self._energy(state)
        elif self._rigid and self._last is not None:
            self._between(self._last, state)
        self._follow_landing(k, state)
        self._last = state

    def event(self, k: int, level: str, name: str, message: str) -> None:
        """Note a landing."""
        if name != "impact":
            return
        self._impacts.append(k * self._plant.period)
        if self._rigid or self._last is None:
            return
        foot = 0 if "left foot" in message else 1
        self._landing, self._ground = (k, foot, self._rigid_impulse(self._last, 1 - foot)), []

    def _follow_landing(self, k: int, state: PlantState) -> None:
        if self._landing is None:
            return
        _start, foot, expected = self._landing
        self._ground.append(state.contact_force[foot] * self._plant.period)
        if len(self._ground) == 2 * WINDOW:
            first, then = (np.sum(self._ground[i : i + WINDOW], axis=0) for i in (0, WINDOW))
            self.found.impulses.append((first - then, expected))
            self._landing = None

    def _rigid_impulse(self, state: PlantState, stance: int) -> Vector:
        """What a rigid impact would do now in [N.s], (2,)."""
        walker = PinnedWalker(self._plant.model)
        walker.leg = stance
        walker.foothold[:] = state.foot[stance]
        walker.q[:], walker.dq[:] = state.q, state.dq
        impulse: Vector = walker.land(state.t)["impulse"][0]
        return impulse

    def _between(self, then: PlantState, now: PlantState) -> None:
        """The rigid plant from one tick to the next, through an impact if there was one."""
        e = self.found.energy
        turned = now.q[: len(JOINTS)] - then.q[: len(JOINTS)]
        motors = float(now.torque @ turned)
        e.motors += motors
        e.motors_moved += abs(motors)
        for applied in now.applied:
            moved = self._point(now, applied.body, applied.point) - self._point(then, applied.body, applied.point)
            e.pushes += float(np.array(applied.force) @ moved)
        pieces = [(then.t, then.dq, now.t, now.dq)]
        impacts = self._plant.impacts if isinstance(self._plant, RigidPlant) else []
        for impact in impacts[self._counted :]:
            if not then.t <= impact.t <= now.t:
                break
            self._counted += 1
            t0, dq0, _, _ = pieces.pop()
            pieces += [(t0, dq0, impact.t, impact.dq), (impact.t, impact.dq_after, now.t, now.dq)]
            e.contact -= self._kinetic(impact.q, impact.dq, impact.stance)
            other = "right" if impact.stance == "left" else "left"
            e.contact += self._kinetic(impact.q, impact.dq_after, other)
        damping, friction = self._damping[self._joints], self._friction[self._joints]
        for t0, dq0, t1, dq1 in pieces:
            a, b = dq0[: len(JOINTS)], dq1[: len(JOINTS)]
            e.contact -= 0.5 * float(friction @ (a * np.tanh(a / SLIDING) + b * np.tanh(b / SLIDING))) * (t1 - t0)
            e.damping -= float(damping @ (a * a + a * b + b * b)) * (t1 - t0) / 3.0  # rates straight in between

    def _kinetic(self, q: Vector, dq: Vector, stance: str) -> float:
        """Kinetic energy of the walker pinned at a foot in [J]."""
        legs, leg = self._plant.legs, LEGS.index(stance)
        dhip = -np.array(legs.feet_velocity(q.tolist(), dq.tolist())[leg])
        return self._energies.kinetic(q, dq, -legs.foot(q, leg), dhip)

    def _point(self, state: PlantState, body: str, point: tuple[float, float]) -> Vector:
        """Where a point of a link is, (x, z) in [m]."""
        self._energies.place(state.q, state.dq, state.hip, state.dhip)
        number = self._plant.model.body(body).id
        frame = self._data.xmat[number].reshape(3, 3)
        found: Vector = (self._data.xpos[number] + frame @ np.array([point[0], 0.0, point[1]]))[[0, 2]]
        return found

    def _energy(self, state: PlantState) -> float:
        """Potential and kinetic energy in [J]."""
        return self._energies.about(state.q, state.dq, state.hip, state.dhip, 0.0)


def audited(scenario: Scenario) -> tuple[RunSummary, Findings]:
    """Run a scenario, without a log, and audit it.

    Raises:
        UserError: a file or a setting is not legal.
    """
    rig = build_rig(scenario)
    assert isinstance(rig.plant, MujocoPlant | RigidPlant)
    steady = Steady(round(SETTLING / rig.plant.period))
    with Audit(rig.plant).watching() as audit:
        summary = rig.run(Tapes(audit, steady))
    audit.found.steadiness = steady.found()
    return summary, audit.found


def rows(found: Findings, slip: float | None) -> list[tuple[str, str]]:
    """An audit in words, name and figures, for a table."""
    e = found.energy
    share = abs(e.residual) / e.motors_moved if e.motors_moved else math.nan
    error, s = found.impulse_error, found.steadiness
    return [
        ("work of the motors", f"{e.motors:.3f} J ({e.motors_moved:.3f} J without signs)"),
        ("work of the damping", f"{e.damping:.3f} J"),
        ("work of the pushes", f"{e.pushes:.3f} J"),
        ("work of the ground, and of dry friction", f"{e.contact:.3f} J"),
        ("change of energy", f"{e.change:.3f} J"),
        ("does not add up", f"{e.residual:+.4f} J, {100.0 * share:.4f} % of the motors' work"),
        ("penetration", f"{1e3 * found.penetration:.3f} mm, in impacts {1e3 * found.penetration_impact:.3f} mm"),
        ("slip of the stance foot", f"{1e3 * (slip or 0.0):.2f} mm in all"),
        ("without contact", f"{100.0 * found.flight_share:.2f} % of the physics steps, impacts left out"),
        *s.rows(SETTLING),
        ("impulse of impacts", "-" if error is None else f"{100.0 * error:+.1f} % against the rigid impact map"),
    ]
