"""The walk as a nonlinear program: Hermite-Simpson collocation of every phase, rigid impacts between the steps.

Variables of a phase are link angles, rates and accelerations and joint torques at 2 K + 1 points (ends and middles of K
intervals) and its duration; the equations of motion are constraints at every point (inverse dynamics), so that what
joins the points is linear in them (J. Betts, Practical Methods for Optimal Control, 2010, Eqs. (4.61), (4.64)). The
disturbance is one more variable.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from controller.belief import WalkerModel
from controller.common.records import Vector
from controller.limit import mechanics
from controller.limit.mechanics import Expression, Links
from controller.limit.walk import N_P, A, Bounds, Kind, P, Phase, U, W

EDGE = 0.01  # [m] over which a ledge rises, so that it has a derivative
LANDING = 0.03  # [m] a foothold keeps from a ledge
EFFORT = 1e-3  # of the objective: mean square of the torques over their limits, to choose among equals


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Task:
    """What is asked.

    Attributes:
        kind: What is maximised: a push in [N], a slope's tangent, a ledge's height in [m], a factor on the torso's
            mass, or (downwards) the friction.
        sign: 1 or -1: which way it is maximised.
        phases: Of the walk.
        pushed_time: Duration of the push in [s]; None for that of the phases it acts in.
        start: First state (link angles and rates, (10,)) by the disturbance; None for a periodic walk.
        end: Last state, (10,); None for a periodic walk.
        ledge_step: Number of the step that lands behind the ledge.
        elapsed: Time walked in the first step before the start in [s].
        fixed: A disturbance that is given: the walk of least torque under it is sought; None to maximise it.
    """

    kind: Kind
    sign: float
    phases: tuple[Phase, ...]
    pushed_time: float | None = None
    start: Callable[[Expression], Expression] | None = None
    end: Vector | None = None
    ledge_step: int = 1
    elapsed: float = 0.0
    fixed: float | None = None


class Program:
    """The nonlinear program of a task; `nlp` for CasADi, bounds beside it."""

    def __init__(self, model: WalkerModel, task: Task, bounds: Bounds) -> None:
        """Write it down.

        Args:
            model: The walker.
            task: What is asked.
            bounds: What the walk must keep.
        """
        self.model, self.task, self.bounds = model, task, bounds
        self._g: list[Expression] = []
        self._low: list[float] = []
        self._high: list[float] = []
        self._functions()
        self._z = [ca.MX.sym(f"z{i}", N_P, phase.points) for i, phase in enumerate(task.phases)]
        self._t = [ca.MX.sym(f"T{i}") for i in range(len(task.phases))]
        self._d, self._edge = ca.MX.sym("d"), ca.MX.sym("edge")
        self._write()
        flat = [y for z, t in zip(self._z, self._t, strict=True) for y in (ca.vec(z), t)]
        self.x = ca.vertcat(*flat, self._d, self._edge)
        self.f = self._objective()
        self.g = ca.vertcat(*self._g)
        self.g_low, self.g_high = np.array(self._low), np.array(self._high)
        self.x_low, self.x_high = self._box()

    def _functions(self) -> None:
        """What is asked at one point, compiled once and mapped over the points."""
        p, w, a, w2 = (ca.SX.sym(name, 5) for name in ("p", "w", "a", "w2"))
        u, d, edge, x0, share = (
            ca.SX.sym("u", 4),
            ca.SX.sym("d"),
            ca.SX.sym("edge"),
            ca.SX.sym("x0"),
            ca.SX.sym("share"),
        )
        push = ca.SX.sym("push")
        kind, b = self.task.kind, self.bounds
        links: Links = mechanics.links_of(self.model, d if kind == "load" else None)
        mu = d if kind == "friction" else b.friction
        angle = ca.atan(d) if kind == "slope" else 0.0
        tilt = (ca.cos(angle), ca.sin(angle)) if kind == "slope" else (1.0, 0.0)

        def along(x: Expression, z: Expression) -> tuple[Expression, Expression]:
            """Along and off the ground."""
            return tilt[0] * x + tilt[1] * z, tilt[0] * z - tilt[1] * x

        def ground(x: Expression) -> Expression:
            if kind == "slope":
                return d * x
            return d * 0.5 * (1.0 + ca.tanh((x - edge) / (0.5 * EDGE))) if kind == "ledge" else 0.0 * x

        force = along(*mechanics.stance_force(links, p, w, a, push))
        foot = mechanics.swing_foot(links, p)
        rate = along(*mechanics.swing_foot_rate(links, p, w))
        above = foot[1] + ground(x0) - ground(x0 + foot[0]) - b.clearance * 4.0 * share * (1.0 - share)
        q = mechanics.from_links(p)
        self._dynamics = ca.Function("dynamics", [p, w, a, u, push, d], [mechanics.imbalance(links, p, w, a, u, push)])
        kept = [
            (mu * force[1] - force[0]) / 100.0,
            (mu * force[1] + force[0]) / 100.0,
            (force[1] - b.normal_min) / 100.0,
            mechanics.hip_height(links, p) - b.hip,
            b.knee * q[2],
            b.knee * q[3],
            above,
        ]
        self._keep = ca.Function("keep", [p, w, a, push, d, edge, x0, share], [ca.vertcat(*kept)])
        self._foot = ca.Function(
            "foot", [p, w, x0, d, edge], [foot[0], foot[1] + ground(x0) - ground(x0 + foot[0]), rate[1]]
        )
        before, after = mechanics.com_momentum(links, p, w), mechanics.com_momentum(links, mechanics.mirrored(p), w2)
        impulse = along(after[0] - before[0], after[1] - before[1])
        lift = along(*mechanics.swing_foot_rate(links, mechanics.mirrored(p), w2))
        rows = ca.vertcat(mu * impulse[1] - impulse[0], mu * impulse[1] + impulse[0], lift[1])
        self._impact = ca.Function("impact", [p, w, w2, d], [mechanics.impact_imbalance(links, p, w, w2), rows])

    def _equal(self, *rows: Expression) -> None:
        self._between(0.0, 0.0, *rows)

    def _between(self, low: float, high: float, *rows: Expression) -> None:
        for row in rows:
            row = ca.vec(row)
            self._g.append(row)
            self._low += [low] * row.numel()
            self._high += [high] * row.numel()

    def _write(self) -> None:
        task, phases = self.task, self.task.phases
        steps = self._steps()
        x0: Expression = ca.MX(0.0)
        if task.start is not None:
            self._equal(self._z[0][:10, 0] - task.start(self._d))
        number = 0
        for step in steps:
            number += 1
            whole = sum(self._t[i] for i in step)
            elapsed: Expression = ca.MX(0.0)
            for i in step:
                self._phase(i, x0, elapsed, whole, first=i == step[0])
                elapsed = elapsed + self._t[i]
                if i != step[-1]:
                    self._equal(self._z[i + 1][:10, 0] - self._z[i][:10, -1])
            self._between(*self.bounds.time, whole + (task.elapsed if number == 1 else 0.0))
            last = self._z[step[-1]]
            length, height, rate = self._foot(last[P, -1], last[W, -1], x0, self._d, self._edge)
            if step is not steps[-1] or task.end is None:  # a last state that is given stands on the ground
                self._equal(height)
                self._between(-np.inf, 0.0, rate)
                self._between(*self.bounds.length, length)
            if task.kind == "ledge" and number == task.ledge_step:
                self._between(LANDING, np.inf, self._edge - x0, x0 + length - self._edge)
            following = step[-1] + 1
            if following < len(phases):
                self._strike(last, self._z[following])
            elif task.end is None:
                self._strike(last, self._z[0])
            x0 = x0 + length
        if task.end is not None:
            self._equal(self._z[-1][:10, -1] - ca.DM(task.end))
        if task.pushed_time is not None:
            self._equal(sum(t for t, phase in zip(self._t, phases, strict=True) if phase.pushed) - task.pushed_time)

    def _steps(self) -> list[list[int]]:
        """Phases of each step."""
        steps: list[list[int]] = [[]]
        for i, phase in enumerate(self.task.phases):
            steps[-1].append(i)
            if phase.lands and i + 1 < len(self.task.phases):
                steps.append([])
        return steps

    def _phase(self, i: int, x0: Expression, elapsed: Expression, whole: Expression, *, first: bool) -> None:
        phase, z, d = self.task.phases[i], self._z[i], self._d
        n, h = phase.points, self._t[i] / phase.intervals
        push = d if phase.pushed and self.task.kind == "push" else ca.MX(0.0)
        p, w, a, u = (z[part, :] for part in (P, W, A, U))
        row = ca.MX.ones(1, n)
        self._equal(self._dynamics.map(n)(p, w, a, u, push * row, d * row) / 10.0)
        share = (elapsed + self._t[i] * ca.DM(np.linspace(0.0, 1.0, n)).T) / whole
        kept = self._keep.map(n)(p, w, a, push * row, d * row, self._edge * row, x0 * row, share)
        self._between(0.0, np.inf, kept[:-1, :])
        # At its first point the foot is where the step before has left it, at the last where it lands.
        self._between(0.0, np.inf, kept[-1, 1 if first else 0 : n - 1 if phase.lands else n])
        left, middle, right = z[:, 0 : n - 1 : 2], z[:, 1:n:2], z[:, 2:n:2]
        for x, dx in ((P, W), (W, A)):
            self._equal(right[x, :] - left[x, :] - h / 6.0 * (left[dx, :] + 4.0 * middle[dx, :] + right[dx, :]))
            self._equal(middle[x, :] - 0.5 * (left[x, :] + right[x, :]) - h / 8.0 * (left[dx, :] - right[dx, :]))

    def _strike(self, last: Expression, first: Expression) -> None:
        missing, rows = self._impact(last[P, -1], last[W, -1], first[W, 0], self._d)
        self._equal(missing, first[P, 0] - ca.vertcat(*(last[j, -1] for j in mechanics.MIRROR)))
        self._between(0.0, np.inf, rows)

    def _objective(self) -> Expression:
        scale = {"push": 0.1 * self._most_push(), "slope": 1.0, "ledge": 0.2, "load": 3.0, "friction": 1.0}[
            self.task.kind
        ]
        effort: Expression = 0.0
        for z in self._z:
            effort = effort + ca.sumsqr(z[U, :] / ca.DM(self.bounds.torque)) / (4.0 * z.shape[1])
        if self.task.fixed is not None:
            return effort / len(self._z)
        return -self.task.sign * self._d / scale + EFFORT / len(self._z) * effort

    def _most_push(self) -> float:
        """Bound of a push in [N]; a short one may be as hard as an impulse of 100 N.s."""
        return max(500.0, 100.0 / (self.task.pushed_time or 1.0))

    def _box(self) -> tuple[Vector, Vector]:
        b = self.bounds
        low, high = np.full(N_P, -np.inf), np.full(N_P, np.inf)
        low[P], high[P] = -2.0 * np.pi, 2.0 * np.pi
        low[W], high[W] = -40.0, 40.0
        low[A], high[A] = -2e3, 2e3
        low[U], high[U] = -b.torque, b.torque
        low[4], high[4] = -b.torso, b.torso
        lows, highs = [], []
        for phase in self.task.phases:
            lows += [*np.tile(low, phase.points), 0.005]
            highs += [*np.tile(high, phase.points), b.time[1]]
        d_low, d_high = {
            "push": (-self._most_push(), self._most_push()),
            "slope": (-1.5, 1.5),
            "ledge": (-0.8, 0.8),
            "load": (0.2, 50.0),
            "friction": (1e-3, 3.0),
        }[self.task.kind]
        if self.task.fixed is not None:
            d_low = d_high = self.task.fixed
        return np.array([*lows, d_low, 0.0]), np.array([*highs, d_high, 2.0])
