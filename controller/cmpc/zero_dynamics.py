"""ZD+PD: feedback linearisation of the outputs with a PD law on top, and the controller made of it alone."""

from typing import Any

import numpy as np

from controller.belief import Law, Loop
from controller.belief.closed_loop import ZeroDynamicsStep, zero_dynamics
from controller.belief.kernels import N_Q, N_U
from controller.belief.stance import watch
from controller.common.compiled import compiled
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


@compiled
def decide(loop: Any, memory: Any, seen: Any, step: Any, i: int) -> None:
    """Fill row `i` of `step` from that of `seen`."""
    q, dq = np.empty(N_Q), np.empty(N_Q)
    those = held(loop)
    watch(memory, those.walker, seen[i], q, dq)
    zd = zero_dynamics(those, q, dq)
    m, out = memory[0], step[i]
    for joint in range(N_U):
        out.u_total[joint ^ m.leg] = out.u_zd[joint ^ m.leg] = m.torque[joint ^ m.leg] = zd.u[joint]
        out.u_mpc[joint] = 0.0
        out.y[joint], out.dy[joint] = zd.y[joint], zd.dy[joint]
    out.theta, out.dtheta = zd.theta, zd.dtheta
    out.s = (zd.theta - those.gait.theta_start) / those.gait.theta_span
    out.contact_force[0], out.contact_force[1] = zd.contact_force[0], zd.contact_force[1]
    out.residuals[:] = 0.0
    out.slack = out.solve_s = out.followed = 0.0
    out.impact_in, out.iterations, out.active = -1, 0, 0
    out.status, out.stance, out.fallback = ZD_PD, m.leg, 0


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
        if self._held is None or self._held.value is not self.loop:
            self._held = Held(self.loop)
        return self._held

    def plan(self) -> None:
        """There is none."""
