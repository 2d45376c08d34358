"""Compiled course of the rigid plant: where MuJoCo looks, the pinned walker's steps of RK4, a hold, what it reads."""

import math
from typing import Any

import numpy as np
from numba import carray

from controller.common.compiled import compiled, nested
from sim.plant.engine import (
    mj_applyFT,
    mj_comPos,
    mj_comVel,
    mj_fullM,
    mj_kinematics,
    mj_makeM,
    mj_rne,
    pointer,
)
from sim.plant.rigid_equations import STAGES, TORSO, Array, Work, place, slope, swing_foot
from sim.plant.rows import COS, INTERCEPT, SIN, TAN, facet_under, height_under

ALL, NO_TORQUE = -1, -2
"""How a hold ended: all substeps taken, or none; else the number of the substep in which the swing foot lands."""


@nested
def begin(work: Work, q: Array, dq: Array) -> None:
    """Start a step of RK4 at (q, dq), with no impulse so far, and write where MuJoCo has to look first."""
    w: Any = work[0]
    for i in range(5):
        w.start[i] = q[i]
        w.start[5 + i] = dq[i]
    w.start[10:] = 0.0
    w.y[:] = w.start
    place(work, q, dq)


@nested
def stage(work: Work, number: int, h: float) -> None:
    """A stage of RK4 over h [s]: the slope where MuJoCo has looked, then y for the next stage, or the end."""
    w: Any = work[0]
    start, y, slopes = w.start, w.y, w.slopes
    slope(work, y, slopes[number])
    if number == STAGES - 1:
        for i in range(12):
            y[i] = start[i] + h / 6.0 * (slopes[0, i] + 2.0 * slopes[1, i] + 2.0 * slopes[2, i] + slopes[3, i])
        return
    ahead = h if number == 2 else 0.5 * h
    for i in range(12):
        y[i] = start[i] + ahead * slopes[number, i]
    place(work, y[:5], y[5:10])


@nested
def weigh(work: Work) -> None:
    """Inertia matrix where the walker has been placed."""
    w: Any = work[0]
    mj_kinematics(w.model, w.data)
    mj_comPos(w.model, w.data)
    mj_makeM(w.model, w.data)
    mj_fullM(w.model, w.data, w.M_at)


@nested
def load(work: Work, forces: Any, acting: Any) -> None:
    """Generalised forces of motors and of the pushes that act, where the walker has been placed."""
    w: Any = work[0]
    w.applied[:] = 0.0
    for j in range(4):
        w.applied[w.q[j]] = w.torque[j]
    if forces.shape[0] == 0:
        return
    xpos, xmat = carray(pointer(w.xpos), (w.nbody, 3)), carray(pointer(w.xmat), (w.nbody, 9))
    force, point = w.pushing[0], w.pushing[2]
    for number in range(forces.shape[0]):
        if acting[number]:
            push = forces[number]
            body = w.bodies[push.link]
            for axis in range(3):
                along = xmat[body, 3 * axis] * push.point[0] + xmat[body, 3 * axis + 2] * push.point[1]
                point[axis] = xpos[body, axis] + along
            force[0], force[2] = push.force[0], push.force[1]
            mj_applyFT(w.model, w.data, w.pushing_at[0], w.pushing_at[1], w.pushing_at[2], np.int32(body), w.applied_at)


@compiled
def after(work: Work, forces: Any, acting: Any, q: Array, dq: Array, h: float) -> None:
    """Fill y with angles and rates h [s] later under the load, and the ground's impulse over h in [N.s], (12,)."""
    w: Any = work[0]
    begin(work, q, dq)
    for number in range(STAGES):
        weigh(work)
        mj_comVel(w.model, w.data)
        mj_rne(w.model, w.data, np.int32(0), w.bias_at)
        load(work, forces, acting)
        stage(work, number, h)


@compiled
def swing_height(work: Work, ground: Array, q: Array, dq: Array) -> tuple[float, float, float]:
    """Swing foot: distance ahead of the stance foot, height over the ground in [m], its rate in [m/s]."""
    w: Any = work[0]
    x, z, dx, dz = swing_foot(work, q, dq)
    at = w.foothold[0] + x
    facet = facet_under(ground, at)
    height = w.foothold[1] + z - (ground[facet, INTERCEPT] + ground[facet, TAN] * at)
    return x, height, dz - ground[facet, TAN] * dx


@nested
def take(work: Work) -> None:
    """Make the result of `after` the present."""
    w: Any = work[0]
    for i in range(10):
        w.now[i] = w.y[i]
    for axis in range(2):
        w.force_time[w.leg, axis] += w.y[10 + axis]


@compiled
def start_hold(work: Work, step: Any, i: int, forces: Any, acting: Any) -> bool:
    """Take over the torque of row `i`, saturated, and the forces that act; whether the torque is one."""
    w: Any = work[0]
    u = step[i].u_total
    if not math.isfinite(u[0] + u[1] + u[2] + u[3]):
        return False
    for j in range(4):
        w.torque[j] = min(max(u[j], -w.limits[j]), w.limits[j])
    w.push[:] = 0.0
    for number in range(forces.shape[0]):
        if acting[number]:
            w.push[0] += forces[number].force[0]
            w.push[1] += forces[number].force[1]
    w.force_time[:, :] = 0.0
    return True


@compiled
def hold(work: Work, ground: Array, forces: Any, acting: Any, first: int) -> int:
    """Take the substeps of a hold from the first on, up to the one in which the swing foot lands; see `ALL`."""
    w: Any = work[0]
    duration = w.period / w.substeps
    q, dq = w.now[:5], w.now[5:]
    for substep in range(first, w.substeps):
        after(work, forces, acting, q, dq, duration)
        _, before, _ = swing_height(work, ground, q, dq)
        ahead, height, _ = swing_height(work, ground, w.y[:5], w.y[5:10])
        if height <= 0.0 and before > 0.0 and ahead > 0.0:
            return substep
        take(work)
    w.ticks += 1
    return ALL


@compiled
def look(work: Work, ground: Array, state: Any, seen: Any, i: int) -> None:
    """Fill row `i` of the truth and of what ideal sensors read; forces leave the impulse of an impact out."""
    w: Any = work[0]
    s, o = state[i], seen[i]
    q, dq = w.now[:5], w.now[5:]
    place(work, q, dq)
    qpos, qvel = carray(pointer(w.qpos), (7,)), carray(pointer(w.qvel), (7,))
    s.t = o.t = w.ticks * w.period
    for j in range(5):
        s.q[j] = o.q[j] = q[j]
        s.dq[j] = o.dq[j] = dq[j]
    for j in range(4):
        s.torque[j] = w.torque[j]
    x, z, _, _ = swing_foot(work, q, dq)
    for j in range(2):
        s.hip[j], s.dhip[j] = qpos[w.hip[j]], qvel[w.hip[j]]
        s.push[j] = w.push[j]
        s.contact[j] = o.contact[j] = w.leg == j
        s.foot[w.leg, j] = w.foothold[j]
    s.foot[1 - w.leg, 0], s.foot[1 - w.leg, 1] = w.foothold[0] + x, w.foothold[1] + z
    for foot in range(2):
        facet = facet_under(ground, s.foot[foot, 0])
        cos, sin = ground[facet, COS], ground[facet, SIN]
        s.clearance[foot] = (s.foot[foot, 1] - (ground[facet, INTERCEPT] + ground[facet, TAN] * s.foot[foot, 0])) * cos
        fx, fz = w.force_time[foot, 0] / w.period, w.force_time[foot, 1] / w.period
        s.contact_force[foot, 0] = fx * cos + fz * sin
        s.contact_force[foot, 1] = fz * cos - fx * sin
    hip_height = s.hip[1] - height_under(ground, s.hip[0])
    s.penetrating[:] = 0
    for link in range(3):  # the capsules of those that the other plant senses
        angle = q[TORSO] if link == 0 else q[TORSO] + q[link - 1]
        length, thickness = w.capsules[link, 0], w.capsules[link, 1]
        end_x, end_z = s.hip[0] - length * math.sin(angle), s.hip[1] + length * math.cos(angle)
        if hip_height < thickness or end_z - height_under(ground, end_x) < thickness:
            s.penetrating[(0, 1, 3)[link]] = 1
