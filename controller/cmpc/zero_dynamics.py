"""ZD+PD: feedback linearisation of the outputs with a PD law on top, and the controller made of it alone."""

from controller.belief import Law, Loop
from controller.belief.closed_loop import ZeroDynamicsStep, zero_dynamics
from controller.records import ControlStep, Observation, Status, Vector


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


class ZeroDynamicsController(Law):
    """The paper's first layer on its own (`zd-pd`)."""

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
