"""The equations of the rigid plant: five links in a plane, turning about one foot, in closed form.

The angles phi (5,) of the links from "up", ordered as `sim.interface.LINKS`, are what the equations are written in;
R(phi) turns by phi, and J = dR/dphi. From the pinned foot the centre of mass of link i is at sum_j R(phi_j) c_ij, so
that with d = phi_k - phi_j and the sums of `five_links.FiveLinks`

    M_jk = along_jk cos d + cross_jk sin d + turning_jk,
    M ddphi = forces + sum_k (along_jk sin d - cross_jk cos d) dphi_k^2 + (J_j moment_j) . gravity,

and the ground carries what momentum and weight ask for. Outside this module joint vectors (5,) are ordered as
`sim.interface.COORDINATES`. The truth's own arithmetic: nothing of what the controller believes is in it.

Source: the plane case of Featherstone, "Rigid Body Dynamics Algorithms" (2008), chapter 6, with the recursion written
out; the impact is Westervelt et al., "Feedback Control of Dynamic Bipedal Robot Locomotion" (2007), section 3.4.2.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.common.compiled import compiled, nested

Array = NDArray[np.float64]
Work = NDArray[np.void]
"""One record of `WORK`, (1,): handing over one argument costs a tenth of handing over ten."""

TORSO = 4
N = 5  # links
STAGES = 4  # of RK4
SLIDING = 0.05
"""[rad/s] at which dry friction is at 76 % of its full torque: below, a joint that should stick creeps."""

WORK = np.dtype(
    [
        ("qpos", np.int64),  # addresses of what a viewer looks at, 0 where none does
        ("qvel", np.int64),
        ("hip", np.int64, (2,)),  # places of hip x and hip z there
        ("q", np.int64, (N,)),  # places of the five angles there
        ("capsules", float, (3, 2)),  # [m] length and thickness of torso and femurs
        ("limits", float, (4,)),  # [N.m]
        ("period", float),  # [s]
        ("substeps", np.int64),
        ("ticks", np.int64),
        ("landings", np.int64),  # since the start
        ("now", float, (2 * N,)),  # angles and rates
        ("torque", float, (4,)),  # [N.m] held
        ("push", float, (2,)),  # [N] sum of the forces held
        ("force_time", float, (2, 2)),  # [N.s] ground's impulse (x, z) on each foot over the hold
        ("leg", np.int64),  # the pinned foot, 0 left, 1 right
        ("foothold", float, (2,)),  # [m] where it stands
        ("lengths", float, (2, 2)),  # [m] hip to knee and knee to foot point, a row a leg
        ("mass", float),  # [kg] of all links
        ("gravity", float, (2,)),  # [m/s^2]
        ("damping", float, (N,)),  # [N.m.s/rad] of the joints
        ("friction", float, (N,)),  # [N.m] of the joints
        ("along", float, (2, N, N)),  # [kg m^2] sums of `five_links`, by the pinned leg
        ("cross", float, (2, N, N)),
        ("moment", float, (2, N, 2)),  # [kg m]
        ("turning", float, (N, N)),  # [kg m^2]
        ("sin", float, (N,)),  # of the links' angles
        ("cos", float, (N,)),
        ("rate", float, (N,)),  # [rad/s] of the links
        ("M", float, (N, N)),  # inertia matrix; its lower triangle is overwritten by its factors
        ("x", float, (N,)),  # right-hand side and solution
        ("start", float, (2 * N + 2,)),  # angles, rates, and the ground's impulse (x, z) on the foot before a step
        ("y", float, (2 * N + 2,)),  # the same at the present stage, and at the end of the step
        ("slopes", float, (STAGES, 2 * N + 2)),  # its derivatives
    ],
    align=True,
)
"""What the pinned walker is and the work space of its equations; SI units."""


@nested
def turn(w: Any, q: Array, dq: Array) -> None:
    """Sines, cosines and rates of the links."""
    w.sin[0], w.cos[0], w.rate[0] = math.sin(q[TORSO]), math.cos(q[TORSO]), dq[TORSO]
    for leg in range(2):
        a, da = q[TORSO] + q[leg], dq[TORSO] + dq[leg]
        b, db = a + q[2 + leg], da + dq[2 + leg]
        femur, tibia = 1 + 2 * leg, 2 + 2 * leg
        w.sin[femur], w.cos[femur], w.rate[femur] = math.sin(a), math.cos(a), da
        w.sin[tibia], w.cos[tibia], w.rate[tibia] = math.sin(b), math.cos(b), db


@nested
def foot(w: Any, leg: int) -> tuple[float, float, float, float]:
    """Foot point of a leg from the hip, where the links have been turned to: x, z in [m], their rates in [m/s]."""
    femur, tibia = w.lengths[leg, 0], w.lengths[leg, 1]
    a, b = 1 + 2 * leg, 2 + 2 * leg
    x = -femur * w.sin[a] - tibia * w.sin[b]
    z = femur * w.cos[a] + tibia * w.cos[b]
    dx = -femur * w.rate[a] * w.cos[a] - tibia * w.rate[b] * w.cos[b]
    dz = -femur * w.rate[a] * w.sin[a] - tibia * w.rate[b] * w.sin[b]
    return x, z, dx, dz


@nested
def swing_foot(w: Any) -> tuple[float, float, float, float]:
    """Swing foot from the pinned foot, where the links have been turned to: x, z in [m], their rates in [m/s]."""
    x, z, dx, dz = foot(w, 1 - w.leg)
    there = foot(w, w.leg)
    return x - there[0], z - there[1], dx - there[2], dz - there[3]


@nested
def weigh(w: Any, leg: int, x: Array) -> None:
    """Fill M of the walker pinned at the foot of a leg, and add to x what turning and gravity do to the links."""
    along, cross, moment, M = w.along[leg], w.cross[leg], w.moment[leg], w.M
    for j in range(N):
        M[j, j] = along[j, j] + w.turning[j, j]
        for k in range(j):
            cos = w.cos[j] * w.cos[k] + w.sin[j] * w.sin[k]
            sin = w.sin[k] * w.cos[j] - w.cos[k] * w.sin[j]
            M[j, k] = M[k, j] = along[j, k] * cos + cross[j, k] * sin + w.turning[j, k]
            fling = along[j, k] * sin - cross[j, k] * cos
            x[j] += fling * w.rate[k] * w.rate[k]
            x[k] -= fling * w.rate[j] * w.rate[j]
        jx, jz = arm(w, moment, j)
        x[j] += jx * w.gravity[0] + jz * w.gravity[1]


@nested
def arm(w: Any, vectors: Array, j: int) -> tuple[float, float]:
    """How a vector (x, z) in the frame of link j moves as the link turns: J vector, where it has been turned to."""
    x, z = vectors[j, 0], vectors[j, 1]
    return -x * w.sin[j] - z * w.cos[j], x * w.cos[j] - z * w.sin[j]


@nested
def solve(M: Array, x: Array) -> None:
    """Solve M x = rhs in place, M symmetric positive definite; its lower triangle becomes L, its diagonal 1 / D."""
    for k in range(N):
        M[k, k] = 1.0 / M[k, k]
        for j in range(N - 1, k, -1):
            factor = M[j, k] * M[k, k]
            for i in range(k + 1, j + 1):
                M[j, i] -= factor * M[i, k]
            M[j, k] = factor
    for i in range(N):
        for k in range(i):
            x[i] -= M[i, k] * x[k]
    for i in range(N):
        x[i] *= M[i, i]
    for i in range(N - 1, -1, -1):
        for k in range(i + 1, N):
            x[i] -= M[k, i] * x[k]


@nested
def drive(w: Any, dq: Array, x: Array) -> None:
    """Fill x with what motors, damping and dry friction do to the links.

    Dry friction is F tanh(rate / `SLIDING`) against the rate: smooth, so that RK4 keeps its order, and as a joint at
    rest in MuJoCo does, it creeps below the friction that holds it.
    """
    x[0] = -w.damping[TORSO] * dq[TORSO]
    for leg in range(2):
        for below in range(2):
            joint, link = leg + 2 * below, 1 + 2 * leg + below
            torque = w.torque[joint] - w.damping[joint] * dq[joint]
            if w.friction[joint] != 0.0:
                torque -= w.friction[joint] * math.tanh(dq[joint] / SLIDING)
            x[link] = torque
            x[link - 1 if below else 0] -= torque


@nested
def push(w: Any, forces: Any, acting: Any, x: Array) -> None:
    """Add to x what the forces that act do to the links."""
    for number in range(forces.shape[0]):
        if not acting[number]:
            continue
        held = forces[number]
        fx, fz = held.force[0], held.force[1]
        for part in range(2):  # from the pinned foot up to the hip
            link, length = 1 + 2 * w.leg + part, w.lengths[w.leg, part]
            x[link] += length * (w.cos[link] * fx + w.sin[link] * fz)
        link = held.link
        if link > 0 and link % 2 == 0:  # from the hip down to the knee
            femur, length = link - 1, w.lengths[(link - 1) // 2, 0]
            x[femur] -= length * (w.cos[femur] * fx + w.sin[femur] * fz)
        px, pz = held.point[0], held.point[1]
        x[link] += (-px * w.sin[link] - pz * w.cos[link]) * fx + (px * w.cos[link] - pz * w.sin[link]) * fz


@nested
def slope(work: Work, forces: Any, acting: Any, y: Array, dy: Array) -> None:
    """Rates, accelerations, and the force of the ground on the pinned foot at y, under what is held."""
    w: Any = work[0]
    q, dq, x, moment = y[:N], y[N : 2 * N], w.x, w.moment[w.leg]
    turn(w, q, dq)
    drive(w, dq, x)
    push(w, forces, acting, x)
    weigh(w, w.leg, x)
    solve(w.M, x)
    fx, fz = -w.mass * w.gravity[0] - w.push[0], -w.mass * w.gravity[1] - w.push[1]
    for j in range(N):
        jx, jz = arm(w, moment, j)
        fx += jx * x[j] - jz * w.rate[j] * w.rate[j]
        fz += jz * x[j] + jx * w.rate[j] * w.rate[j]
    dy[2 * N], dy[2 * N + 1] = fx, fz
    for j in range(N):
        dy[j] = dq[j]
    to_joints(x, dy[N : 2 * N])


@nested
def to_joints(links: Array, joints: Array) -> None:
    """Fill rates or accelerations of the joints from those of the links, (5,) each."""
    joints[TORSO] = links[0]
    for leg in range(2):
        joints[leg], joints[2 + leg] = links[1 + 2 * leg] - links[0], links[2 + 2 * leg] - links[1 + 2 * leg]


@compiled
def strike(work: Work, q: Array, before: Array, after: Array, impulse: Array, old_foot: Array) -> None:
    """Inelastic, no-slip impact of the swing foot, about which angular momentum stays what it is.

    With v the velocity of the foot that lands and M about it, M (dphi+ - dphi-) = sum_i m_i (J_j c_ij) . v.

    Args:
        work: The walker before the impact.
        q: Angles in [rad], (5,).
        before: Rates before the impact in [rad/s], (5,).
        after: Filled with the rates after it in [rad/s], (5,).
        impulse: Filled with the ground's impulse (x, z) on the landing foot in [N.s], (2,).
        old_foot: Filled with the velocity (x, z) with which the old stance foot leaves in [m/s], (2,).
    """
    w: Any = work[0]
    landing = 1 - w.leg
    moment, x, ignored = w.moment[landing], w.x, w.slopes[0, :N]
    turn(w, q, before)
    _, _, vx, vz = swing_foot(w)
    weigh(w, landing, ignored)
    for j in range(N):
        jx, jz = arm(w, moment, j)
        x[j] = jx * vx + jz * vz
    solve(w.M, x)
    impulse[0], impulse[1] = -w.mass * vx, -w.mass * vz
    for j in range(N):
        jx, jz = arm(w, moment, j)
        impulse[0] += jx * x[j]
        impulse[1] += jz * x[j]
    to_joints(x, after)
    for j in range(N):
        after[j] += before[j]
    turn(w, q, after)
    _, _, dx, dz = swing_foot(w)
    old_foot[0], old_foot[1] = -dx, -dz
