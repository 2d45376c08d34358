"""Compiled course of the rigid plant: steps of RK4 about the pinned foot, landings between them, what it reads."""

import math
from typing import Any

import numpy as np
from numba import carray

from controller.common.compiled import compiled, nested
from sim.plant.engine import pointer
from sim.plant.rigid_equations import STAGES, Array, N, Work, foot, slope, strike, swing_foot, turn
from sim.plant.rows import COS, DIVERGED, FINE, INTERCEPT, NO_TORQUE, NOTED, SIN, TAN, facet_under, height_under

EPS = float(np.finfo(float).eps)
MOST_LANDINGS = 16  # within one substep; a walker makes one
NEWTON, SEARCHES = 8, 64  # evaluations by Newton's method in search of a landing, and in all

IMPACT = np.dtype(
    [
        ("t", float),
        ("leg", np.int64),
        ("q", float, (N,)),
        ("dq", float, (N,)),
        ("dq_after", float, (N,)),
        ("impulse", float, (2,)),
        ("old_foot", float, (2,)),
    ],
    align=True,
)
"""A landing as `rigid_plant.Impact` tells it; `leg` is the row of the foot that stood before."""


@compiled
def after(work: Work, forces: Any, acting: Any, q: Array, dq: Array, h: float) -> None:
    """Fill y with angles and rates h [s] later under the load, and the ground's impulse over h in [N.s], (12,)."""
    w: Any = work[0]
    start, y, slopes = w.start, w.y, w.slopes
    for i in range(N):
        start[i], start[N + i] = q[i], dq[i]
    start[2 * N], start[2 * N + 1] = 0.0, 0.0
    for i in range(y.shape[0]):
        y[i] = start[i]
    for number in range(STAGES):
        slope(work, forces, acting, y, slopes[number])
        if number < STAGES - 1:
            ahead = h if number == 2 else 0.5 * h
            for i in range(y.shape[0]):
                y[i] = start[i] + ahead * slopes[number, i]
    for i in range(y.shape[0]):
        y[i] = start[i] + h / 6.0 * (slopes[0, i] + 2.0 * slopes[1, i] + 2.0 * slopes[2, i] + slopes[3, i])


@compiled
def swing_height(work: Work, ground: Array, q: Array, dq: Array) -> tuple[float, float, float]:
    """Swing foot: distance ahead of the stance foot, height over the ground in [m], its rate in [m/s]."""
    w: Any = work[0]
    turn(w, q, dq)
    x, z, dx, dz = swing_foot(w)
    at = w.foothold[0] + x
    facet = facet_under(ground, at)
    height = w.foothold[1] + z - (ground[facet, INTERCEPT] + ground[facet, TAN] * at)
    return x, height, dz - ground[facet, TAN] * dx


@nested
def landing(work: Work, ground: Array, forces: Any, acting: Any, h: float) -> float:
    """Time until the swing foot is on the ground in [s], which it is above now and not after h; y is filled there.

    Newton's method inside a bracket, which is halved where that leaves it or takes long, as on a kerb.
    """
    w: Any = work[0]
    q, dq = w.now[:N], w.now[N:]
    low, high, tau = 0.0, h, h
    for search in range(SEARCHES):
        _, height, rate = swing_height(work, ground, w.y[:N], w.y[N : 2 * N])
        if height > 0.0:
            low = tau
        else:
            high = tau
        then = tau - height / rate if search < NEWTON and rate != 0.0 else 0.5 * (low + high)
        if not low < then < high:
            then = 0.5 * (low + high)
        if abs(height) <= EPS or high - low <= EPS * h or then == tau:
            return tau
        tau = then
        after(work, forces, acting, q, dq, tau)
    return tau


@nested
def take(work: Work) -> None:
    """Make the result of `after` the present."""
    w: Any = work[0]
    for i in range(2 * N):
        w.now[i] = w.y[i]
    for axis in range(2):
        w.force_time[w.leg, axis] += w.y[2 * N + axis]


@compiled
def land(work: Work, impacts: Any, t: float) -> None:
    """The swing foot becomes the stance foot, at t [s]; a row of `impacts` tells it."""
    w: Any = work[0]
    row = impacts[w.landings % impacts.shape[0]]
    q, dq = w.now[:N], w.now[N:]
    row.t, row.leg = t, w.leg
    for i in range(N):
        row.q[i], row.dq[i] = q[i], dq[i]
    strike(work, q, dq, row.dq_after, row.impulse, row.old_foot)
    x, z, _, _ = swing_foot(w)
    w.foothold[0], w.foothold[1] = w.foothold[0] + x, w.foothold[1] + z
    w.leg = 1 - w.leg
    w.landings += 1
    for i in range(N):
        dq[i] = row.dq_after[i]


@nested
def advance(work: Work, ground: Array, impacts: Any, forces: Any, acting: Any, t: float, duration: float) -> None:
    """One step of integration from t [s] on, cut where the swing foot lands."""
    w: Any = work[0]
    q, dq = w.now[:N], w.now[N:]
    left = duration
    for _ in range(MOST_LANDINGS):
        _, before, _ = swing_height(work, ground, q, dq)
        after(work, forces, acting, q, dq, left)
        ahead, height, _ = swing_height(work, ground, w.y[:N], w.y[N : 2 * N])
        if not (height <= 0.0 and before > 0.0 and ahead > 0.0):
            break
        tau = landing(work, ground, forces, acting, left)
        take(work)
        t += tau
        left -= tau
        land(work, impacts, t)
        if left <= 0.0:
            return
    take(work)


@compiled
def move(work: Work, ground: Array, impacts: Any, step: Any, i: int, forces: Any, acting: Any) -> int:
    """Hold the torque of row `i`, saturated, and the forces that act for one control period; how it ended."""
    w: Any = work[0]
    u = step[i].u_total
    if not math.isfinite(u[0] + u[1] + u[2] + u[3]):
        return NO_TORQUE
    for j in range(4):
        w.torque[j] = min(max(u[j], -w.limits[j]), w.limits[j])
    w.push[0], w.push[1] = 0.0, 0.0
    for number in range(forces.shape[0]):
        if acting[number]:
            w.push[0] += forces[number].force[0]
            w.push[1] += forces[number].force[1]
    w.force_time[:, :] = 0.0
    landings = w.landings
    duration = w.period / w.substeps
    for substep in range(w.substeps):
        advance(work, ground, impacts, forces, acting, w.ticks * w.period + substep * duration, duration)
    w.ticks += 1
    total = 0.0
    for j in range(2 * N):
        total += w.now[j]
    if not math.isfinite(total):
        return DIVERGED
    return FINE if w.landings == landings else NOTED


@compiled
def look(work: Work, ground: Array, state: Any, seen: Any, i: int) -> None:
    """Fill row `i` of the truth and of what ideal sensors read; forces leave the impulse of an impact out."""
    w: Any = work[0]
    s, o = state[i], seen[i]
    q, dq = w.now[:N], w.now[N:]
    turn(w, q, dq)
    s.t = o.t = w.ticks * w.period
    for j in range(N):
        s.q[j] = o.q[j] = q[j]
        s.dq[j] = o.dq[j] = dq[j]
    for j in range(4):
        s.torque[j] = w.torque[j]
    x, z, dx, dz = foot(w, w.leg)
    s.hip[0], s.hip[1], s.dhip[0], s.dhip[1] = w.foothold[0] - x, w.foothold[1] - z, -dx, -dz
    for j in range(2):
        s.push[j] = w.push[j]
        s.contact[j] = o.contact[j] = w.leg == j
        s.foot[w.leg, j] = w.foothold[j]
    x, z, _, _ = swing_foot(w)
    s.foot[1 - w.leg, 0], s.foot[1 - w.leg, 1] = w.foothold[0] + x, w.foothold[1] + z
    for side in range(2):
        facet = facet_under(ground, s.foot[side, 0])
        cos, sin = ground[facet, COS], ground[facet, SIN]
        s.clearance[side] = (s.foot[side, 1] - (ground[facet, INTERCEPT] + ground[facet, TAN] * s.foot[side, 0])) * cos
        fx, fz = w.force_time[side, 0] / w.period, w.force_time[side, 1] / w.period
        s.contact_force[side, 0] = fx * cos + fz * sin
        s.contact_force[side, 1] = fz * cos - fx * sin
    hip_height = s.hip[1] - height_under(ground, s.hip[0])
    s.penetrating[:] = 0
    for capsule in range(3):  # of those links that the other plant senses
        link = (0, 1, 3)[capsule]
        length, thickness = w.capsules[capsule, 0], w.capsules[capsule, 1]
        end_x, end_z = s.hip[0] - length * w.sin[link], s.hip[1] + length * w.cos[link]
        if hip_height < thickness or end_z - height_under(ground, end_x) < thickness:
            s.penetrating[link] = 1
    if w.qpos != 0:
        show(w, s)


@nested
def show(w: Any, s: Any) -> None:
    """Write the walker where a viewer looks: into MuJoCo's position and velocity."""
    qpos, qvel = carray(pointer(w.qpos), (N + 2,)), carray(pointer(w.qvel), (N + 2,))
    for j in range(2):
        qpos[w.hip[j]], qvel[w.hip[j]] = s.hip[j], s.dhip[j]
    for j in range(N):
        qpos[w.q[j]], qvel[w.q[j]] = s.q[j], s.dq[j]
