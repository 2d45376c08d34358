"""The planner in simulated time: when it looks, what it starts from, when its answer is used."""

import time
from dataclasses import dataclass

import numpy as np

from controller.belief import kernels
from controller.common.compiled import Array, compiled
from controller.common.records import Vector
from controller.common.settings import PlanSettings
from controller.plan.cost import Price
from controller.plan.dynamics import N_U, N_X, World, advance, new_rates
from controller.plan.motion import Motion, new_motion
from controller.plan.shift import exchange, shift
from controller.plan.solve import Figures, Workspace, improve, new_workspace

LEAST = 0.015  # [s] that a step planned has left


@compiled
def _interval(plan: Motion, since: float) -> int:
    """Of the first step, that a time after the plan's beginning in [s] falls into."""
    intervals = (plan.u.shape[0] + 1) // plan.T.shape[0] - 1
    return min(int(since / plan.T[0] * intervals + 1e-9), intervals - 1)


@compiled
def act(
    world: World, plan: Motion, K: Array, limit: Array, since: float, period: float, x: Array, expected: Array, u: Array
) -> None:
    """Torque of a tick under a plan, and on with what it expects.

    Args:
        world: As the plan believes it.
        plan: The motion planned.
        K: Feedback about it, (N, 4, nz).
        limit: Torque limits in [N.m], (4,).
        since: The plan began in [s].
        period: Of a tick in [s].
        x: State measured, (10,).
        expected: State expected, (10,); that of the next tick afterwards.
        u: Filled: torque in [N.m], (4,).
    """
    j = _interval(plan, since)
    for i in range(N_U):
        v = plan.u[j, i]
        for m in range(N_X):
            v += K[j, i, m] * (x[m] - expected[m])
        u[i] = min(max(v, -limit[i]), limit[i])
    rates = new_rates()
    advance(world, plan.u[j], period, kernels.new_stage(), rates, rates, expected)


@compiled
def look_ahead(
    world: World, plan: Motion, K: Array, limit: Array, since: float, period: float, ticks: int, x: Array,
    expected: Array,
) -> None:  # fmt: skip
    """Where a plan leads to some ticks later, x and expected in place."""
    u, rates, stage = np.empty(N_U), new_rates(), kernels.new_stage()
    for tick in range(ticks):
        act(world, plan, K, limit, since + tick * period, period, x, expected, u)
        advance(world, u, period, stage, rates, rates, x)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Followed:
    """A plan as it is followed at a tick.

    Attributes:
        world: Walker, push and ground that it was made for.
        plan: The motion planned.
        K: Feedback about it, (N, 4, nz).
        since: It began in [s].
        expected: State that it expects now, (10,).
    """

    world: World
    plan: Motion
    K: Array
    since: float
    expected: Vector


class Planner:
    """Keeps a plan, follows it, and makes a new one now and then; a plan is used `delay` after what it starts from.

    Attributes:
        price: Cost and limits.
        figures: Of the last plan made, None before the first.
        made: Whether the last tick made a plan.
        solve_s: Wall time of that in [s], for the log alone.
    """

    def __init__(self, price: Price, gait: Workspace, settings: PlanSettings, world: World, period: float) -> None:
        """Args: price: cost; gait: the plan that is the gait; settings; world: undisturbed; period: of ticks in [s]."""
        self.price, self._gait, self._settings, self._period = price, gait, settings, period
        self._world = world
        P, K = settings.steps, settings.intervals
        self._intervals, self._P = K, P
        self._delay, self._every = round(settings.delay / period), max(1, round(settings.every / period))
        self._making, self._K, self._plan = new_workspace(P, K), np.zeros_like(gait.K), new_motion(P, K)
        self._scratch = np.zeros_like(gait.K)
        exchange(self._making.plan, self._making.K, price.time)  # compiled, or loaded, before the first tick
        self.reset()

    def reset(self) -> None:
        """Start from the gait."""
        _copy(self._gait.plan, self._plan)
        self._K[:] = self._gait.K
        self.figures: Figures | None = None
        self._used = self._world  # what the plan followed was made for
        self._ticks = 0  # since the plan followed began
        self._elapsed = 0  # ticks since the step began
        self._waiting = -1  # ticks until the plan made is used
        self._expected = self._plan.x[0].copy()
        self._before = self._expected  # what the plan expected in the last tick
        self._next = 0
        self.made, self.solve_s = False, 0.0

    @property
    def found(self) -> bool:
        """Whether the last plan made is one."""
        return self.figures is None or self.figures.found

    @property
    def left(self) -> float:
        """Time this step has left in [s]."""
        return max(float(self._plan.T[0]) - self._ticks * self._period, 0.0)

    @property
    def followed(self) -> Followed:
        """The plan followed in the last tick; copies, since the plan goes on."""
        plan = Motion(*(a.copy() for a in self._plan))
        since = (self._ticks - 1) * self._period
        return Followed(world=self._used, plan=plan, K=self._K.copy(), since=since, expected=self._before)

    @property
    def landing(self) -> Vector:
        """State before the landing planned, (10,)."""
        return self._plan.x[self._intervals]

    def landed(self, x: Vector) -> None:
        """The legs have been exchanged; x is the state after it, (10,)."""
        if self.figures is None:
            _copy(self._gait.plan, self._plan)
        exchange(self._plan, self._K, self.price.time)
        first = 0 if self.figures is None else (self._P - 1) * (self._intervals + 1)
        self._plan.x[first:] = self._gait.plan.x[first:]
        self._plan.u[first:] = self._gait.plan.u[first:]
        self._K[first:] = self._gait.K[first:]
        self._expected[:] = x
        self._ticks = self._elapsed = 0
        self._waiting = -1
        self._next = 0

    def stumbled(self) -> None:
        """The swing foot has run into a ledge: drop what is being planned without it, and plan at once."""
        self._waiting, self._next = -1, 0

    def tick(self, x: Vector, world: World, *, rest: bool = False) -> tuple[Vector, Vector]:
        """Torque of a tick and the planned one that it corrects in [N.m], (4,) each, stance order.

        Args:
            x: State measured, link angles and rates, (10,).
            world: Walker, push and ground as believed now.
            rest: Whether no plan is needed: the gait is the plan then.
        """
        self.made, self.solve_s = False, 0.0
        if rest:
            return self._rest(x)
        if self._waiting == 0:
            self._use()
        if self._next <= 0 and self._waiting < 0:
            self._make(x, world)
            if self._delay == 0:
                self._use()
        u, self._before = np.empty(N_U), self._expected.copy()
        planned = self._plan.u[_interval(self._plan, self._ticks * self._period)].copy()
        act(
            self._used, self._plan, self._K, self.price.limit, self._ticks * self._period, self._period, x,
            self._expected, u,
        )  # fmt: skip
        self._ticks += 1
        self._elapsed += 1
        self._waiting -= 1 if self._waiting >= 0 else 0
        self._next -= 1
        return u, planned

    def _rest(self, x: Vector) -> tuple[Vector, Vector]:
        """The gait is the plan, followed from where the walker is."""
        if self.figures is not None:
            elapsed = self._elapsed
            self.reset()
            self._ticks = self._elapsed = elapsed
        self._expected[:] = x
        self._ticks += 1
        self._elapsed += 1
        self._next = 0
        planned = self._plan.u[_interval(self._plan, self._ticks * self._period)].copy()
        return planned, planned

    def _make(self, x: Vector, world: World) -> None:
        """Plan from where the present plan will have led when the new one is used."""
        began = time.perf_counter()
        self._next = self._every
        w, period = self._making, self._period
        start, expected = x.copy(), self._expected.copy()
        look_ahead(
            world, self._plan, self._K, self.price.limit, self._ticks * period, period, self._delay, start, expected
        )  # fmt: skip
        _copy(self._plan, w.plan)
        w.K[:] = self._K
        shift(w.plan, w.K, (self._ticks + self._delay) * period, LEAST, w.other, self._scratch)
        self.figures = improve(
            self.price, world, start, (self._elapsed + self._delay) * period, self._settings.iterations, w
        )  # fmt: skip
        self._made_for = world
        self.made, self.solve_s = True, time.perf_counter() - began
        self._waiting = self._delay

    def _use(self) -> None:
        """Follow the plan made."""
        self._waiting = -1
        if not self.found:
            return
        _copy(self._making.plan, self._plan)
        self._K[:] = self._making.K
        self._expected[:] = self._plan.x[0]
        self._used = self._made_for
        self._ticks = 0


def _copy(source: Motion, target: Motion) -> None:
    target.x[:], target.u[:], target.T[:] = source.x, source.u, source.T
