"""A controller from outside as the loop knows controllers: what it gives is checked, where it breaks is said."""

import contextlib
import dataclasses
import signal
import threading
from collections.abc import Iterator
from time import monotonic
from typing import Any

import numpy as np

from controller.belief import Gait, StanceEstimator, WalkerModel, kernels
from controller.belief.closed_loop import outputs
from controller.belief.stance import calm, take
from controller.common.checked import checked, said
from controller.common.compiled import compiled
from controller.common.errors import ControllerFailed, UserError
from controller.common.outside import Outside, place
from controller.common.records import (
    JOINTS,
    OBSERVATION,
    STEP,
    ControlStep,
    Observation,
    Rows,
    Vector,
    observation_of,
)

_TORQUE = f"4 numbers [N.m], ordered {', '.join(JOINTS)}"

PATIENCE = 60.0  # [s] a controller from outside may take over one tick, its first with whatever it compiles


class Hung(BaseException):
    """Raised in the midst of code that takes too long, past whatever it catches."""


def guarded(controller: Any) -> "Guarded | None":
    """The controller from outside in a controller, whatever stands around it."""
    while not isinstance(controller, Guarded) and hasattr(controller, "inner"):
        controller = controller.inner
    return controller if isinstance(controller, Guarded) else None


@contextlib.contextmanager
def hangs_end(controller: Any) -> Iterator[None]:
    """End a tick of a controller from outside that takes longer than `PATIENCE`; in a main thread of POSIX alone."""
    watched = guarded(controller)
    main = threading.current_thread() is threading.main_thread()
    if watched is None or not main or not hasattr(signal, "setitimer"):
        yield
        return

    def look(signum: int, frame: object) -> None:
        if watched.since and monotonic() - watched.since > PATIENCE:
            raise Hung(f"no answer within {PATIENCE:g} s")

    before = signal.signal(signal.SIGALRM, look)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE / 8, PATIENCE / 8)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


class Guarded:
    """Its `step` may return a torque (4,) alone; stance leg, outputs and clock of the gait are then worked out here."""

    def __init__(self, inner: Any, outside: Outside, model: WalkerModel, gait: Gait) -> None:
        """Put the parts together.

        Args:
            inner: What the factory gave.
            outside: Where it comes from.
            model: The walker believed in.
            gait: The gait whose outputs are logged.

        Raises:
            UserError: it has no `reset` or no `step`.
        """
        for name in ("reset", "step"):
            if not callable(getattr(inner, name, None)):
                raise UserError(
                    f"controller {outside.kind}: its factory gave {said(inner)}, which has no {name}(); "
                    "must have reset(stance) and step(observation)"
                )
        self.inner = inner
        self._kind, self._file = outside.kind, outside.file
        self.where = f"controller {outside.kind}: step(){_at(inner.step)}"
        self.since = 0.0  # [s] when the code outside was entered, 0 while it is not
        self._stance = StanceEstimator(model)
        self._gait = gait
        _outputs(gait.table, gait.q_minus, gait.dq_minus)  # compiled, or loaded, before the first tick
        _fill(gait.table, self._stance.memory, np.zeros(1, OBSERVATION), np.zeros(1, STEP), 0, np.zeros(4))
        self._lacks_follow = not callable(getattr(inner, "follow", None))

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right".

        Raises:
            ControllerFailed: it broke.
        """
        self._stance.reset(stance)
        try:
            self.since = monotonic()
            self.inner.reset(stance)
        except (Exception, SystemExit, Hung) as error:
            raise self._failed("reset", error) from error
        finally:
            self.since = 0.0

    def follow(self, gait: Gait, rate_change: Any) -> None:
        """Follow another gait from now on.

        Raises:
            UserError: it cannot.
        """
        if self._lacks_follow:
            raise UserError(
                f"controller.gait_fitting.enabled: controller {self._kind} has no follow(gait, rate_change)"
            )
        self._gait = gait
        self.inner.follow(gait, rate_change)

    def step(self, observation: Observation) -> ControlStep:
        """One tick.

        Raises:
            ControllerFailed: it broke, or what it gave is no torque.
        """
        given = self._ask(observation)
        return self._checked(given) if isinstance(given, ControlStep) else self._of(self._torque(given), observation)

    def fill(self, seen: Rows, step: Rows, i: int) -> ControlStep | None:
        """One tick from row to row; what row `i` of `step` has not been filled with, if it has not.

        Raises:
            ControllerFailed: it broke, or what it gave is no torque.
        """
        observation = observation_of(seen[i])
        given = self._ask(observation)
        if isinstance(given, ControlStep):
            return self._checked(given)
        u = self._torque(given)
        return None if _fill(self._gait.table, self._stance.memory, seen, step, i, u) else self._of(u, observation)

    def _ask(self, observation: Observation) -> Any:
        try:
            self.since = monotonic()
            return self.inner.step(observation)
        except (Exception, SystemExit, Hung) as error:
            raise self._failed("step", error) from error
        finally:
            self.since = 0.0

    def _torque(self, given: Any) -> np.ndarray:
        try:
            u = np.array(given)
        except ValueError:  # rows of different lengths
            u = np.empty(0)
        if u.shape != (4,) or u.dtype.kind not in "biuf":
            raise ControllerFailed(f"{self.where} gave {said(given)}; must be {_TORQUE}, or a ControlStep")
        return u.astype(float, copy=False)

    def _of(self, u: np.ndarray, observation: Observation) -> ControlStep:
        state = self._stance.update(observation)
        theta, dtheta, y, dy = _outputs(self._gait.table, state.q, state.dq)
        return ControlStep(
            stance=state.leg.value,
            u_total=u,
            y=y,
            dy=dy,
            theta=theta,
            dtheta=dtheta,
            s=self._gait.normalised(theta),
        )

    def _checked(self, step: ControlStep) -> ControlStep:
        if step.plan is None:
            return checked(step, self._kind, self.where)
        if not all(callable(getattr(step.plan, name, None)) for name in ("outputs", "contact_forces")):
            raise ControllerFailed(
                f"{self.where} gave ControlStep.plan = {said(step.plan)}; "
                "must be None, or have outputs() and contact_forces()"
            )
        return dataclasses.replace(checked(step, self._kind, self.where), plan=GuardedPlan(step.plan, self))

    def foreseen(self, plan: Any, method: str, columns: int) -> Vector:
        """What a plan gives, columns checked.

        Raises:
            ControllerFailed: it broke, or gave something else.
        """
        try:
            self.since = monotonic()
            given = getattr(plan, method)()
        except (Exception, SystemExit, Hung) as error:
            raise self._failed(method, error, plan) from error
        finally:
            self.since = 0.0
        try:
            found = np.array(given, dtype=float)
        except (TypeError, ValueError):
            found = np.empty(0)
        if found.ndim != 2 or found.shape[1] != columns:
            where = f"controller {self._kind}: {method}(){_at(getattr(plan, method))}"
            raise ControllerFailed(f"{where} gave {said(given)}; must be rows of {columns} numbers, one a stage")
        return found

    def _failed(self, method: str, error: BaseException, of: Any = None) -> ControllerFailed:
        called = _at(getattr(of or self.inner, method))
        return ControllerFailed(f"controller {self._kind}: {method}(): {place(error, self._file, called)}")


class GuardedPlan:
    """What a controller from outside expects; checked when somebody looks."""

    def __init__(self, plan: Any, guard: Guarded) -> None:
        """Args: plan: of the controller; guard: that knows where it comes from."""
        self._plan, self._guard = plan, guard

    def outputs(self) -> Vector:
        """Predicted outputs in [rad], (N + 1, 4)."""
        return self._guard.foreseen(self._plan, "outputs", 4)

    def contact_forces(self) -> Vector:
        """Predicted stance contact forces in [N], (N, 2)."""
        return self._guard.foreseen(self._plan, "contact_forces", 2)


def _at(method: Any) -> str:
    """Where a method stands, in brackets; empty where that cannot be told."""
    code = getattr(getattr(method, "__func__", method), "__code__", None)
    return f" ({code.co_filename}, line {code.co_firstlineno})" if code else ""


@compiled
def _fill(gait, memory, seen, step, i, u):  # type: ignore[no-untyped-def]
    """Fill row `i` of `step` for a torque where no foot lands; whether it does not."""
    if not calm(memory, seen[i]):
        return False
    q, dq, stage = np.empty(kernels.N_Q), np.empty(kernels.N_Q), kernels.new_stage()
    take(memory, seen[i], q, dq)
    theta, dtheta = outputs(gait, q, dq, stage)
    m, out = memory[0], step[i]
    for j in range(kernels.N_U):
        out.u_total[j] = u[j]
        out.u_zd[j] = out.u_mpc[j] = 0.0
        out.y[j], out.dy[j] = stage.y[j], stage.dy[j]
    out.theta, out.dtheta, out.s = theta, dtheta, (theta - gait.theta_start) / gait.theta_span
    out.contact_force[:] = 0.0
    out.residuals[:] = 0.0
    out.slack = out.solve_s = out.followed = 0.0
    out.impact_in, out.iterations, out.active = -1, 0, 0
    out.status, out.stance, out.fallback = 0, m.leg, 0
    return True


@compiled
def _outputs(gait, q, dq):  # type: ignore[no-untyped-def]
    """Clock, its rate, outputs and theirs, Eq. (5)."""
    stage = kernels.new_stage()
    theta, dtheta = outputs(gait, q, dq, stage)
    return theta, dtheta, stage.y, stage.dy
