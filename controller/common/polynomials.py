"""Polynomials by least squares without BLAS or LAPACK, whose sums differ in their last bits from kernel to kernel."""

import numpy as np

from controller.common.records import Vector


def fit(x: Vector, y: Vector, degree: int) -> Vector:
    """Coefficients of the polynomial nearest to samples, lowest power first, (degree + 1,).

    Modified Gram-Schmidt on the powers with the samples as their last column, which is as stable as Householder's
    method (Golub and Van Loan, Matrix Computations, 4th ed., Sec. 5.3.5).

    Args:
        x: Abscissas, (n,), n above the degree; scaled to some [0, 1].
        y: Samples, (n,).
        degree: Of the polynomial.
    """
    columns = [np.ones_like(x)]
    for _ in range(degree):
        columns.append(columns[-1] * x)  # x**k is a library's, too
    rest, R, z = y.copy(), np.zeros((degree + 1, degree + 1)), np.zeros(degree + 1)
    for j in range(degree + 1):
        R[j, j] = np.sqrt((columns[j] * columns[j]).sum())
        direction = columns[j] / R[j, j]
        for k in range(j + 1, degree + 1):
            R[j, k] = (direction * columns[k]).sum()
            columns[k] = columns[k] - R[j, k] * direction
        z[j] = (direction * rest).sum()
        rest = rest - z[j] * direction
    found = np.zeros(degree + 1)
    for j in reversed(range(degree + 1)):
        found[j] = (z[j] - (R[j, j + 1 :] * found[j + 1 :]).sum()) / R[j, j]
    return found
