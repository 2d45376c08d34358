"""Riccati sweeps that solve an `LtvProblem`: rows beyond their limit are guessed, and each sweep corrects the guess."""

import numpy as np

from controller.belief.linalg import cholesky4, cholesky4_solve, cholesky4_solve_all
from controller.common.compiled import nested
from controller.ltv.coordinates import DTHETA, N_Z, THETA
from controller.ltv.problem import LtvProblem, LtvState
from controller.qp.bounds import AT_UPPER, FREE, corrected


@nested
def backward(p: LtvProblem, s: LtvState) -> None:
    """Riccati recursion under the guess."""
    N, r = p.limits.shape
    P = np.zeros((N_Z, N_Z))
    c = np.zeros(N_Z)
    PAB = np.empty((N_Z, N_Z + 4))  # P times A and B, side by side for the vector units
    BPAB = np.empty((4, N_Z + 4))  # B' times that
    H = np.empty((4, 4))
    x = np.empty(4)
    new_c = np.empty(N_Z)
    gain = np.empty((4, N_Z))
    for k in range(N - 1, -1, -1):
        AB, A, B, K = p.AB[k], p.AB[k, :, :N_Z], p.AB[k, :, N_Z:], s.K[k]
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
            for j in range(N_Z + 4):
                PAB[i, j] = 0.0
            for m in range(N_Z):
                v = P[i, m]
                for j in range(N_Z + 4):
                    PAB[i, j] += v * AB[m, j]
        for i in range(4):
            for j in range(N_Z + 4):
                BPAB[i, j] = 0.0
            BPAB[i, N_Z + i] = p.R[i]
            x[i] = p.linear[k, i]
        for m in range(N_Z):
            for i in range(4):
                v = B[m, i]
                x[i] += v * c[m]
                for j in range(N_Z + 4):
                    BPAB[i, j] += v * PAB[m, j]
        for i in range(4):
            for j in range(N_Z):
                K[i, j] = BPAB[i, j]
            for j in range(4):
                H[i, j] = BPAB[i, N_Z + j]
        for j in range(N_Z):
            new_c[j] = 0.0
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
                        P[i, j] += v * PAB[m, j]
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
        for i in range(4):
            for j in range(N_Z):
                gain[i, j] = -K[i, j]
        cholesky4_solve_all(H, gain)
        for i in range(N_Z):
            for m in range(4):
                v = K[m, i]
                for j in range(N_Z):
                    P[i, j] += v * gain[m, j]
        for i in range(4):
            s.k[k, i] = x[i]
            for j in range(N_Z):
                K[i, j] = gain[i, j]


@nested
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
            new = corrected(s.fixed[i], u[i], p.lower[i], p.upper[i], g)
            if new != s.fixed[i]:
                s.fixed[i] = new
                again = True
                changes += 1
        if not again:
            break
    for i in range(4):
        u[i] = min(max(u[i], p.lower[i]), p.upper[i])
    return changes


@nested
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


@nested
def solve(p: LtvProblem, s: LtvState, limit: int) -> int:
    """Sweep until the guess is confirmed; returns the sweeps, negative if it never was."""
    for count in range(1, limit + 1):
        backward(p, s)
        if forward(p, s) == 0:
            return count
    return -limit
