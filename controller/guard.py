"""A controller from outside as the loop knows controllers: what it gives is checked, where it breaks is said."""

import contextlib
import dataclasses
import operator
import signal
import threading
from collections.abc import Iterator, Mapping
from time import monotonic
from typing import Any

import numpy as np

from controller.belief import Gait, StanceEstimator, WalkerModel, kernels
from controller.belief.closed_loop import outputs
from controller.belief.stance import calm, take
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
    observation_of,
)

_SHAPES = {
    "u_total": (4,),
    "u_zd": (4,),
    "u_mpc": (4,),
    "y": (4,),
    "dy": (4,),
    "contact_force": (2,),
    "residuals": (3,),
}
_WHOLE, _REAL = (int, np.integer), (int, float, np.integer, np.floating)
_SCALARS = dict.fromkeys(("impact_in", "iterations", "active"), _WHOLE) | dict.fromkeys(
    ("theta", "dtheta", "s", "slack", "solve_s", "followed"), _REAL
)
_KINDS = tuple(int if kinds is _WHOLE else float for kinds in _SCALARS.values())
_arrays, _numbers, _FLOAT = operator.attrgetter(*_SHAPES), operator.attrgetter(*_SCALARS), np.dtype(float)
_LEGS = ("left", "right")
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
                    f"controller {outside.kind}: its factory gave {_kind(inner)}, which has no {name}(); "
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
            raise ControllerFailed(f"{self.where} gave {_kind(given)}; must be {_TORQUE}, or a ControlStep")
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
        if step.diagnostics:
            self._check_diagnostics(step.diagnostics)
        plain = step.plan is None and step.stance in _LEGS
        return step if plain and _in_shape(step) else self._looked_at(step)

    def _looked_at(self, step: ControlStep) -> ControlStep:
        """What is nearly as it must be, made so."""
        changed: dict[str, Any] = {}
        for name, shape in _SHAPES.items():
            value = getattr(step, name)
            if type(value) is not np.ndarray or value.dtype != np.float64:
                try:
                    value = changed[name] = np.array(value, dtype=float)
                except (TypeError, ValueError):
                    raise self._wrong(f"ControlStep.{name} = {_kind(value)}", shape) from None
            if value.shape != shape:
                raise self._wrong(f"ControlStep.{name} = {_kind(value)}", shape)
        for name, kinds in _SCALARS.items():
            value = getattr(step, name)
            if not isinstance(value, kinds):
                raise ControllerFailed(f"{self.where} gave ControlStep.{name} = {_kind(value)}; must be a number")
        if step.plan is not None and not callable(getattr(step.plan, "outputs", None)):
            raise ControllerFailed(f"{self.where} gave ControlStep.plan = {_kind(step.plan)}; must be None or a Plan")
        if step.stance not in _LEGS:
            raise ControllerFailed(
                f"controller {self._kind}: ControlStep.stance = {step.stance!r}: must be left or right"
            )
        return dataclasses.replace(step, **changed) if changed else step

    def _check_diagnostics(self, given: Any) -> None:
        if not isinstance(given, Mapping):
            raise ControllerFailed(
                f"controller {self._kind}: ControlStep.diagnostics is {_kind(given)}; "
                'must be a dict such as {"push [N]": 3.0}'
            )
        for name, value in given.items():
            if type(value) is float and type(name) is str:
                continue
            if not isinstance(name, str) or not isinstance(value, int | float | np.number):
                raise ControllerFailed(
                    f"controller {self._kind}: ControlStep.diagnostics[{name!r}] is {_kind(value)}; must be a number"
                )

    def _failed(self, method: str, error: BaseException) -> ControllerFailed:
        called = _at(getattr(self.inner, method))
        return ControllerFailed(f"controller {self._kind}: {method}(): {place(error, self._file, called)}")

    def _wrong(self, what: str, shape: tuple[int, ...]) -> ControllerFailed:
        return ControllerFailed(f"{self.where} gave {what}; must be an array of {shape[0]} numbers")


def _in_shape(step: ControlStep) -> bool:
    """Whether arrays and numbers are just as they must be; false of what has to be looked at more closely."""
    for value, shape in zip(_arrays(step), _SHAPES.values(), strict=True):
        if type(value) is not np.ndarray or value.dtype is not _FLOAT or value.shape != shape:
            return False
    return tuple(map(type, _numbers(step))) == _KINDS


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


def _kind(value: Any) -> str:
    """What a value is, in a few words."""
    if value is None:
        return "None"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if isinstance(value, list | tuple):
        return f"a {type(value).__name__} of {len(value)}"
    return f"{value!r:.40}" if isinstance(value, str | int | float) else f"a {type(value).__name__}"
