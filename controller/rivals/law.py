"""What the rivals share: which leg stands, the output dynamics, a law that chooses v, and the torque that makes it so.

In the records of these controllers u_zd is the feed-forward u* = -(L_g L_f h)^-1 L_f^2 h of the input-output
linearisation, and u_mpc the rest, (L_g L_f h)^-1 v: there is no ZD+PD inside.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from controller.belief import Gains, Gait, Law, WalkerModel
from controller.common.records import ControlStep, Observation, Plan, Status, Vector
from controller.rivals.dense_qp import Answer, no_answer
from controller.rivals.output_dynamics import OutputDynamics, output_dynamics


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decision:
    """What a law wants of the outputs.

    Attributes:
        v: Output acceleration in [rad/s^2], (4,), if the answer was found.
        answer: Of the QP behind it.
        slack: Largest softening of a contact-force row in [N].
        plan: What is expected over a horizon, if there is one.
    """

    v: Vector
    answer: Answer
    slack: float = 0.0
    plan: Plan | None = None


DIVERGED = Decision(v=np.zeros(4), answer=no_answer(0, Status.PREDICTION_DIVERGED))
"""Where the state is so far out that the output dynamics overflow."""


class OutputLaw(Protocol):
    """Chooses the output acceleration."""

    def decide(self, dynamics: OutputDynamics) -> Decision:
        """One tick; it keeps nothing for the next."""


class OutputController(Law):
    """A law on the linearised outputs as a controller."""

    def __init__(self, model: WalkerModel, gait: Gait, gains: Gains, law: OutputLaw) -> None:
        """Put the parts together.

        Args:
            model: The walker believed in; its torque limits are the box.
            gait: The outputs.
            gains: Of the ZD+PD law to fall back to.
            law: Chooses v.
        """
        super().__init__(model, gait, gains)
        self.law = law

    def step(self, observation: Observation) -> ControlStep:
        """One tick."""
        state = self.stance.update(observation)
        dynamics = output_dynamics(self.loop.walker, self.loop.gait, state.q, state.dq)
        decision = self.law.decide(dynamics) if dynamics.is_finite else DIVERGED
        answer = decision.answer
        zd_pd = -self.loop.gains.kd * dynamics.dy - self.loop.gains.kp * dynamics.y  # Eq. (9), the one fall-back policy
        u_star = dynamics.torque(np.zeros(4))
        limit = self.model.torque_limits
        # A law keeps to the limits up to rounding; the fall-back does not know them.
        u_total = np.clip(dynamics.torque(decision.v if answer.found else zd_pd), -limit, limit)
        return self.held(
            ControlStep.of(
                state.leg,
                u_total,
                u_zd=u_star,
                u_mpc=u_total - u_star,
                y=dynamics.y,
                dy=dynamics.dy,
                theta=dynamics.theta,
                dtheta=dynamics.dtheta,
                s=self.gait.normalised(dynamics.theta),
                contact_force=dynamics.force + dynamics.force_per_torque @ u_total,
                status=answer.status,
                fallback=not answer.found,
                residuals=answer.residuals,
                slack=decision.slack,
                active=answer.active,
                solve_s=answer.solve_s,
                plan=decision.plan,
            )
        )
