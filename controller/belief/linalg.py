"""Cholesky factors of small matrices, written out: LAPACK calls cost more than the arithmetic at this size."""

from collections.abc import Callable

import numpy as np

from controller.common.compiled import Array, inlined

Solve = Callable[[Array, Array], None]


def _cholesky(n: int) -> tuple[Callable[[Array], None], Solve, Solve]:
    """Factorisation and solve for n x n; with n known to the compiler the loops are unrolled, four times as fast."""

    @inlined
    def factorise(D: Array) -> None:
        """Overwrite the lower triangle of a symmetric positive definite matrix by its Cholesky factor.

        The diagonal gets the reciprocals of the factor's: a solve then multiplies where it would divide.
        """
        for j in range(n):
            d = D[j, j]
            for k in range(j):
                d -= D[j, k] * D[j, k]
            d = 1.0 / np.sqrt(d)
            D[j, j] = d
            for i in range(j + 1, n):
                v = D[i, j]
                for k in range(j):
                    v -= D[i, k] * D[j, k]
                D[i, j] = v * d

    @inlined
    def solve(L: Array, x: Array) -> None:
        """Solve L L' x = rhs in place, L from the factorisation."""
        for i in range(n):
            v = x[i]
            for k in range(i):
                v -= L[i, k] * x[k]
            x[i] = v * L[i, i]
        for i in range(n - 1, -1, -1):
            v = x[i]
            for k in range(i + 1, n):
                v -= L[k, i] * x[k]
            x[i] = v * L[i, i]

    @inlined
    def solve_all(L: Array, X: Array) -> None:
        """The same for every column of X (n, m) at once, side by side for the vector units."""
        m = X.shape[1]
        for i in range(n):
            for k in range(i):
                for j in range(m):
                    X[i, j] -= L[i, k] * X[k, j]
            for j in range(m):
                X[i, j] *= L[i, i]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                for j in range(m):
                    X[i, j] -= L[k, i] * X[k, j]
            for j in range(m):
                X[i, j] *= L[i, i]

    return factorise, solve, solve_all


cholesky4, cholesky4_solve, cholesky4_solve_all = _cholesky(4)
cholesky5, cholesky5_solve, cholesky5_solve_all = _cholesky(5)
