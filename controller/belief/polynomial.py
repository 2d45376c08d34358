"""Polynomials of the normalised clock: from Bezier form to powers, and Horner's rule."""

from math import comb

import numpy as np

from controller.common.compiled import Array, inlined
from controller.common.products import product
from controller.common.records import Vector


def power_basis(alpha: Vector) -> Vector:
    """Coefficients of the same polynomials in powers of s, lowest first, (4, M + 1).

    Evaluated by Horner's rule they cost a quarter of the Bernstein form and agree with it to rounding at the
    degrees gaits have.
    """
    degree = alpha.shape[1] - 1
    convert = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        for j in range(k, degree + 1):
            convert[k, j] = comb(degree, k) * comb(degree - k, j - k) * (-1) ** (j - k)
    return product(alpha, convert)


@inlined
def horner(poly: Array, i: int, s: float) -> tuple[float, float, float]:
    """Value, first and second derivative at s of the polynomial in row i, lowest power first."""
    degree = poly.shape[1] - 1
    value, slope, curvature = poly[i, degree], 0.0, 0.0
    for k in range(degree - 1, -1, -1):
        curvature = curvature * s + 2.0 * slope
        slope = slope * s + value
        value = value * s + poly[i, k]
    return value, slope, curvature
