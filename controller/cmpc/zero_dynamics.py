"""ZD+PD: feedback linearisation of the outputs with a PD law on top, and the controller made of it alone."""

from typing import Any, NamedTuple

import numpy as np

from controller.belief import Law, Loop
from controller.belief.closed_loop import ZeroDynamicsStep, closed_loop, zero_dynamics
from controller.belief.kernels import N_Q, N_U, Stage, new_stage, place, stance_force
from controller.belief.stance import watch
from controller.common.compiled import Array, compiled
from controller.common.entry import Bound, bind
from controller.common.held import Held, held
from controller.common.records import (
    ControlStep,
    Observation,
    Rows,
    Status,
    Vector,
)


def zero_dynamics_pd(loop: Loop, q: Vector, dq: Vector) -> ZeroDynamicsStep:
    """Torque u = (L_g L_f h)^-1 (v - L_f^2 h) with v = -K_D dy - K_P y.

    Implements: Eqs. (6)-(9).

    Args:
        loop: The walker believed in, its outputs, and the diagonals of K_P and K_D.
        q: Coordinates in [rad], (5,).
        dq: Rates in [rad/s], (5,).
    """
    step: ZeroDynamicsStep = zero_dynamics(loop, q, dq)
    return step


ZD_PD = list(Status).index(Status.ZD_PD)


class Parts(NamedTuple):
    """All that a tick works on: the closed loop, and scratch for its state, what follows from it, and its force."""

    loop: Loop
    q: Array
    dq: Array
    stage: Stage
    force: Array


@compiled
def decide(parts: Any, memory: Any, seen: Any, step: Any, i: int) -> bool:
    """Fill row `i` of `step` from that of `seen`: `zero_dynamics` without new memory. There is always a decision."""
    loop, q, dq, stage, force = held(parts)
    watch(memory, loop.walker, seen[i], q, dq)
    place(q, dq, stage)
    theta, dtheta = closed_loop(loop, q, dq, stage)
    stance_force(loop.walker, stage, force)
    m, out = memory[0], step[i]
    for j in range(N_U):
        joint = j ^ m.leg
        out.u_total[joint] = out.u_zd[joint] = m.torque[joint] = stage.u[j]
        out.u_mpc[j] = 0.0
        out.y[j], out.dy[j] = stage.y[j], stage.dy[j]
    out.theta, out.dtheta = theta, dtheta
    out.s = (theta - loop.gait.theta_start) / loop.gait.theta_span
    out.contact_force[0], out.contact_force[1] = force[0], force[1]
    out.residuals[:] = 0.0
    out.slack = out.solve_s = out.followed = 0.0
    out.impact_in, out.iterations, out.active = -1, 0, 0
    out.status, out.stance, out.fallback = ZD_PD, m.leg, 0
    return True


class ZeroDynamicsController(Law):
    """The paper's first layer on its own (`zd-pd`)."""

    _held: Held | None = None

    def step(self, observation: Observation) -> ControlStep:
        """One tick: which leg stands, then Eq. (7)."""
        state = self.stance.update(observation)
        zd = zero_dynamics_pd(self.loop, state.q, state.dq)
        return self.held(
            ControlStep.of(
                state.leg,
                zd.u,
                u_zd=zd.u,
                y=zd.y,
                dy=zd.dy,
                theta=zd.theta,
                dtheta=zd.dtheta,
                s=self.gait.normalised(zd.theta),
                contact_force=zd.contact_force,
                status=Status.ZD_PD,
            )
        )

    def decide(self, seen: Rows, step: Rows, i: int) -> None:
        """The same from row to row, in compiled code."""
        decide(self._kept(), self.stance.memory, seen, step, i)

    def bound(self, seen: Rows, step: Rows) -> Bound | None:
        """The kernel of `decide`, with rows of these types."""
        if type(self) is not ZeroDynamicsController:
            return None  # one that may do more
        return bind(decide, (self._kept(), self.stance.memory), (seen, step, 0))

    def _kept(self) -> Held:
        if self._held is None or self._held.value.loop is not self.loop:
            self._held = Held(Parts(self.loop, np.empty(N_Q), np.empty(N_Q), new_stage(), np.empty(2)))
        return self._held

    def plan(self) -> None:
        """There is none."""
