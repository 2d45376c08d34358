"""Vectors and matrices of four as tuples, which compiled code keeps in registers.

A stage of the horizon has four states and four torques. Small arrays would be stored and loaded again between any
two operations, since the compiler cannot know that they do not overlap; tuples of tuples are plain numbers to it.
"""

from typing import Any

from controller.common.compiled import inlined

Vector4 = Any  # tuple of 4 floats
Matrix4 = Any  # tuple of 4 rows; of a symmetric one's factorisation only the lower triangle is read


@inlined
def vector(a, k) -> Vector4:  # type: ignore[no-untyped-def]
    """Row k of an array (N, 4)."""
    return (a[k, 0], a[k, 1], a[k, 2], a[k, 3])


@inlined
def matrix(A, k) -> Matrix4:  # type: ignore[no-untyped-def]
    """Matrix k of an array (N, 4, 4); entry by entry, as every view of an array would be counted."""
    return (
        (A[k, 0, 0], A[k, 0, 1], A[k, 0, 2], A[k, 0, 3]),
        (A[k, 1, 0], A[k, 1, 1], A[k, 1, 2], A[k, 1, 3]),
        (A[k, 2, 0], A[k, 2, 1], A[k, 2, 2], A[k, 2, 3]),
        (A[k, 3, 0], A[k, 3, 1], A[k, 3, 2], A[k, 3, 3]),
    )


@inlined
def row(rows, k, q) -> Vector4:  # type: ignore[no-untyped-def]
    """Row q of stage k of an array (N, r, 4)."""
    return (rows[k, q, 0], rows[k, q, 1], rows[k, q, 2], rows[k, q, 3])


@inlined
def store(x: Vector4, a, k) -> None:  # type: ignore[no-untyped-def]
    """Write a vector into row k of an array (N, 4)."""
    a[k, 0], a[k, 1], a[k, 2], a[k, 3] = x


@inlined
def store_matrix(X: Matrix4, A, k) -> None:  # type: ignore[no-untyped-def]
    """Write a matrix into an array (N, 4, 4)."""
    A[k, 0, 0], A[k, 0, 1], A[k, 0, 2], A[k, 0, 3] = X[0]
    A[k, 1, 0], A[k, 1, 1], A[k, 1, 2], A[k, 1, 3] = X[1]
    A[k, 2, 0], A[k, 2, 1], A[k, 2, 2], A[k, 2, 3] = X[2]
    A[k, 3, 0], A[k, 3, 1], A[k, 3, 2], A[k, 3, 3] = X[3]


@inlined
def plus(x: Vector4, y: Vector4) -> Vector4:
    """x + y."""
    return (x[0] + y[0], x[1] + y[1], x[2] + y[2], x[3] + y[3])


@inlined
def minus(x: Vector4, y: Vector4) -> Vector4:
    """x - y."""
    return (x[0] - y[0], x[1] - y[1], x[2] - y[2], x[3] - y[3])


@inlined
def scaled(x: Vector4, y: Vector4) -> Vector4:
    """Entry by entry."""
    return (x[0] * y[0], x[1] * y[1], x[2] * y[2], x[3] * y[3])


@inlined
def negative(x: Vector4) -> Vector4:
    """-x."""
    return (-x[0], -x[1], -x[2], -x[3])


@inlined
def reciprocal(x: Vector4) -> Vector4:
    """1 / x, entry by entry."""
    return (1.0 / x[0], 1.0 / x[1], 1.0 / x[2], 1.0 / x[3])


@inlined
def magnitude(x: Vector4) -> Vector4:
    """|x|, entry by entry."""
    return (abs(x[0]), abs(x[1]), abs(x[2]), abs(x[3]))


@inlined
def larger(x: Vector4, y: Vector4) -> Vector4:
    """The larger one, entry by entry."""
    return (max(x[0], y[0]), max(x[1], y[1]), max(x[2], y[2]), max(x[3], y[3]))


@inlined
def largest(x: Vector4) -> float:
    """Largest entry."""
    return max(x[0], x[1], x[2], x[3])


@inlined
def total(x: Vector4) -> float:
    """Sum of the entries."""
    return x[0] + x[1] + x[2] + x[3]


@inlined
def dot(x: Vector4, y: Vector4) -> float:
    """x' y."""
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2] + x[3] * y[3]


@inlined
def times(M: Matrix4, x: Vector4) -> Vector4:
    """M x."""
    return (dot(M[0], x), dot(M[1], x), dot(M[2], x), dot(M[3], x))


@inlined
def transpose_times(x: Vector4, M: Matrix4) -> Vector4:
    """M' x."""
    return (
        x[0] * M[0][0] + x[1] * M[1][0] + x[2] * M[2][0] + x[3] * M[3][0],
        x[0] * M[0][1] + x[1] * M[1][1] + x[2] * M[2][1] + x[3] * M[3][1],
        x[0] * M[0][2] + x[1] * M[1][2] + x[2] * M[2][2] + x[3] * M[3][2],
        x[0] * M[0][3] + x[1] * M[1][3] + x[2] * M[2][3] + x[3] * M[3][3],
    )


@inlined
def transposed(M: Matrix4) -> Matrix4:
    """M'."""
    return (
        (M[0][0], M[1][0], M[2][0], M[3][0]),
        (M[0][1], M[1][1], M[2][1], M[3][1]),
        (M[0][2], M[1][2], M[2][2], M[3][2]),
        (M[0][3], M[1][3], M[2][3], M[3][3]),
    )


@inlined
def product(A: Matrix4, B: Matrix4) -> Matrix4:
    """A B."""
    return (transpose_times(A[0], B), transpose_times(A[1], B), transpose_times(A[2], B), transpose_times(A[3], B))


@inlined
def symmetric_product(A: Matrix4, B: Matrix4) -> Matrix4:
    """A B where that is symmetric; its upper triangle is a copy of the lower one."""
    a, b, c, d = product(A, B)
    return ((a[0], b[0], c[0], d[0]), (b[0], b[1], c[1], d[1]), (c[0], c[1], c[2], d[2]), d)


@inlined
def minus_scaled(x: Vector4, s: float, y: Vector4) -> Vector4:
    """x - s y."""
    return (x[0] - s * y[0], x[1] - s * y[1], x[2] - s * y[2], x[3] - s * y[3])


@inlined
def matrix_minus(A: Matrix4, B: Matrix4) -> Matrix4:
    """A - B."""
    return (minus(A[0], B[0]), minus(A[1], B[1]), minus(A[2], B[2]), minus(A[3], B[3]))


@inlined
def rows_scaled(d: Vector4, M: Matrix4) -> Matrix4:
    """diag(d) M."""
    return (
        (d[0] * M[0][0], d[0] * M[0][1], d[0] * M[0][2], d[0] * M[0][3]),
        (d[1] * M[1][0], d[1] * M[1][1], d[1] * M[1][2], d[1] * M[1][3]),
        (d[2] * M[2][0], d[2] * M[2][1], d[2] * M[2][2], d[2] * M[2][3]),
        (d[3] * M[3][0], d[3] * M[3][1], d[3] * M[3][2], d[3] * M[3][3]),
    )


@inlined
def plus_diagonal(A: Matrix4, d: Vector4) -> Matrix4:
    """A + diag(d)."""
    return (
        (A[0][0] + d[0], A[0][1], A[0][2], A[0][3]),
        (A[1][0], A[1][1] + d[1], A[1][2], A[1][3]),
        (A[2][0], A[2][1], A[2][2] + d[2], A[2][3]),
        (A[3][0], A[3][1], A[3][2], A[3][3] + d[3]),
    )


@inlined
def plus_outer(A: Matrix4, s: float, x: Vector4) -> Matrix4:
    """A + s x x'."""
    y = (s * x[0], s * x[1], s * x[2], s * x[3])
    return (
        (A[0][0] + y[0] * x[0], A[0][1] + y[0] * x[1], A[0][2] + y[0] * x[2], A[0][3] + y[0] * x[3]),
        (A[1][0] + y[1] * x[0], A[1][1] + y[1] * x[1], A[1][2] + y[1] * x[2], A[1][3] + y[1] * x[3]),
        (A[2][0] + y[2] * x[0], A[2][1] + y[2] * x[1], A[2][2] + y[2] * x[2], A[2][3] + y[2] * x[3]),
        (A[3][0] + y[3] * x[0], A[3][1] + y[3] * x[1], A[3][2] + y[3] * x[2], A[3][3] + y[3] * x[3]),
    )


@inlined
def ldl(F: Matrix4):  # type: ignore[no-untyped-def]
    """F = L diag(1/d) L' of a positive definite matrix.

    Returns:
        The six numbers of L below its unit diagonal (10, 20, 30, 21, 31, 32), and d.
    """
    d0 = 1.0 / F[0][0]
    f10, f20, f30 = F[1][0], F[2][0], F[3][0]
    l10, l20, l30 = f10 * d0, f20 * d0, f30 * d0
    d1 = 1.0 / (F[1][1] - l10 * f10)
    f21, f31 = F[2][1] - l20 * f10, F[3][1] - l30 * f10
    l21, l31 = f21 * d1, f31 * d1
    d2 = 1.0 / (F[2][2] - l20 * f20 - l21 * f21)
    f32 = F[3][2] - l30 * f20 - l31 * f21
    l32 = f32 * d2
    d3 = 1.0 / (F[3][3] - l30 * f30 - l31 * f31 - l32 * f32)
    return (l10, l20, l30, l21, l31, l32), (d0, d1, d2, d3)


@inlined
def solve_lower(L, x: Vector4) -> Vector4:  # type: ignore[no-untyped-def]
    """L^-1 x, L as from `ldl`."""
    y1 = x[1] - L[0] * x[0]
    y2 = x[2] - L[1] * x[0] - L[3] * y1
    return (x[0], y1, y2, x[3] - L[2] * x[0] - L[4] * y1 - L[5] * y2)


@inlined
def solve_upper(L, x: Vector4) -> Vector4:  # type: ignore[no-untyped-def]
    """L'^-1 x, L as from `ldl`."""
    y2 = x[2] - L[5] * x[3]
    y1 = x[1] - L[4] * x[3] - L[3] * y2
    return (x[0] - L[2] * x[3] - L[1] * y2 - L[0] * y1, y1, y2, x[3])


@inlined
def solve_lower_rows(L, A: Matrix4) -> Matrix4:  # type: ignore[no-untyped-def]
    """L^-1 A, L as from `ldl`."""
    y1 = minus_scaled(A[1], L[0], A[0])
    y2 = minus_scaled(minus_scaled(A[2], L[1], A[0]), L[3], y1)
    return (A[0], y1, y2, minus_scaled(minus_scaled(minus_scaled(A[3], L[2], A[0]), L[4], y1), L[5], y2))
