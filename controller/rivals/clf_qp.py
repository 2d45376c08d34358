"""`clf-qp`: a rapidly exponentially stabilising control Lyapunov function, held by a QP within the torque limits.

Galloway, Sreenath, Ames and Grizzle, "Torque saturation in bipedal robotic walking through control Lyapunov
function-based quadratic programs", IEEE Access 2015, with the Lyapunov function of Ames, Galloway, Sreenath and
Grizzle, IEEE Trans. Automatic Control 2014. With the torque u = u* + (L_g L_f h)^-1 mu, u* = -(L_g L_f h)^-1 L_f^2 h,
the outputs eta = (y, dy) obey

    deta = F eta + G mu,  F = [0 I; 0 0],  G = [0; I].

P solves F'P + PF - PGG'P + Q = 0, here with Q = I. Then V(eta) = eta' P_e eta with P_e = diag(I/e, I) P diag(I/e, I)
falls at least as exp(-gamma t/e), gamma = lambda_min(Q) / lambda_max(P), under any mu with psi_0 + psi_1 mu <= 0, where

    psi_0 = eta' (F'P_e + P_e F) eta + gamma/e V,  psi_1 = 2 eta' P_e G,

and the least such mu is asked for; delta relaxes it where the torque limits, which are hard, leave no other choice:

    minimise mu' mu + p delta^2  subject to  psi_0 + psi_1 mu <= delta,  -u_max <= u* + (L_g L_f h)^-1 mu <= u_max.

Contact-force rows, which later versions have, are there unless switched off; they are softened.

Tuning (`controller.rivals` says on what): e = 0.015 and p = 10 had the least mean RMS, 1.9 mrad, of e from 0.012 to
0.02 and p from 1 to 100; a larger e is slower, a smaller one spends the friction under +20 N. A larger Q acts like a
smaller e; other shapes of Q, tried at e = 0.01 and without the +20 N, were no better. Where a push saturates it the law
is greedy and its torques chatter between their limits (push-25N: 203 of 1276 ticks jump by more than 20 N.m); p = 1 has
next to none of that, and 40 % more RMS.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
import qpsolvers
from scipy.linalg import solve_continuous_are

from controller.belief.friction import Friction, matrix
from controller.common.records import Status, Vector
from controller.common.settings import ClfSettings
from controller.rivals import dense_qp
from controller.rivals.dense_qp import Applied
from controller.rivals.law import Decision
from controller.rivals.output_dynamics import OutputDynamics

F = np.kron([[0.0, 1.0], [0.0, 0.0]], np.eye(4))
G = np.kron([[0.0], [1.0]], np.eye(4))
MISSED = 0.01  # share of the guaranteed decay of V from which on missing it is reported


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lyapunov:
    """V(eta) = eta' P eta and the rate it is made to fall at.

    Attributes:
        P: P_e, (8, 8).
        rate: gamma/e in [1/s].
    """

    P: Vector
    rate: float

    @classmethod
    def rapid(cls, epsilon: float) -> "Lyapunov":
        """The RES-CLF of Q = I; the smaller epsilon, the faster."""
        P = solve_continuous_are(F, G, np.eye(8), np.eye(4))
        gamma = 1.0 / np.linalg.eigvalsh(P).max()
        fast = np.diag([1.0 / epsilon] * 4 + [1.0] * 4)
        return cls(P=fast @ P @ fast, rate=float(gamma / epsilon))

    def value(self, eta: Vector) -> float:
        """V at eta, (8,)."""
        return float(eta @ self.P @ eta)

    def derivative(self, eta: Vector) -> tuple[float, Vector]:
        """The two parts of dV/dt = L_F V + L_G V mu: a number and (4,)."""
        return float(2.0 * eta @ self.P @ F @ eta), 2.0 * eta @ self.P @ G


class ClfQp:
    """The law: from the output dynamics to mu."""

    @classmethod
    def of(cls, settings: ClfSettings, *, limit: Vector, friction: Friction | None) -> "ClfQp":
        """The law with V of `settings.epsilon`; the other arguments are those of the constructor."""
        return cls(Lyapunov.rapid(settings.epsilon), penalty=settings.penalty, limit=limit, friction=friction)

    def __init__(self, lyapunov: Lyapunov, *, penalty: float, limit: Vector, friction: Friction | None) -> None:
        """Put the parts together.

        Args:
            lyapunov: V.
            penalty: p on delta^2.
            limit: Torque limits in [N.m], (4,).
            friction: Contact-force limits, softened as in the cascades; None to leave them out, as the paper does.
        """
        self.lyapunov, self.penalty, self.limit, self.friction = lyapunov, penalty, limit, friction

    def decide(self, dynamics: OutputDynamics) -> Decision:
        """Build and solve the QP of one tick."""
        problem = self.problem(dynamics)
        per_x = np.zeros((4, len(problem.q)))
        per_x[:, :4] = np.linalg.inv(dynamics.decoupling)
        applied = Applied(dynamics.torque(np.zeros(4)), per_x, 0.5 * per_x, self.limit, row=1)  # mu costs mu' mu
        answer = dense_qp.solve(problem, applied)
        mu, delta, softening = answer.x[:4], answer.x[4], answer.x[5:]
        eta = np.concatenate([dynamics.y, dynamics.dy])
        guaranteed = self.lyapunov.rate * self.lyapunov.value(eta)
        # With no limit active delta is not quite 0 either, as p is finite; that is no contradiction.
        if answer.active > 1 and delta > MISSED * guaranteed:
            answer = dataclasses.replace(answer, status=Status.RELAXED)
        return Decision(v=mu, answer=answer, slack=float(softening.max(initial=0.0)))

    def problem(self, dynamics: OutputDynamics) -> qpsolvers.Problem:
        """The QP over (mu, delta) and, with contact-force limits, their softening in [N], (3,)."""
        V = self.lyapunov
        eta = np.concatenate([dynamics.y, dynamics.dy])
        L_F, L_G = V.derivative(eta)
        u_star, per_mu = dynamics.torque(np.zeros(4)), np.linalg.inv(dynamics.decoupling)
        rows = [
            (L_G[None, :], np.array([-L_F - V.rate * V.value(eta)])),
            (per_mu, self.limit - u_star),
            (-per_mu, self.limit + u_star),
        ]
        if self.friction is not None:
            cone, bound = matrix(self.friction)
            force = dynamics.force + dynamics.force_per_torque @ u_star
            rows.append((cone @ dynamics.force_per_torque @ per_mu, bound - cone @ force))
        on_mu, h = (np.concatenate(part) for part in zip(*rows, strict=True))
        soft = [0, *range(9, len(h))]  # psi, and the contact-force rows: one relaxation each
        on_relaxation = np.zeros((len(h), len(soft)))
        on_relaxation[soft, range(len(soft))] = -1.0
        cost = [1.0] * 4 + [self.penalty] + ([self.friction.penalty] * 3 if self.friction is not None else [])
        return qpsolvers.Problem(P=2.0 * np.diag(cost), q=np.zeros(len(cost)), G=np.hstack([on_mu, on_relaxation]), h=h)
