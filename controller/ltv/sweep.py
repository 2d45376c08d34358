"""Linear-quadratic problem over the stages of an `LtvHorizon`; softened rows, and a hard box on the first torque."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.kernels import Array, cholesky4, cholesky4_solve, compiled
from controller.ltv.linearisation import DTHETA, N_Z, THETA

FREE, AT_LOWER, AT_UPPER = 0, -1, 1


class LtvProblem(NamedTuple):
    """minimise 1/2 sum_k [e' W e at z_{k+1}] + 1/2 u' R u + linear' u + 1/2 sum_r rho_r max(0, Ez z + Eu u - d)^2.

    Attributes:
        AB: Of z_{k+1} = A z_k + B u_k, z_0 = 0 (deviations), (N, 10, 14).
        error: e at z_{k+1} = 0: outputs, rates, clock rate, (N, 9).
        weight: Diagonal W, (N, 9).
        slope: dtheta*'(theta) at the end of each stage, (N,).
        R: (4,).
        linear: On u, (N, 4).
        rows_z, rows_u, limits: Ez (N, r, 10), Eu (N, r, 4), d (N, r).
        penalty: rho, (r,).
        lower, upper: Box of the first torque in [N.m], (4,).
    """

    AB: Array
    error: Array
    weight: Array
    slope: Array
    R: Array
    linear: Array
    rows_z: Array
    rows_u: Array
    limits: Array
    penalty: Array
    lower: Array
    upper: Array


class LtvState(NamedTuple):
    """Guess and answer: exceeded rows (N, r), fixed first torques (4,), torques (N, 4), deviations (N + 1, 10)."""

    exceeded: NDArray[np.bool_]
    fixed: NDArray[np.int8]
    u: Array
    z: Array
    K: Array
    k: Array
    H0: Array


def new_state(N: int, r: int) -> LtvState:
    """Room for N stages, nothing active."""
    z = np.zeros
    return LtvState(
        z((N, r), dtype=np.bool_), z(4, dtype=np.int8), z((N, 4)), z((N + 1, N_Z)), z((N, 4, N_Z)), z((N, 4)),
        z((4, 5)),
    )  # fmt: skip


@compiled
def backward(p: LtvProblem, s: LtvState) -> None:
    """Riccati recursion under the guess."""
    N, r = p.limits.shape
    P = np.zeros((N_Z, N_Z))
    c = np.zeros(N_Z)
    PA = np.empty((N_Z, N_Z))
    PB = np.empty((N_Z, 4))
    H = np.empty((4, 4))
    x = np.empty(4)
    for k in range(N - 1, -1, -1):
        A, B, K = p.AB[k, :, :N_Z], p.AB[k, :, N_Z:], s.K[k]
        for i in range(8):
            P[i, i] += p.weight[k, i]
            c[i] += p.weight[k, i] * p.error[k, i]
        q, slope = p.weight[k, 8], p.slope[k]
        P[THETA, THETA] += q * slope * slope
        P[THETA, DTHETA] -= q * slope
        P[DTHETA, THETA] -= q * slope
        P[DTHETA, DTHETA] += q
        c[THETA] -= q * slope * p.error[k, 8]
        c[DTHETA] += q * p.error[k, 8]
        for i in range(N_Z):
            for j in range(N_Z):
                PA[i, j] = 0.0
            for j in range(4):
                PB[i, j] = 0.0
            for m in range(N_Z):
                v = P[i, m]
                for j in range(N_Z):
                    PA[i, j] += v * A[m, j]
                for j in range(4):
                    PB[i, j] += v * B[m, j]
        for i in range(4):
            for j in range(N_Z):
                K[i, j] = 0.0
            for j in range(4):
                H[i, j] = 0.0
            H[i, i] = p.R[i]
            x[i] = p.linear[k, i]
        for m in range(N_Z):
            for i in range(4):
                v = B[m, i]
                x[i] += v * c[m]
                for j in range(N_Z):
                    K[i, j] += v * PA[m, j]
                for j in range(4):
                    H[i, j] += v * PB[m, j]
        new_c = np.zeros(N_Z)
        for m in range(N_Z):
            for j in range(N_Z):
                new_c[j] += A[m, j] * c[m]
        for i in range(N_Z):
            for j in range(N_Z):
                P[i, j] = 0.0
        for m in range(N_Z):
            for i in range(N_Z):
                v = A[m, i]
                if v != 0.0:
                    for j in range(N_Z):
                        P[i, j] += v * PA[m, j]
        for q_row in range(r):
            if s.exceeded[k, q_row]:
                rho, d = p.penalty[q_row], p.limits[k, q_row]
                Ez, Eu = p.rows_z[k, q_row], p.rows_u[k, q_row]
                for i in range(4):
                    x[i] -= rho * d * Eu[i]
                    for j in range(4):
                        H[i, j] += rho * Eu[i] * Eu[j]
                    for j in range(N_Z):
                        K[i, j] += rho * Eu[i] * Ez[j]
                for i in range(N_Z):
                    new_c[i] -= rho * d * Ez[i]
                    for j in range(N_Z):
                        P[i, j] += rho * Ez[i] * Ez[j]
        if k == 0:
            for i in range(4):
                s.H0[i, 4] = x[i]
                for j in range(4):
                    s.H0[i, j] = H[i, j]
            return
        cholesky4(H)
        # K holds Hux: P += Hux' (-H^-1 Hux), c += Hux' (-H^-1 hu)
        for i in range(4):
            x[i] = -x[i]
        cholesky4_solve(H, x)
        for j in range(N_Z):
            for i in range(4):
                c[j] = new_c[j] if i == 0 else c[j]
                c[j] += K[i, j] * x[i]
        gain = np.empty((N_Z, 4))
        for j in range(N_Z):
            for i in range(4):
                gain[j, i] = -K[i, j]
            cholesky4_solve(H, gain[j])
        for i in range(N_Z):
            for m in range(4):
                v = K[m, i]
                for j in range(N_Z):
                    P[i, j] += v * gain[j, m]
        for i in range(4):
            s.k[k, i] = x[i]
            for j in range(N_Z):
                K[i, j] = gain[j, i]


@compiled
def first_torque(p: LtvProblem, s: LtvState) -> int:
    """Torque of stage 0 inside its box, by active-set steps; returns how many of its guesses changed."""
    L = np.empty((4, 4))
    u = s.u[0]
    changes = 0
    for _ in range(10):
        for i in range(4):
            if s.fixed[i] != FREE:
                u[i] = p.upper[i] if s.fixed[i] == AT_UPPER else p.lower[i]
        for i in range(4):
            if s.fixed[i] == FREE:
                u[i] = -s.H0[i, 4]
                for j in range(4):
                    if s.fixed[j] != FREE:
                        u[i] -= s.H0[i, j] * u[j]
            for j in range(4):
                free = s.fixed[i] == FREE and s.fixed[j] == FREE
                L[i, j] = s.H0[i, j] if free else (1.0 if i == j else 0.0)
        cholesky4(L)
        cholesky4_solve(L, u)
        again = False
        for i in range(4):
            g = s.H0[i, 4]
            for j in range(4):
                g += s.H0[i, j] * u[j]
            new = s.fixed[i]
            if new == FREE:
                if u[i] < p.lower[i] - 1e-9:
                    new = AT_LOWER
                elif u[i] > p.upper[i] + 1e-9:
                    new = AT_UPPER
            elif new * g > 1e-6:
                new = FREE
            if new != s.fixed[i]:
                s.fixed[i] = new
                again = True
                changes += 1
        if not again:
            break
    for i in range(4):
        u[i] = min(max(u[i], p.lower[i]), p.upper[i])
    return changes


@compiled
def forward(p: LtvProblem, s: LtvState) -> int:
    """Torques and deviations; corrects the guess of exceeded rows and returns how many changed."""
    N, r = p.limits.shape
    first_torque(p, s)
    changes = 0
    for k in range(N):
        z, u = s.z[k], s.u[k]
        if k > 0:
            for i in range(4):
                v = s.k[k, i]
                for j in range(N_Z):
                    v += s.K[k, i, j] * z[j]
                u[i] = v
        for i in range(N_Z):
            v = 0.0
            for j in range(N_Z):
                v += p.AB[k, i, j] * z[j]
            for j in range(4):
                v += p.AB[k, i, N_Z + j] * u[j]
            s.z[k + 1, i] = v
        for q in range(r):
            v = -p.limits[k, q]
            for j in range(N_Z):
                v += p.rows_z[k, q, j] * z[j]
            for j in range(4):
                v += p.rows_u[k, q, j] * u[j]
            if (v > 0.0) != s.exceeded[k, q]:
                s.exceeded[k, q] = v > 0.0
                changes += 1
    return changes


@compiled
def solve(p: LtvProblem, s: LtvState, limit: int) -> int:
    """Sweep until the guess is confirmed; returns the sweeps, negative if it never was."""
    for count in range(1, limit + 1):
        backward(p, s)
        if forward(p, s) == 0:
            return count
    return -limit


@compiled
def residuals(p: LtvProblem, s: LtvState) -> Array:
    """Feasibility, stationarity and complementarity at stage 0, where the torque is applied, (3,).

    Feasibility is the torque beyond its box in [N.m]; stationarity the largest gradient by a free first torque in
    [1/(N.m)]; complementarity the largest product of a bound's multiplier with the distance from it.
    """
    out = np.zeros(3)
    for i in range(4):
        u = s.u[0, i]
        g = s.H0[i, 4]
        for j in range(4):
            g += s.H0[i, j] * s.u[0, j]
        out[0] = max(out[0], u - p.upper[i], p.lower[i] - u)
        if s.fixed[i] == FREE:
            out[1] = max(out[1], abs(g))
        else:
            distance = p.upper[i] - u if s.fixed[i] == AT_UPPER else u - p.lower[i]
            out[2] = max(out[2], abs(g) * abs(distance))
    return out
