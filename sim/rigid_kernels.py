"""Compiled arithmetic of the rigid plant: a pin on MuJoCo's unpinned equations of motion, and nothing else.

MuJoCo gives M (7, 7) and the bias c (7,) of M a + c = tau + J' F. With the stance foot pinned all velocities are
v = T(q) dq and all accelerations a = T ddq + s(q, dq), with T (7, 5) because the hip hangs on the stance foot.
The pin does no work along T, so T' (M (T ddq + s) + c - tau) = 0 gives ddq, and the rows of the hip, which only
the ground pushes, give F. Joint vectors (5,) are ordered as `sim.interface.COORDINATES`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

compiled = njit(cache=True, error_model="numpy")
"""Divide as NumPy does: a walker that falls gives inf, which the plant reports, not an exception."""

TORSO = 4
HIP_X, HIP_Z = 0, 1


class Layout(NamedTuple):
    """Where things are in MuJoCo's vectors.

    Attributes:
        hip: Addresses of hip x and hip z, (2,).
        q: Addresses of the five angles, (5,).
        damping: Damping of every degree of freedom in [N.m.s/rad], (7,).
        lengths: Hip to knee and knee to foot point in [m], a row a leg, (2, 2).
    """

    hip: NDArray[np.intp]
    q: NDArray[np.intp]
    damping: Array
    lengths: Array


class Scratch(NamedTuple):
    """Work space of one evaluation.

    Attributes:
        M: Inertia matrix as MuJoCo orders it, (7, 7).
        bias: Gravity, Coriolis and centrifugal forces, same order, (7,).
        applied: Generalised forces of motors and pushes, same order, (7,).
        T: Velocity of every degree of freedom per joint rate, (7, 5).
        shift: Acceleration at ddq = 0, (7,).
        A: Reduced inertia matrix, overwritten by its factor, (5, 5).
    """

    M: Array
    bias: Array
    applied: Array
    T: Array
    shift: Array
    A: Array


def new_scratch() -> Scratch:
    """Allocate the work space."""
    return Scratch(np.zeros((7, 7)), np.zeros(7), np.zeros(7), np.zeros((7, 5)), np.zeros(7), np.zeros((5, 5)))


@compiled
def place(at: Layout, q: Array, dq: Array, leg: int, foothold: Array, qpos: Array, qvel: Array) -> None:
    """MuJoCo's position and velocity of the walker whose foot `leg` (0 left, 1 right) rests on the foothold."""
    femur, tibia = at.lengths[leg, 0], at.lengths[leg, 1]
    a = q[TORSO] + q[leg]
    b = a + q[2 + leg]
    da = dq[TORSO] + dq[leg]
    db = da + dq[2 + leg]
    qpos[at.hip[0]] = foothold[0] + femur * np.sin(a) + tibia * np.sin(b)
    qpos[at.hip[1]] = foothold[1] - femur * np.cos(a) - tibia * np.cos(b)
    qvel[at.hip[0]] = femur * da * np.cos(a) + tibia * db * np.cos(b)
    qvel[at.hip[1]] = femur * da * np.sin(a) + tibia * db * np.sin(b)
    for i in range(5):
        qpos[at.q[i]] = q[i]
        qvel[at.q[i]] = dq[i]


@compiled
def pin(at: Layout, q: Array, dq: Array, leg: int, T: Array, shift: Array) -> None:
    """T and s of the walker pinned at foot `leg`."""
    femur, tibia = at.lengths[leg, 0], at.lengths[leg, 1]
    a = q[TORSO] + q[leg]
    b = a + q[2 + leg]
    da = dq[TORSO] + dq[leg]
    db = da + dq[2 + leg]
    T[:, :] = 0.0
    shift[:] = 0.0
    for i in range(5):
        T[at.q[i], i] = 1.0
    x, z = at.hip[0], at.hip[1]
    T[x, 2 + leg] = tibia * np.cos(b)
    T[z, 2 + leg] = tibia * np.sin(b)
    T[x, leg] = T[x, TORSO] = femur * np.cos(a) + tibia * np.cos(b)
    T[z, leg] = T[z, TORSO] = femur * np.sin(a) + tibia * np.sin(b)
    shift[x] = -femur * da * da * np.sin(a) - tibia * db * db * np.sin(b)
    shift[z] = femur * da * da * np.cos(a) + tibia * db * db * np.cos(b)


@compiled
def swing_foot(at: Layout, q: Array, dq: Array, leg: int) -> tuple[float, float, float, float]:
    """Swing foot from the stance foot `leg`: x, z in [m] and their rates in [m/s]."""
    x = z = dx = dz = 0.0
    for side in range(2):
        sign = -1.0 if side == leg else 1.0
        femur, tibia = at.lengths[side, 0], at.lengths[side, 1]
        a = q[TORSO] + q[side]
        b = a + q[2 + side]
        da = dq[TORSO] + dq[side]
        db = da + dq[2 + side]
        x -= sign * (femur * np.sin(a) + tibia * np.sin(b))
        z += sign * (femur * np.cos(a) + tibia * np.cos(b))
        dx -= sign * (femur * da * np.cos(a) + tibia * db * np.cos(b))
        dz -= sign * (femur * da * np.sin(a) + tibia * db * np.sin(b))
    return x, z, dx, dz


@compiled
def reduce(M: Array, T: Array, A: Array) -> None:
    """A = T' M T."""
    for i in range(5):
        for j in range(i + 1):
            total = 0.0
            for k in range(7):
                if T[k, i] != 0.0:
                    row = 0.0
                    for n in range(7):
                        row += M[k, n] * T[n, j]
                    total += T[k, i] * row
            A[i, j] = total
            A[j, i] = total


@compiled
def solve(A: Array, x: Array) -> None:
    """Solve A x = rhs in place, A symmetric positive definite; its lower triangle becomes the Cholesky factor."""
    n = x.shape[0]
    for j in range(n):
        for k in range(j):
            A[j, j] -= A[j, k] * A[j, k]
        A[j, j] = np.sqrt(A[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] /= A[j, j]
    for i in range(n):
        for k in range(i):
            x[i] -= A[i, k] * x[k]
        x[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= A[k, i] * x[k]
        x[i] /= A[i, i]


@compiled
def derivative(at: Layout, y: Array, leg: int, w: Scratch, dy: Array) -> None:
    """Motion of the pinned walker: rates, accelerations, and the force of the ground on its foot.

    Args:
        at: Where things are.
        y: Angles in [rad] and rates in [rad/s], then what is not looked at, (12,).
        leg: The foot that is pinned, 0 left, 1 right.
        w: Work space with M, bias and applied filled.
        dy: Filled with rates in [rad/s], accelerations in [rad/s^2], and the ground's force (x, z) in the world
            frame in [N], (12,).
    """
    q, dq, ddq, force = y[:5], y[5:10], dy[5:10], dy[10:]
    pin(at, q, dq, leg, w.T, w.shift)
    reduce(w.M, w.T, w.A)
    rest = np.empty(7)  # M s + c - tau
    for k in range(7):
        rest[k] = w.bias[k] - w.applied[k]
        for n in range(7):
            rest[k] += w.M[k, n] * w.shift[n]
    for i in range(5):
        rest[at.q[i]] += at.damping[at.q[i]] * dq[i]
    for i in range(5):
        dy[i] = dq[i]
        ddq[i] = 0.0
        for k in range(7):
            ddq[i] -= w.T[k, i] * rest[k]
    solve(w.A, ddq)
    for axis in range(2):
        row = at.hip[axis]
        force[axis] = rest[row]
        for i in range(5):
            acceleration = 0.0
            for n in range(7):
                acceleration += w.M[row, n] * w.T[n, i]
            force[axis] += acceleration * ddq[i]


@compiled
def strike(
    at: Layout, q: Array, before: Array, leg: int, w: Scratch, after: Array, impulse: Array, old_foot: Array
) -> None:
    """Inelastic, no-slip impact of the swing foot: T' M (T dq+ - v-) = 0 about the foot that lands.

    Args:
        at: Where things are.
        q: Angles in [rad], (5,).
        before: Rates before the impact in [rad/s], (5,).
        leg: The foot that lands, 0 left, 1 right; the other one was pinned.
        w: Work space with M filled.
        after: Filled with the rates after it in [rad/s], (5,).
        impulse: Filled with the ground's impulse (x, z) on the landing foot in [N.s], (2,).
        old_foot: Filled with the velocity (x, z) with which the old stance foot leaves in [m/s], (2,).
    """
    pin(at, q, before, 1 - leg, w.T, w.shift)
    velocity = w.T @ before
    momentum = w.M @ velocity
    pin(at, q, before, leg, w.T, w.shift)
    reduce(w.M, w.T, w.A)
    for i in range(5):
        after[i] = 0.0
        for k in range(7):
            after[i] += w.T[k, i] * momentum[k]
    solve(w.A, after)
    new_velocity = w.T @ after
    new_momentum = w.M @ new_velocity
    pin(at, q, before, 1 - leg, w.T, w.shift)
    hip_of_pinned = w.T @ after
    for axis in range(2):
        row = at.hip[axis]
        impulse[axis] = new_momentum[row] - momentum[row]
        old_foot[axis] = new_velocity[row] - hip_of_pinned[row]
