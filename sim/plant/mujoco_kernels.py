"""Compiled arithmetic of the MuJoCo plant: hold a torque over the substeps, then see where everything is.

What MuJoCo reports after a step belongs to the start of that step, except `qpos` and `qvel`. Positions of hip and
feet are therefore computed here from `qpos` in closed form; contact flags are one substep old.
"""

import math
from typing import Any

import numpy as np
from numba import carray

from controller.common.compiled import Array, compiled, nested
from sim.plant.engine import mj_step, pointer, whole_pointer
from sim.plant.rows import COS, DIVERGED, FINE, INTERCEPT, NO_TORQUE, SIN, facet_under, height_under

TORSO = 4
BESIDE = 1.2  # of a foot's radius from its centre, where a riser is that it touches
WARNING_STRIDE = 2  # whole numbers from one kind of MuJoCo's warnings to the next: its last detail, its number
WORK = np.dtype(
    [
        ("model", np.int64),  # addresses
        ("data", np.int64),
        ("qpos", np.int64),
        ("qvel", np.int64),
        ("ctrl", np.int64),
        ("sensors", np.int64),
        ("actuator_force", np.int64),
        ("xfrc", np.int64),
        ("warnings", np.int64),
        ("nq", np.int64),  # sizes
        ("nu", np.int64),
        ("nsensordata", np.int64),
        ("nbody", np.int64),
        ("nwarning", np.int64),
        ("hip", np.int64, 2),  # positions in MuJoCo's vectors
        ("q", np.int64, 5),
        ("u", np.int64, 4),
        ("feet", np.int64, 2),
        ("links", np.int64, 5),  # -1 for links whose contact is not sensed
        ("bodies", np.int64, 5),
        ("com", float, (5, 2)),  # [m] of each link in its own frame
        ("lengths", float, (2, 2)),  # [m] hip to knee and knee to foot point, a row a leg
        ("radius", float),  # [m] of a foot
        ("period", float),  # [s]
        ("substeps", np.int64),
        ("ticks", np.int64),
        ("pushed", np.int8),  # whether forces are written into MuJoCo's memory
        ("push", float, 2),  # [N] sum of the forces over the last hold
        ("force", float, (2, 2)),  # [N] on each foot (x, z), sum over the substeps of the last hold
    ],
    align=True,
)
"""What the plant is and where it stands; SI units."""


@compiled
def look(work: Any, ground: Array, state: Any, seen: Any, i: int) -> None:
    """Fill row `i` of the truth and of what ideal sensors read; contact forces are zero before the first hold."""
    w, s, o = work[0], state[i], seen[i]
    qpos, qvel = carray(pointer(w.qpos), (w.nq,)), carray(pointer(w.qvel), (w.nq,))
    sensors, torque = carray(pointer(w.sensors), (w.nsensordata,)), carray(pointer(w.actuator_force), (w.nu,))
    s.t = o.t = w.ticks * w.period
    for j in range(5):
        s.q[j] = o.q[j] = qpos[w.q[j]]
        s.dq[j] = o.dq[j] = qvel[w.q[j]]
    for j in range(4):
        s.torque[j] = torque[w.u[j]]
    for j in range(2):
        s.hip[j], s.dhip[j] = qpos[w.hip[j]], qvel[w.hip[j]]
        s.push[j] = w.push[j]
    for j in range(5):
        s.penetrating[j] = w.links[j] >= 0 and sensors[w.links[j]] != 0.0
    for leg in range(2):
        femur, tibia = w.lengths[leg, 0], w.lengths[leg, 1]
        a = s.q[TORSO] + s.q[leg]
        b = a + s.q[2 + leg]
        x = s.hip[0] + (-femur * math.sin(a) - tibia * math.sin(b))
        z = s.hip[1] + (femur * math.cos(a) + tibia * math.cos(b))
        facet = facet_under(ground, x)
        cos, sin = ground[facet, COS], ground[facet, SIN]
        s.foot[leg, 0], s.foot[leg, 1] = x, z
        s.clearance[leg] = z - (x * sin + w.radius) / cos - ground[facet, INTERCEPT]
        s.contact[leg] = o.contact[leg] = sensors[w.feet[leg]] > 0.0 and _stands(w, ground, x, z)
        fx, fz = w.force[leg, 0] / w.substeps, w.force[leg, 1] / w.substeps
        s.contact_force[leg, 0] = fx * cos + fz * sin
        s.contact_force[leg, 1] = fz * cos - fx * sin


@nested
def _stands(w: Any, ground: Array, x: float, z: float) -> bool:
    """Whether a foot that touches ground, its centre at (x, z) in [m], stands: what it touches is no riser beside it.

    Where it touches nothing below, and the ground is higher than its centre to one side, it touches that; to both
    sides, it stands wedged in.
    """
    if ground.shape[0] == 1 or z - height_under(ground, x) <= 2.0 * w.radius:
        return True
    side = BESIDE * w.radius
    behind, ahead = height_under(ground, x - side) > z, height_under(ground, x + side) > z
    return behind == ahead


@compiled
def move(work: Any, step: Any, i: int, forces: Any, acting: Any) -> int:
    """Hold the torque of row `i` and the forces that act for one control period; how it ended."""
    w, u = work[0], step[i].u_total
    if not math.isfinite(u[0] + u[1] + u[2] + u[3]):
        return NO_TORQUE
    ctrl, sensors = carray(pointer(w.ctrl), (w.nu,)), carray(pointer(w.sensors), (w.nsensordata,))
    for j in range(4):
        ctrl[w.u[j]] = u[j]
    if w.pushed != 0 or forces.shape[0] > 0:
        _push(w, forces, acting)
    force = w.force
    force[:, :] = 0.0
    for _ in range(w.substeps):
        mj_step(w.model, w.data)
        for foot in range(2):  # a foot's sensor reads "found", then the net force on it in the world frame
            force[foot, 0] += sensors[w.feet[foot] + 1]
            force[foot, 1] += sensors[w.feet[foot] + 3]
    w.ticks += 1
    total = 0.0
    qpos, qvel = carray(pointer(w.qpos), (w.nq,)), carray(pointer(w.qvel), (w.nq,))
    for j in range(w.nq):
        total += qpos[j]
    rates = 0.0
    for j in range(w.nq):
        rates += qvel[j]
    warned = 0
    warnings = carray(whole_pointer(w.warnings), (w.nwarning, WARNING_STRIDE))
    for kind in range(w.nwarning):
        warned += warnings[kind, 0]
    return FINE if warned == 0 and math.isfinite(total + rates) else DIVERGED


@nested
def _push(w: Any, forces: Any, acting: Any) -> None:
    """Write the forces as MuJoCo takes them: at the link's centre of mass, with the torque about it."""
    xfrc, qpos = carray(pointer(w.xfrc), (w.nbody, 6)), carray(pointer(w.qpos), (w.nq,))
    xfrc[:, :] = 0.0
    w.pushed = 0
    w.push[:] = 0.0
    for number in range(forces.shape[0]):
        if not acting[number]:
            continue
        applied = forces[number]
        link = applied.link
        angle = qpos[w.q[TORSO]]
        if link > 0:
            leg = (link - 1) // 2
            angle = angle + qpos[w.q[leg]]
            if link % 2 == 0:
                angle = angle + qpos[w.q[2 + leg]]
        sin, cos = math.sin(angle), math.cos(angle)
        x, z = applied.point[0] - w.com[link, 0], applied.point[1] - w.com[link, 1]  # [m], in the link's frame
        arm_x, arm_z = x * cos - z * sin, x * sin + z * cos  # [m], in the world frame
        fx, fz = applied.force[0], applied.force[1]
        row = xfrc[w.bodies[link]]
        row[0] += fx
        row[2] += fz
        row[4] += arm_z * fx - arm_x * fz
        w.push[0], w.push[1] = w.push[0] + fx, w.push[1] + fz
        w.pushed = 1
