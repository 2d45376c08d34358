"""Stage-structured linear algebra of Eq. (22): one Riccati sweep is one Newton step over the whole horizon.

The MPC's share of the output rates obeys w_{k+1} = w_k + M_k u_k with four states (see `qp.StageQP`). A Newton step
of any method for that problem, active-set or interior-point, is the minimiser of

    sum_k 1/2 dw_{k+1}' W_k dw_{k+1} + a_k' dw_{k+1} + 1/2 du_k' (R_k + E_k' Omega_k E_k) du_k + b_k' du_k

with some du given. `factorise` runs the recursion of the cost-to-go 1/2 w' P w + c' w that depends on the matrices,
`step` the one that depends on the vectors, so that a predictor-corrector pays for the matrices once. Cost grows
linearly with the number of stages.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.kernels import Array, cholesky4, cholesky4_solve, compiled

FREE, AT_LOWER, AT_UPPER = 0, -1, 1


class Problem(NamedTuple):
    """The numbers of a `qp.StageQP` as the compiled code takes them; shapes as there."""

    rate: Array
    weight: Array
    linear: Array
    R: Array
    lower: Array
    upper: Array
    rows: Array
    limits: Array
    penalty: float


class Factors(NamedTuple):
    """Of the Newton matrix, stage by stage.

    Attributes:
        L: Cholesky factor of the matrix of the free torques, (N, 4, 4).
        PM: Cost-to-go times M_k, (N, 4, 4).
        K: Feedback du_k = K_k dw_k + ..., (N, 4, 4).
    """

    L: Array
    PM: Array
    K: Array


@compiled
def new_factors(N: int) -> Factors:
    """Room for the factors of N stages."""
    return Factors(np.zeros((N, 4, 4)), np.zeros((N, 4, 4)), np.zeros((N, 4, 4)))


@compiled
def factorise(p: Problem, fixed: NDArray[np.int8], R: Array, Omega: Array, factors: Factors) -> None:
    """The matrix recursion.

    Args:
        p: Problem.
        fixed: Nonzero where the step of a torque is given, (N, 4).
        R: Diagonal weight on the torques, (N, 4).
        Omega: Weights of the contact-force rows, (N, r).
        factors: Filled.
    """
    N, r = Omega.shape
    P = np.zeros((4, 4))
    x = np.empty(4)
    for k in range(N - 1, -1, -1):
        M, E, L, PM, K = p.rate[k], p.rows[k], factors.L[k], factors.PM[k], factors.K[k]
        for i in range(4):
            P[i, i] += p.weight[k, i]
        for i in range(4):
            for j in range(4):
                PM[i, j] = P[i, 0] * M[0, j] + P[i, 1] * M[1, j] + P[i, 2] * M[2, j] + P[i, 3] * M[3, j]
        for i in range(4):
            for j in range(i + 1):
                L[i, j] = M[0, i] * PM[0, j] + M[1, i] * PM[1, j] + M[2, i] * PM[2, j] + M[3, i] * PM[3, j]
            L[i, i] += R[k, i]
        for q in range(r):
            omega = Omega[k, q]
            if omega != 0.0:
                for i in range(4):
                    for j in range(i + 1):
                        L[i, j] += omega * E[q, i] * E[q, j]
        for i in range(4):
            if fixed[k, i] != FREE:
                for j in range(i):
                    L[i, j] = 0.0
                for j in range(i + 1, 4):
                    L[j, i] = 0.0
                L[i, i] = 1.0
        cholesky4(L)
        for j in range(4):
            for i in range(4):
                x[i] = -PM[j, i] if fixed[k, i] == FREE else 0.0
            cholesky4_solve(L, x)
            for i in range(4):
                K[i, j] = x[i]
        for i in range(4):
            for j in range(i + 1):
                v = P[i, j] + PM[i, 0] * K[0, j] + PM[i, 1] * K[1, j] + PM[i, 2] * K[2, j] + PM[i, 3] * K[3, j]
                P[i, j] = v
                P[j, i] = v


@compiled
def step(
    p: Problem, fixed: NDArray[np.int8], given: Array, Omega: Array, a: Array, b: Array, factors: Factors, du: Array
) -> None:
    """The vector recursion backward, then forward.

    Args:
        p: Problem.
        fixed: As for `factorise`.
        given: Step of the fixed torques, (N, 4); ignored where they are free.
        Omega: As for `factorise`.
        a: Linear term on dw_{k+1}, (N, 4).
        b: Linear term on du_k, (N, 4).
        factors: From `factorise`.
        du: Filled with the step, (N, 4).
    """
    N, r = Omega.shape
    c = np.zeros(4)
    x = np.empty(4)
    for k in range(N - 1, -1, -1):
        M, E, PM, v = p.rate[k], p.rows[k], factors.PM[k], du[k]
        any_fixed = False
        for i in range(4):
            c[i] += a[k, i]
            x[i] = c[i]
            any_fixed = any_fixed or fixed[k, i] != FREE
            v[i] = given[k, i] if fixed[k, i] != FREE else 0.0
        if any_fixed:  # their effect on the cost-to-go and on the rows
            for i in range(4):
                x[i] += PM[i, 0] * v[0] + PM[i, 1] * v[1] + PM[i, 2] * v[2] + PM[i, 3] * v[3]
        for i in range(4):
            if fixed[k, i] == FREE:
                v[i] = -b[k, i] - M[0, i] * x[0] - M[1, i] * x[1] - M[2, i] * x[2] - M[3, i] * x[3]
        if any_fixed:
            for q in range(r):
                if Omega[k, q] != 0.0:
                    force = 0.0
                    for i in range(4):
                        if fixed[k, i] != FREE:
                            force += E[q, i] * v[i]
                    for i in range(4):
                        if fixed[k, i] == FREE:
                            v[i] -= Omega[k, q] * force * E[q, i]
        cholesky4_solve(factors.L[k], v)
        for i in range(4):
            c[i] += PM[i, 0] * v[0] + PM[i, 1] * v[1] + PM[i, 2] * v[2] + PM[i, 3] * v[3]
    w = np.zeros(4)
    for k in range(N):
        K, M, v = factors.K[k], p.rate[k], du[k]
        for i in range(4):
            v[i] += K[i, 0] * w[0] + K[i, 1] * w[1] + K[i, 2] * w[2] + K[i, 3] * w[3]
        for i in range(4):
            w[i] += M[i, 0] * v[0] + M[i, 1] * v[1] + M[i, 2] * v[2] + M[i, 3] * v[3]


@compiled
def rates(p: Problem, u: Array, w: Array) -> None:
    """w_{k+1} = w_k + M_k u_k, filled into w (N, 4), whose row k holds w_{k+1}."""
    running = np.zeros(4)
    for k in range(u.shape[0]):
        for i in range(4):
            for j in range(4):
                running[i] += p.rate[k, i, j] * u[k, j]
            w[k, i] = running[i]


@compiled
def smooth_gradient(p: Problem, u: Array, w: Array, gradient: Array) -> None:
    """Gradient in u of the quadratic part of the objective (errors and inputs), filled into (N, 4)."""
    costate = np.zeros(4)
    for k in range(u.shape[0] - 1, -1, -1):
        M = p.rate[k]
        for i in range(4):
            costate[i] += p.weight[k, i] * w[k, i] + p.linear[k, i]
        for j in range(4):
            g = p.R[j] * u[k, j]
            for i in range(4):
                g += M[i, j] * costate[i]
            gradient[k, j] = g
