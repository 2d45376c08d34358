"""The equations of the rigid plant: a pin on MuJoCo's unpinned equations of motion, and nothing else.

MuJoCo gives M (7, 7) and the bias c (7,) of M a + c = tau + J' F. With the stance foot pinned all velocities are
v = T(q) dq and all accelerations a = T ddq + s(q, dq), with T (7, 5) because the hip hangs on the stance foot.
The pin does no work along T, so T' (M (T ddq + s) + c - tau) = 0 gives ddq, and the rows of the hip, which only
the ground pushes, give F. Joint vectors (5,) are ordered as `sim.interface.COORDINATES`.
"""

from typing import Any

import numpy as np
from numba import carray
from numpy.typing import NDArray

from controller.common.compiled import compiled, nested
from controller.common.products import applied
from sim.plant.engine import pointer

Array = NDArray[np.float64]
Work = NDArray[np.void]
"""One record of `WORK`, (1,): handing over one argument costs a tenth of handing over ten."""

TORSO = 4
STAGES = 4  # of RK4

WORK = np.dtype(
    [
        ("model", np.int64),  # addresses
        ("data", np.int64),
        ("qpos", np.int64),
        ("qvel", np.int64),
        ("xpos", np.int64),
        ("xmat", np.int64),
        ("M_at", np.int64),  # of this record's own M and so on
        ("bias_at", np.int64),
        ("applied_at", np.int64),
        ("pushing_at", np.int64, (3,)),
        ("nbody", np.int64),
        ("bodies", np.int64, (5,)),  # MuJoCo's numbers of the links
        ("capsules", float, (3, 2)),  # [m] length and thickness of torso and femurs
        ("limits", float, (4,)),  # [N.m]
        ("period", float),  # [s]
        ("substeps", np.int64),
        ("ticks", np.int64),
        ("now", float, (10,)),  # angles and rates
        ("torque", float, (4,)),  # [N.m] held
        ("push", float, (2,)),  # [N] sum of the forces held
        ("force_time", float, (2, 2)),  # [N.s] ground's impulse (x, z) on each foot over the hold
        ("pushing", float, (3, 3)),  # force, torque and point for MuJoCo
        ("hip", np.int64, (2,)),  # addresses of hip x and hip z in MuJoCo's vectors
        ("q", np.int64, (5,)),  # addresses of the five angles
        ("damping", float, (7,)),  # [N.m.s/rad] of every degree of freedom
        ("lengths", float, (2, 2)),  # [m] hip to knee and knee to foot point, a row a leg
        ("leg", np.int64),  # the pinned foot, 0 left, 1 right
        ("foothold", float, (2,)),  # [m] where it stands
        ("M", float, (7, 7)),  # inertia matrix as MuJoCo orders it
        ("bias", float, (7,)),  # gravity, Coriolis and centrifugal forces
        ("applied", float, (7,)),  # generalised forces of motors and pushes
        ("T", float, (7, 5)),  # velocity of every degree of freedom per joint rate
        ("shift", float, (7,)),  # acceleration at ddq = 0
        ("A", float, (5, 5)),  # reduced inertia matrix, overwritten by its factor
        ("start", float, (12,)),  # angles, rates, and the ground's impulse (x, z) on the foot at the start of a step
        ("y", float, (12,)),  # the same at the present stage, and at the end of the step
        ("slopes", float, (STAGES, 12)),  # its derivatives
    ],
    align=True,
)
"""What the pinned walker is and the work space of its equations; SI units."""


@nested
def place(work: Work, q: Array, dq: Array) -> None:
    """Write MuJoCo's position and velocity of the walker whose pinned foot rests on the foothold."""
    w: Any = work[0]
    qpos, qvel = carray(pointer(w.qpos), (7,)), carray(pointer(w.qvel), (7,))
    leg = w.leg
    femur, tibia = w.lengths[leg, 0], w.lengths[leg, 1]
    a = q[TORSO] + q[leg]
    b = a + q[2 + leg]
    da = dq[TORSO] + dq[leg]
    db = da + dq[2 + leg]
    x, z = w.hip[0], w.hip[1]
    qpos[x] = w.foothold[0] + femur * np.sin(a) + tibia * np.sin(b)
    qpos[z] = w.foothold[1] - femur * np.cos(a) - tibia * np.cos(b)
    qvel[x] = femur * da * np.cos(a) + tibia * db * np.cos(b)
    qvel[z] = femur * da * np.sin(a) + tibia * db * np.sin(b)
    for i in range(5):
        qpos[w.q[i]] = q[i]
        qvel[w.q[i]] = dq[i]


@nested
def pin(work: Work, q: Array, dq: Array, leg: int) -> None:
    """Fill T and s of the walker pinned at foot `leg`."""
    w: Any = work[0]
    T, shift, hip, angle = w.T, w.shift, w.hip, w.q
    femur, tibia = w.lengths[leg, 0], w.lengths[leg, 1]
    a = q[TORSO] + q[leg]
    b = a + q[2 + leg]
    da = dq[TORSO] + dq[leg]
    db = da + dq[2 + leg]
    T[:, :] = 0.0
    shift[:] = 0.0
    for i in range(5):
        T[angle[i], i] = 1.0
    x, z = hip[0], hip[1]
    T[x, 2 + leg] = tibia * np.cos(b)
    T[z, 2 + leg] = tibia * np.sin(b)
    T[x, leg] = T[x, TORSO] = femur * np.cos(a) + tibia * np.cos(b)
    T[z, leg] = T[z, TORSO] = femur * np.sin(a) + tibia * np.sin(b)
    shift[x] = -femur * da * da * np.sin(a) - tibia * db * db * np.sin(b)
    shift[z] = femur * da * da * np.cos(a) + tibia * db * db * np.cos(b)


@compiled
def swing_foot(work: Work, q: Array, dq: Array) -> tuple[float, float, float, float]:
    """Swing foot from the pinned foot: x, z in [m] and their rates in [m/s]."""
    w: Any = work[0]
    x = z = dx = dz = 0.0
    for side in range(2):
        sign = -1.0 if side == w.leg else 1.0
        femur, tibia = w.lengths[side, 0], w.lengths[side, 1]
        a = q[TORSO] + q[side]
        b = a + q[2 + side]
        da = dq[TORSO] + dq[side]
        db = da + dq[2 + side]
        x -= sign * (femur * np.sin(a) + tibia * np.sin(b))
        z += sign * (femur * np.cos(a) + tibia * np.cos(b))
        dx -= sign * (femur * da * np.cos(a) + tibia * db * np.cos(b))
        dz -= sign * (femur * da * np.sin(a) + tibia * db * np.sin(b))
    return x, z, dx, dz


@nested
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


@nested
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


@nested
def slope(work: Work, y: Array, dy: Array) -> None:
    """Rates, accelerations, and the force of the ground on the pinned foot at y; M, bias and applied are filled."""
    w: Any = work[0]
    M, T, shift, A, angle, hip = w.M, w.T, w.shift, w.A, w.q, w.hip
    q, dq, ddq, force = y[:5], y[5:10], dy[5:10], dy[10:]
    pin(work, q, dq, w.leg)
    reduce(M, T, A)
    rest = np.empty(7)  # M s + c - tau
    for k in range(7):
        rest[k] = w.bias[k] - w.applied[k]
        for n in range(7):
            rest[k] += M[k, n] * shift[n]
    for i in range(5):
        rest[angle[i]] += w.damping[angle[i]] * dq[i]
    for i in range(5):
        dy[i] = dq[i]
        ddq[i] = 0.0
        for k in range(7):
            ddq[i] -= T[k, i] * rest[k]
    solve(A, ddq)
    for axis in range(2):
        row = hip[axis]
        force[axis] = rest[row]
        for i in range(5):
            acceleration = 0.0
            for n in range(7):
                acceleration += M[row, n] * T[n, i]
            force[axis] += acceleration * ddq[i]


@compiled
def strike(work: Work, q: Array, before: Array, after: Array, impulse: Array, old_foot: Array) -> None:
    """Inelastic, no-slip impact of the swing foot: T' M (T dq+ - v-) = 0 about the foot that lands; M is filled.

    Args:
        work: The walker before the impact.
        q: Angles in [rad], (5,).
        before: Rates before the impact in [rad/s], (5,).
        after: Filled with the rates after it in [rad/s], (5,).
        impulse: Filled with the ground's impulse (x, z) on the landing foot in [N.s], (2,).
        old_foot: Filled with the velocity (x, z) with which the old stance foot leaves in [m/s], (2,).
    """
    w: Any = work[0]
    M, T, A, hip = w.M, w.T, w.A, w.hip
    pinned = w.leg
    landing = 1 - pinned
    pin(work, q, before, pinned)
    velocity = applied(T, before)
    momentum = applied(M, velocity)
    pin(work, q, before, landing)
    reduce(M, T, A)
    for i in range(5):
        after[i] = 0.0
        for k in range(7):
            after[i] += T[k, i] * momentum[k]
    solve(A, after)
    new_velocity = applied(T, after)
    new_momentum = applied(M, new_velocity)
    pin(work, q, before, pinned)
    hip_of_pinned = applied(T, after)
    for axis in range(2):
        row = hip[axis]
        impulse[axis] = new_momentum[row] - momentum[row]
        old_foot[axis] = new_velocity[row] - hip_of_pinned[row]
