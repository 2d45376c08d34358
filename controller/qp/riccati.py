"""Stage-structured linear algebra of Eq. (22): one Riccati sweep is one Newton step over the whole horizon.

The MPC's share of the output rates obeys w_{k+1} = w_k + M_k u_k with four states (see `qp.StageQP`). A Newton step
of any method for that problem, active-set or interior-point, is the minimiser of

    sum_k 1/2 dw_{k+1}' W_k dw_{k+1} + a_k' dw_{k+1} + 1/2 du_k' (R_k + E_k' Omega_k E_k) du_k + b_k' du_k

with some du given. `newton_step` runs the recursion of the cost-to-go 1/2 w' P w + c' w, matrices and vectors,
`step` that of the vectors alone, so that a predictor-corrector pays for the matrices once; and where the terms of late
stages are as they were, the recursion goes on from what is kept of them. Cost grows linearly with the number of stages.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.common.compiled import Array, compiled, nested
from controller.qp.bounds import FREE
from controller.qp.fours import (
    Matrix4,
    Vector4,
    dot,
    inlined,
    ldl,
    matrix,
    matrix_minus,
    minus,
    plus,
    plus_diagonal,
    plus_outer,
    product,
    row,
    rows_scaled,
    scaled,
    solve_lower,
    solve_lower_rows,
    solve_upper,
    store,
    store_matrix,
    symmetric_product,
    times,
    transpose_times,
    transposed,
    vector,
)
from controller.qp.problem import StageQP


class Terms(NamedTuple):
    """What a Newton step minimises beside the problem's own numbers, and which torques it may move.

    Attributes:
        fixed: Nonzero where the step of a torque is given, (N, 4).
        given: Step of the fixed torques, (N, 4); ignored where they are free.
        R: Diagonal weight on the torques, (N, 4).
        Omega: Weights of the contact-force rows, (N, r).
        a: Linear term on dw_{k+1}, (N, 4).
        b: Linear term on du_k, (N, 4).
    """

    fixed: NDArray[np.int8]
    given: Array
    R: Array
    Omega: Array
    a: Array
    b: Array


class Factors(NamedTuple):
    """Of the Newton matrix, stage by stage; the matrix F of a stage's free torques is L diag(1/d) L'.

    Attributes:
        L: Its six numbers below the diagonal, as `fours.ldl` orders them, (N, 6).
        d: Reciprocals of the pivots, (N, 4).
        A: M_k' P with P the cost-to-go, (N, 4, 4).
        Z: diag(d) L^-1 A, without the fixed torques' rows, (N, 4, 4).
        P, c: Of the cost-to-go 1/2 w' P w + c' w at the beginning of each stage, (N, 4, 4) and (N, 4).
        t: Step but for its feedback, (N, 4).
    """

    L: Array
    d: Array
    A: Array
    Z: Array
    P: Array
    c: Array
    t: Array


@compiled
def new_factors(N: int) -> Factors:
    """Room for the factors of N stages."""
    n = N, 4, 4
    return Factors(
        np.zeros((N, 6)), np.zeros((N, 4)), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((N, 4)), np.zeros((N, 4))
    )


def new_terms(N: int, r: int) -> Terms:
    """Room for N stages with r contact-force rows each, all torques free."""
    z = np.zeros
    return Terms(z((N, 4), dtype=np.int8), z((N, 4)), z((N, 4)), z((N, r)), z((N, 4)), z((N, 4)))


@nested
def newton_step(p: StageQP, terms: Terms, factors: Factors, du: Array, dw: Array, last: int) -> None:
    """Factorise the Newton matrix and step.

    Args:
        p: Problem.
        terms: What to minimise.
        factors: Filled.
        du: Filled with the step, (N, 4).
        dw: Filled with what it does to the rates, (N, 4), whose row k holds dw_{k+1}.
        last: Last stage whose terms differ from those the factors were made of; N - 1 makes all anew.
    """
    rate, weight, rows = p.rate, p.weight, p.rows
    fixed, R, Omega = terms.fixed, terms.R, terms.Omega
    kept_L, kept_d, kept_A, kept_Z, kept_P, kept_c, kept_t = factors
    N, r = Omega.shape
    zero = (0.0, 0.0, 0.0, 0.0)
    P = (zero, zero, zero, zero)
    c = zero
    if last < N - 1:
        P, c = matrix(kept_P, last + 1), vector(kept_c, last + 1)
    for k in range(last, -1, -1):
        M = matrix(rate, k)
        P = plus_diagonal(P, vector(weight, k))
        A = product(transposed(M), P)
        F = plus_diagonal(product(A, M), vector(R, k))
        for q in range(r):
            if Omega[k, q] != 0.0:
                F = plus_outer(F, Omega[k, q], row(rows, k, q))
        free = _free(fixed, k)
        Y = A
        if _any_fixed(free):
            F = _without_fixed(F, free)
            Y = rows_scaled(free, A)
        L, d = ldl(F)
        Y = solve_lower_rows(L, Y)
        Z = rows_scaled(d, Y)
        P = matrix_minus(P, symmetric_product(transposed(Y), Z))
        stage = (M, A, Z, L, d, free)
        c, t = _backward(p, terms, k, c, stage)
        store(t, kept_t, k)
        store(c, kept_c, k)
        store(d, kept_d, k)
        store_matrix(A, kept_A, k)
        store_matrix(Z, kept_Z, k)
        store_matrix(P, kept_P, k)
        for i in range(6):
            kept_L[k, i] = L[i]
    _forward(rate, factors, du, dw)


@nested
def step(p: StageQP, terms: Terms, factors: Factors, du: Array, dw: Array) -> None:
    """Step with the factors of the last `newton_step` and other linear terms; arguments as there."""
    rate = p.rate
    kept_L, kept_d, kept_A, kept_Z, _, _, kept_t = factors
    c = (0.0, 0.0, 0.0, 0.0)
    for k in range(terms.Omega.shape[0] - 1, -1, -1):
        free = _free(terms.fixed, k)
        stage = (matrix(rate, k), matrix(kept_A, k), matrix(kept_Z, k), _lower(kept_L, k), vector(kept_d, k), free)
        c, t = _backward(p, terms, k, c, stage)
        store(t, kept_t, k)
    _forward(rate, factors, du, dw)


@inlined
def _free(fixed, k) -> Vector4:  # type: ignore[no-untyped-def]
    """1 where a torque is free, 0 where its step is given."""
    return (
        1.0 if fixed[k, 0] == FREE else 0.0,
        1.0 if fixed[k, 1] == FREE else 0.0,
        1.0 if fixed[k, 2] == FREE else 0.0,
        1.0 if fixed[k, 3] == FREE else 0.0,
    )


@inlined
def _lower(L, k):  # type: ignore[no-untyped-def]
    """L of a stage, as `fours.ldl` gives it."""
    return (L[k, 0], L[k, 1], L[k, 2], L[k, 3], L[k, 4], L[k, 5])


@inlined
def _any_fixed(free: Vector4) -> bool:
    return free[0] + free[1] + free[2] + free[3] < 4.0


@inlined
def _without_fixed(F: Matrix4, free: Vector4) -> Matrix4:
    """Rows and columns of the fixed torques replaced by those of the identity."""
    kept = (scaled(free, F[0]), scaled(free, F[1]), scaled(free, F[2]), scaled(free, F[3]))
    kept = transposed(kept)
    kept = (scaled(free, kept[0]), scaled(free, kept[1]), scaled(free, kept[2]), scaled(free, kept[3]))
    return plus_diagonal(kept, (1.0 - free[0], 1.0 - free[1], 1.0 - free[2], 1.0 - free[3]))


@inlined
def _backward(p, terms, k, c, stage):  # type: ignore[no-untyped-def]
    """The vector recursion at a stage: the linear term c of the cost-to-go, and the step but for its feedback."""
    M, A, Z, L, d, free = stage
    rows, given, Omega, a, b = p.rows, terms.given, terms.Omega, terms.a, terms.b
    c = plus(c, vector(a, k))
    g = vector(b, k)
    u = (0.0, 0.0, 0.0, 0.0)
    if _any_fixed(free):  # the given steps act on the cost-to-go and on the rows
        g0 = vector(given, k)
        u = minus(g0, scaled(free, g0))
        c = plus(c, transpose_times(u, A))
        for q in range(Omega.shape[1]):
            e = row(rows, k, q)
            force = Omega[k, q] * dot(e, u)
            g = plus(g, (force * e[0], force * e[1], force * e[2], force * e[3]))
    g = plus(g, transpose_times(c, M))
    s = solve_lower(L, scaled(free, (-g[0], -g[1], -g[2], -g[3])))
    return plus(c, transpose_times(s, Z)), plus(scaled(d, s), u)


@inlined
def _forward(rate: Array, factors: Factors, du: Array, dw: Array) -> None:
    """Add the feedback on the rates and carry the rates on."""
    kept_L, kept_Z, kept_t = factors.L, factors.Z, factors.t
    w = (0.0, 0.0, 0.0, 0.0)
    for k in range(du.shape[0]):
        u = minus(vector(kept_t, k), times(matrix(kept_Z, k), w))
        u = solve_upper(_lower(kept_L, k), u)
        w = plus(w, times(matrix(rate, k), u))
        store(u, du, k)
        store(w, dw, k)


@nested
def rates(p: StageQP, u: Array, w: Array) -> None:
    """w_{k+1} = w_k + M_k u_k, filled into w (N, 4), whose row k holds w_{k+1}."""
    running = np.zeros(4)
    for k in range(u.shape[0]):
        for i in range(4):
            for j in range(4):
                running[i] += p.rate[k, i, j] * u[k, j]
            w[k, i] = running[i]


@nested
def smooth_gradient(p: StageQP, u: Array, w: Array, gradient: Array) -> None:
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
