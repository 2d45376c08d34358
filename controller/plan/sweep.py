"""Riccati recursion of a planned motion under weighted rows; step times are parameters decided at the root."""

import numpy as np

from controller.belief.linalg import cholesky4, cholesky4_solve
from controller.common.compiled import Array, compiled
from controller.plan.cost import ROWS
from controller.plan.dynamics import N_U, N_X
from controller.plan.motion import Model


@compiled
def backward(
    model: Model, weight: Array, offset: Array, limit: Array, k: Array, K: Array, values: Array,
    slopes: Array,
) -> None:  # fmt: skip
    """Corrections of the torques of every stage, and the value at the root.

    Args:
        model: Linear-quadratic.
        weight: Of the square of each row: soft limits, torques over their upper and below their lower limit, relative
            to it, (N, 17).
        offset: What stands in the square beside the row's linear part, (N, 17).
        limit: Torque limits in [N.m], (4,).
        k: Filled: du = k + K dz, (N, 4).
        K: Filled, (N, 4, nz).
        values: Filled: Hessian of the value by dz at every node, (N + 1, nz, nz).
        slopes: Filled: its gradient, (N + 1, nz).
    """
    N, n = model.A.shape[0], model.A.shape[1]
    V, v = model.H_end.copy(), model.g_end.copy()
    values[N] = V
    slopes[N] = v
    VA, VB = np.empty((n, n)), np.empty((n, N_U))
    Huu, hu, Hux = np.empty((N_U, N_U)), np.empty(N_U), np.empty((N_U, n))
    L, column = np.empty((N_U, N_U)), np.empty(N_U)
    Vn, vn = np.empty((n, n)), np.empty(n)
    for s in range(N - 1, -1, -1):
        A, B, H, g, gap = model.A[s], model.B[s], model.H[s], model.g[s], model.gap[s]
        for i in range(n):
            for j in range(n):
                v[i] += V[i, j] * gap[j]
        for i in range(n):
            for j in range(n):
                VA[i, j] = 0.0
            for j in range(N_U):
                VB[i, j] = 0.0
            for m in range(n):
                w = V[i, m]
                for j in range(n):
                    VA[i, j] += w * A[m, j]
                for j in range(N_U):
                    VB[i, j] += w * B[m, j]
        for i in range(n):
            vn[i] = g[i]
            for j in range(n):
                Vn[i, j] = H[i, j]
        for i in range(N_U):
            hu[i] = g[n + i]
            for j in range(N_U):
                Huu[i, j] = H[n + i, n + j]
            for j in range(n):
                Hux[i, j] = H[n + i, j]
        for row in range(ROWS):
            w_row = weight[s, row]
            if w_row > 0.0:
                r, r_x, r_u = offset[s, row], model.r_x[s, row], model.r_u[s, row]
                for i in range(N_X):
                    w = w_row * r_x[i]
                    if w != 0.0:
                        vn[i] += w * r
                        for j in range(N_X):
                            Vn[i, j] += w * r_x[j]
                for i in range(N_U):
                    w = w_row * r_u[i]
                    if w != 0.0:
                        hu[i] += w * r
                        for j in range(N_U):
                            Huu[i, j] += w * r_u[j]
                        for j in range(N_X):
                            Hux[i, j] += w * r_x[j]
        for i in range(N_U):
            upper, lower = weight[s, ROWS + i], weight[s, ROWS + N_U + i]
            Huu[i, i] += (upper + lower) / (limit[i] * limit[i])
            hu[i] += (upper * offset[s, ROWS + i] - lower * offset[s, ROWS + N_U + i]) / limit[i]
        for m in range(n):
            for i in range(n):
                w = A[m, i]
                if w != 0.0:
                    vn[i] += w * v[m]
                    for j in range(n):
                        Vn[i, j] += w * VA[m, j]
            for i in range(N_U):
                w = B[m, i]
                if w != 0.0:
                    hu[i] += w * v[m]
                    for j in range(n):
                        Hux[i, j] += w * VA[m, j]
                    for j in range(N_U):
                        Huu[i, j] += w * VB[m, j]
        for i in range(N_U):
            k[s, i] = -hu[i]
            for j in range(N_U):
                L[i, j] = Huu[i, j]
        cholesky4(L)
        cholesky4_solve(L, k[s])
        for j in range(n):
            for i in range(N_U):
                column[i] = -Hux[i, j]
            cholesky4_solve(L, column)
            for i in range(N_U):
                K[s, i, j] = column[i]
        # V = Vn + Hux'K, v = vn + Hux'k at the minimum
        for i in range(N_U):
            for j in range(n):
                vn[j] += Hux[i, j] * k[s, i]
                for m in range(n):
                    Vn[j, m] += Hux[i, j] * K[s, i, m]
        for i in range(n):
            v[i] = vn[i]
            for j in range(n):
                V[i, j] = 0.5 * (Vn[i, j] + Vn[j, i])
        values[s] = V
        slopes[s] = v


@compiled
def step_times(
    V: Array, v: Array, T: Array, shortest: Array, longest: Array, most: float, dT: Array
) -> None:  # fmt: skip
    """Changes of the step times that minimise the value at the root, within bounds and `most`, by coordinates."""
    P = T.shape[0]
    dT[:] = 0.0
    for _ in range(50):
        for p in range(P):
            gradient = v[N_X + p]
            for m in range(P):
                gradient += V[N_X + p, N_X + m] * dT[m]
            curvature = V[N_X + p, N_X + p]
            if curvature > 0.0:
                new = dT[p] - gradient / curvature
                new = min(max(new, -most), most)
                dT[p] = min(max(new, shortest[p] - T[p]), longest[p] - T[p])


@compiled
def forward(
    model: Model, k: Array, K: Array, values: Array, slopes: Array, dT: Array, dz: Array, du: Array
) -> tuple[float, float]:  # fmt: skip
    """Step of the linear-quadratic problem, from dx = 0 at the root.

    Args:
        model: Linear-quadratic.
        k: Of `backward`.
        K: Of `backward`.
        values: Of `backward`.
        slopes: Of `backward`.
        dT: Changes of the step times in [s], (P,).
        dz: Filled, (N + 1, nz).
        du: Filled, (N, 4).

    Returns:
        The largest multipliers of the dynamics, by angles and by rates.
    """
    N, n = model.A.shape[0], model.A.shape[1]
    for i in range(n):
        dz[0, i] = 0.0 if i < N_X else dT[i - N_X]
    angles, rates = 0.0, 0.0
    for s in range(N):
        for i in range(N_U):
            w = k[s, i]
            for j in range(n):
                w += K[s, i, j] * dz[s, j]
            du[s, i] = w
        for i in range(n):
            w = model.gap[s, i]
            for j in range(n):
                w += model.A[s, i, j] * dz[s, j]
            for j in range(N_U):
                w += model.B[s, i, j] * du[s, j]
            dz[s + 1, i] = w
        for i in range(N_X):
            multiplier = slopes[s + 1, i]
            for j in range(n):
                multiplier += values[s + 1, i, j] * dz[s + 1, j]
            if i < 5:
                angles = max(angles, abs(multiplier))
            else:
                rates = max(rates, abs(multiplier))
    return angles, rates
