"""The paper's equations a second time, written plainly: Pinocchio's unpinned walker and dense NumPy matrices.

Nothing here calls `controller/` arithmetic; tests compare the two. Slow and literal on purpose. The left leg
stands, so stance order is body order.
"""

from collections.abc import Callable
from math import comb

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from controller.qp import StageQP

Array = NDArray[np.float64]

# Unpinned coordinates q_e = (hip x, hip z, torso, left hip, left knee, right hip, right knee), Pinocchio's order;
# the paper's q = (stance hip, swing hip, stance knee, swing knee, torso).
FROM_UNPINNED = [3, 5, 4, 6, 2]
HIP = slice(0, 2)
STANCE_FOOT, SWING_FOOT = "left_foot", "right_foot"
B_E = np.zeros((7, 4))
B_E[FROM_UNPINNED[:4], range(4)] = 1.0
B = np.vstack([np.eye(4), np.zeros((1, 4))])
R = np.eye(5)[[1, 0, 3, 2, 4]]


class Walker:
    """The unpinned (n + 2)-DoF walker of Sec. III.B, and its pinned quantities through q_e = (hip, q)."""

    def __init__(self, model: pin.Model) -> None:
        self.model, self.data = model, model.createData()
        self.damping = np.array(model.damping)

    def unpinned(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """q_e and dq_e with the stance foot at rest in the origin: dq_e = W dq."""
        q_e, dq_e = np.zeros(7), np.zeros(7)
        q_e[FROM_UNPINNED], dq_e[FROM_UNPINNED] = q, dq
        q_e[HIP] = -self.foot(q_e, STANCE_FOOT)
        dq_e[HIP] = -self.jacobian(q_e, STANCE_FOOT) @ dq_e
        return q_e, dq_e

    def foot(self, q_e: Array, foot: str) -> Array:
        """Position (x, z) in [m]."""
        pin.framesForwardKinematics(self.model, self.data, q_e)
        return self.data.oMf[self.model.getFrameId(foot)].translation[[0, 2]].copy()

    def jacobian(self, q_e: Array, foot: str) -> Array:
        """J_c, (2, 7)."""
        frame = self.model.getFrameId(foot)
        full = pin.computeFrameJacobian(self.model, self.data, q_e, frame, pin.LOCAL_WORLD_ALIGNED)
        return full[[0, 2]].copy()

    def jacobian_rate_times_rates(self, q_e: Array, dq_e: Array, foot: str) -> Array:
        """dJ_c/dt dq_e in [m/s^2], (2,)."""
        pin.forwardKinematics(self.model, self.data, q_e, dq_e, np.zeros(7))
        frame = self.model.getFrameId(foot)
        a = pin.getFrameClassicalAcceleration(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)
        return a.linear[[0, 2]].copy()

    def inertia(self, q_e: Array) -> Array:
        """D_e, (7, 7)."""
        upper = np.triu(pin.crba(self.model, self.data, q_e))  # Pinocchio promises the upper triangle only
        return upper + np.triu(upper, 1).T

    def bias(self, q_e: Array, dq_e: Array) -> Array:
        """C_e dq_e + G_e, (7,), without joint damping."""
        return pin.nonLinearEffects(self.model, self.data, q_e, dq_e).copy()

    def pin_map(self, q_e: Array) -> Array:
        """W of dq_e = W dq: what the pinned walker can do, (7, 5)."""
        W = np.zeros((7, 5))
        W[FROM_UNPINNED, range(5)] = 1.0
        W[HIP] = -self.jacobian(q_e, STANCE_FOOT) @ W
        return W

    def pinned(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """D, (5, 5), and C dq + G, (5,), of Eq. (2)."""
        q_e, dq_e = self.unpinned(q, dq)
        W, D_e = self.pin_map(q_e), self.inertia(q_e)
        dW_dq = np.zeros(7)
        dW_dq[HIP] = -self.jacobian_rate_times_rates(q_e, dq_e, STANCE_FOOT)
        return W.T @ D_e @ W, W.T @ (self.bias(q_e, dq_e) + D_e @ dW_dq)

    def acceleration(self, q: Array, dq: Array, u: Array) -> Array:
        """Ddq of Eqs. (1)-(2) under u, joint damping included, (5,)."""
        D, bias = self.pinned(q, dq)
        damping = self.damping[FROM_UNPINNED] * dq
        return np.linalg.solve(D, B @ u - bias - damping)

    def stance_force(self, q: Array, dq: Array, u: Array) -> tuple[Array, Array]:
        """F_c of Eq. (18) and -S_MPC of Eq. (20), literally."""
        q_e, dq_e = self.unpinned(q, dq)
        D_inv, J = np.linalg.inv(self.inertia(q_e)), self.jacobian(q_e, STANCE_FOOT)
        L = np.linalg.inv(J @ D_inv @ J.T)
        rest = self.bias(q_e, dq_e) + self.damping * dq_e
        dJ_dq = self.jacobian_rate_times_rates(q_e, dq_e, STANCE_FOOT)
        return L @ (J @ D_inv @ (-B_E @ u + rest) - dJ_dq), -L @ J @ D_inv @ B_E

    def impact(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """x+ = Delta(x-) of Eq. (3): [D_e -J'; J 0] [dq_e+; F] = [D_e dq_e-; 0] at the swing foot, then relabel."""
        q_e, dq_e = self.unpinned(q, dq)
        D_e, J = self.inertia(q_e), self.jacobian(q_e, SWING_FOOT)
        K = np.block([[D_e, -J.T], [J, np.zeros((2, 2))]])
        dq_e_plus = np.linalg.solve(K, np.concatenate([D_e @ dq_e, np.zeros(2)]))[:7]
        return R @ q, R @ dq_e_plus[FROM_UNPINNED]

    def energies(self, q: Array, dq: Array) -> tuple[float, float]:
        """Kinetic and potential energy of the pinned walker in [J]."""
        q_e, dq_e = self.unpinned(q, dq)
        kinetic = pin.computeKineticEnergy(self.model, self.data, q_e, dq_e)
        return float(kinetic), float(pin.computePotentialEnergy(self.model, self.data, q_e))


def bernstein(alpha: Array, s: float) -> Array:
    """Bezier polynomials in their textbook form, (rows,)."""
    M = alpha.shape[1] - 1
    return alpha @ np.array([comb(M, k) * s**k * (1 - s) ** (M - k) for k in range(M + 1)])


def outputs(alpha: Array, clock: Array, theta_plus: float, theta_minus: float, q: Array) -> Array:
    """Y of Eq. (5), (4,)."""
    return q[:4] - bernstein(alpha, (clock @ q - theta_plus) / (theta_minus - theta_plus))


def runge_kutta(f: Callable[[Array], Array], x: Array, duration: float, steps: int) -> Array:
    """Classical fourth-order integration of dx/dt = f(x)."""
    h = duration / steps
    for _ in range(steps):
        k1 = f(x)
        k2 = f(x + h / 2 * k1)
        k3 = f(x + h / 2 * k2)
        k4 = f(x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def condensed(
    *, T: float, DinvB: Array, e: Array, Q_position: Array, Q_velocity: Array, R_input: Array
) -> tuple[Array, Array, float]:
    """M, alpha and beta of Eq. (17) from the full stack of Eq. (15), dense.

    Args:
        T: Sampling time in [s].
        DinvB: D^-1 B at each stage, (N, 5, 4).
        e: Partial-prediction errors (y, dy) of stages 0 to N, (N + 1, 8).
        Q_position: Diagonal of the weight on y, (4,).
        Q_velocity: Diagonal of the weight on dy, (4,).
        R_input: Diagonal of R, (4,).

    Returns:
        J(U) = U' M U + 2 alpha' U + beta with U of (4 N,).
    """
    N = DinvB.shape[0]
    n = 10
    G = np.zeros((n * (N + 1), 4 * N))
    for j in range(N):
        g_j = np.vstack([DinvB[j] * T / 2, DinvB[j]])  # Eq. (12)
        for k in range(j + 1, N + 1):
            G[n * k : n * (k + 1), 4 * j : 4 * (j + 1)] = T * g_j  # Eq. (15)
    select = np.zeros((8, n))  # of x = (q, dq) the controlled coordinates and their rates
    select[range(4), range(4)] = 1.0
    select[range(4, 8), range(5, 9)] = 1.0
    E_of_U = np.kron(np.eye(N + 1), select) @ G
    F = e.ravel()
    Q = np.kron(np.diag(np.arange(N + 1.0)), np.diag(np.concatenate([Q_position, Q_velocity])))  # Sec. III.E
    M = E_of_U.T @ Q @ E_of_U + np.kron(np.eye(N), np.diag(R_input))
    return M, E_of_U.T @ Q @ F, float(F @ Q @ F)


def gradient(problem: StageQP, u: Array) -> Array:
    """Of the objective with softened rows, by the chain rule on w = cumsum(M u), (N, 4)."""
    w = np.cumsum(np.einsum("kij,kj->ki", problem.rate, u), axis=0)
    later = np.cumsum((problem.weight * w + problem.linear)[::-1], axis=0)[::-1]
    rows = problem.penalty * np.einsum("krj,kr->kj", problem.rows, problem.softening(u))
    return np.einsum("kij,ki->kj", problem.rate, later) + problem.R * u + rows


def gain(problem: StageQP, u: Array) -> float:
    """By how much u is better than no MPC, and the size of its cost: what an error is relative to."""
    best = problem.objective(u)
    return abs(best) + problem.objective(np.clip(0.0, problem.lower, problem.upper)) - best


def excess(problem: StageQP, u: Array) -> float:
    """By how much u may be worse than optimal at most, relative to its gain.

    The objective f is convex, so no v in the box is better than u by more than max over v of f'(u) (u - v).
    """
    slope = gradient(problem, u)
    v = np.where(slope > 0.0, problem.lower, problem.upper)
    return float(np.sum(slope * (u - v))) / gain(problem, u)
