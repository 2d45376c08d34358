"""ZD+PD: feedback linearisation of the outputs with a PD law on top, and the controller made of it alone."""

from dataclasses import dataclass

import numpy as np

from controller.belief import Gait, StanceEstimator, WalkerModel, kernels
from controller.records import ControlStep, Observation, Status, Vector

NO_TORQUE = np.zeros(4)  # [N.m]
NO_RESIDUALS = np.zeros(3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ZeroDynamicsStep:
    """The ZD+PD law at one state, stance order.

    Attributes:
        u: Torque of Eq. (7) in [N.m], (4,), not saturated.
        y: Outputs in [rad], (4,).
        dy: Output rates in [rad/s], (4,).
        theta: Clock in [rad].
        dtheta: Clock rate in [rad/s].
        ddq: Acceleration under u in [rad/s^2], (5,).
        contact_force: Stance force under u, (tangential, normal) in [N], (2,).
    """

    u: Vector
    y: Vector
    dy: Vector
    theta: float
    dtheta: float
    ddq: Vector
    contact_force: Vector


def zero_dynamics_pd(model: WalkerModel, gait: Gait, gains: kernels.Gains, q: Vector, dq: Vector) -> ZeroDynamicsStep:
    """Torque u = (L_g L_f h)^-1 (v - L_f^2 h) with v = -K_D dy - K_P y.

    Implements: Eqs. (6)-(9).

    Args:
        model: The walker believed in.
        gait: The outputs.
        gains: Diagonals of K_P in [1/s^2] and K_D in [1/s].
        q: Coordinates in [rad], (5,).
        dq: Rates in [rad/s], (5,).
    """
    theta, dtheta, u, y, dy, ddq, force = kernels.zero_dynamics(model.lumped, gait.table, gains, q, dq)
    return ZeroDynamicsStep(u=u, y=y, dy=dy, theta=theta, dtheta=dtheta, ddq=ddq, contact_force=force)


class ZeroDynamicsController:
    """The paper's first layer on its own (`zd-pd`)."""

    def __init__(self, model: WalkerModel, gait: Gait, gains: kernels.Gains) -> None:
        """Args are those of `zero_dynamics_pd`."""
        self.model, self.gait, self.gains = model, gait, gains
        self.stance = StanceEstimator(model)

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        self.stance.reset(stance)

    def follow(self, gait: Gait, rate_change: Vector) -> None:
        """Follow another gait from now on; its nominal clock rate does not matter here."""
        self.gait = gait

    def step(self, observation: Observation) -> ControlStep:
        """One tick: which leg stands, then Eq. (7)."""
        state = self.stance.update(observation)
        zd = zero_dynamics_pd(self.model, self.gait, self.gains, state.q, state.dq)
        u = state.leg.from_body(zd.u)
        return ControlStep(
            stance=state.leg.value,
            u_zd=u,
            u_mpc=NO_TORQUE,
            u_total=u,
            y=zd.y,
            dy=zd.dy,
            theta=zd.theta,
            dtheta=zd.dtheta,
            s=self.gait.normalised(zd.theta),
            contact_force=zd.contact_force,
            impact_in=-1,
            status=Status.ZD_PD,
            fallback=False,
            iterations=0,
            residuals=NO_RESIDUALS,
            slack=0.0,
            active=0,
            solve_s=0.0,
        )
