"""The boundary between walks and falls near a point, as a plane fitted to yes and no."""

import numpy as np

from sim.trials.reliability.asking import Array

RIDGE = 0.02  # of the squared slopes, so that separable answers have a finite fit
ROUNDS = 30  # of Newton's method, which takes fewer than ten
CONVERGED = 1e-8  # of the largest change of a coefficient


def plane(u: Array, fell: Array, middle: Array, width: float) -> tuple[Array, float]:
    """Unit normal towards the falls, and the plane's distance along it from the origin.

    A logistic regression on the coordinates, in which far answers count less (local logistic regression; Hastie,
    Tibshirani, Friedman, The Elements of Statistical Learning, section 6.5).

    Args:
        u: Points, (k, n).
        fell: 1.0 for a fall, 0.0 for a walk, (k,).
        middle: Where the boundary is asked for, (n,).
        width: Distance from there at which an answer counts 0.6 of one in the middle.
    """
    x = np.column_stack((np.ones(len(u)), (u - middle) / width))
    weight = np.exp(-0.5 * (x[:, 1:] ** 2).sum(axis=1))
    near = weight > 1e-4
    x, weight, y = x[near], weight[near], fell[near]
    ridge = np.diag(np.full(x.shape[1], RIDGE))
    ridge[0, 0] = RIDGE / 10.0
    beta = np.zeros(x.shape[1])
    for _ in range(ROUNDS):
        p = 1.0 / (1.0 + np.exp(-np.clip(x @ beta, -30.0, 30.0)))
        slope = x.T @ (weight * (y - p)) - ridge @ beta
        change = np.linalg.solve((x.T * (weight * p * (1.0 - p))) @ x + ridge, slope)
        beta += np.clip(change, -5.0, 5.0)
        if np.abs(change).max() < CONVERGED:
            break
    size = float(np.linalg.norm(beta[1:]))
    if size < 1e-12:
        return np.zeros(len(middle)), 0.0
    normal = beta[1:] / size
    return normal, float(normal @ middle - beta[0] * width / size)
