"""The walk found, as a controller: its torques alone, or with a linear-quadratic regulator that holds on to it."""

from typing import Any

import casadi as ca
import numpy as np

from controller.belief import StanceEstimator, WalkerModel
from controller.belief.lumped import H
from controller.common.records import ControlStep, Observation, Vector
from controller.limit import mechanics
from controller.limit.walk import Motion, Phase, state_at

GRID = 5e-3  # [s] of the regulator
EFFORT = 2e-4  # weight on torques in [1/(N.m)^2]; 1 on angles in [1/rad^2]
RATE = 0.2  # weight on rates in [s^2/rad^2]


class Follower:
    """A controller that plays a walk, clock in hand.

    A step that lands early begins the next one early; one that lands late holds its last torques until it does.
    """

    def __init__(self, model: WalkerModel, motion: Motion, phases: tuple[Phase, ...], *, regulate: bool) -> None:
        """Put the parts together.

        Args:
            model: The walker.
            motion: The walk.
            phases: Its structure.
            regulate: Whether to hold on to it; its torques alone if not, which an unstable walk leaves.
        """
        self._model, self._motion, self._phases = model, motion, phases
        self._stance = StanceEstimator(model)
        self._starts = _starts(motion, phases)
        self._gains = _regulator(model, motion, phases) if regulate else None
        self.reset("left")

    def reset(self, stance: str) -> None:
        """Begin again; `stance` is the leg that stands, "left" or "right"."""
        self._stance.reset(stance)
        self._step, self._began = 0, 0.0

    def step(self, observation: Observation) -> ControlStep:
        """One tick."""
        leg = self._stance.leg
        state = self._stance.update(observation)
        if state.leg is not leg:
            self._step, self._began = min(self._step + 1, len(self._starts) - 2), observation.t
        start, end = self._starts[self._step], self._starts[self._step + 1]
        t = min(start + observation.t - self._began, end - 1e-9)
        p, w, u, _ = state_at(self._motion, self._phases, t)
        off = np.concatenate((H @ state.q - p, H @ state.dq - w))
        if self._gains is not None:
            u = u - self._gains[min(int(t / GRID), len(self._gains) - 1)] @ off
        limit = self._model.torque_limits
        figures = {"off the walk [rad]": float(np.abs(off[:5]).max())}
        return ControlStep.of(state.leg, np.clip(u, -limit, limit), diagnostics=figures)


def _starts(motion: Motion, phases: tuple[Phase, ...]) -> list[float]:
    """When each step begins, and the end of the last, in [s]."""
    starts, now = [0.0], 0.0
    for phase, t in zip(phases, motion.times, strict=True):
        now += t
        if phase.lands:
            starts.append(now)
    return starts


def _regulator(model: WalkerModel, motion: Motion, phases: tuple[Phase, ...]) -> list[Vector]:
    """Gains on link angles and rates, (4, 10), every `GRID` from the start; each step by itself."""
    links = mechanics.links_of(model)
    p, w, a, u = ca.SX.sym("p", 5), ca.SX.sym("w", 5), ca.SX.sym("a", 5), ca.SX.sym("u", 4)
    push = ca.SX.sym("push")
    missing = mechanics.imbalance(links, p, w, a, u, push)
    by_a = ca.jacobian(missing, a)
    free = -ca.solve(by_a, ca.substitute(missing, a, ca.DM.zeros(5)))  # acceleration
    slopes = [-ca.solve(by_a, ca.jacobian(missing, x)) for x in (ca.vertcat(p, w), u)]
    linear = ca.Function("linear", [p, w, u, push], [ca.substitute(slope, a, free) for slope in slopes])
    starts = _starts(motion, phases)
    times = np.arange(0.0, starts[-1], GRID)
    ends = np.cumsum(motion.times)
    Q, R = GRID * np.diag([1.0] * 5 + [RATE] * 5), GRID * EFFORT * np.eye(4)
    gains: list[Vector] = []
    S = 10.0 * Q / GRID
    for t in times[::-1]:
        p0, w0, u0, step = state_at(motion, phases, float(t))
        if t + GRID >= starts[step + 1]:
            S = 10.0 * Q / GRID
        phase = phases[min(int(np.searchsorted(ends, t, side="right")), len(phases) - 1)]
        by_x, by_u = (np.array(m) for m in linear(p0, w0, u0, motion.disturbance if phase.pushed else 0.0))
        A = np.eye(10) + GRID * np.vstack((np.hstack((np.zeros((5, 5)), np.eye(5))), by_x))
        B = np.vstack((0.5 * GRID * GRID * by_u, GRID * by_u))
        K: Any = np.linalg.solve(R + B.T @ S @ B, B.T @ S @ A)
        S = Q + A.T @ S @ (A - B @ K)
        S = 0.5 * (S + S.T)
        gains.append(K)
    return gains[::-1]
