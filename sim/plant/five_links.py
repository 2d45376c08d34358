"""Numbers of the five links of a compiled MJCF, as the rigid plant's equations take them.

An angle phi_j is a link's own, from "up", counter-clockwise, j ordered as `sim.interface.LINKS`; R(phi) turns by it.
With the foot of one leg pinned, the centre of mass of link i is at sum_j R(phi_j) c_ij from that foot. Inertia, what
turning does and weight depend on the c_ij only through the sums that are taken here.
"""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from sim.errors import UserError
from sim.interface import COORDINATES, LINKS, Vector
from sim.plant.kinematics import LegGeometry

ANGLES = len(LINKS)
TURN = np.array([[-1, 1, 0, 0, 0], [-1, 0, 0, 1, 0], [0, -1, 1, 0, 0], [0, 0, 0, -1, 1], [1, 0, 0, 0, 0]])
"""Joint angles of `COORDINATES` from the angles of the links, (5, 5)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FiveLinks:
    """What the links weigh, in the order of `LINKS`.

    Attributes:
        mass: In [kg], (5,); a body that is welded to a link counts as a part of it.
        com: Centre of mass (x, z) in the link's own frame in [m], (5, 2).
        inertia: About it in [kg m^2], (5,).
        rotor: Rotor inertia of the joints in [kg m^2], (5,), ordered as `COORDINATES`.
        damping: In [N.m.s/rad], likewise.
        friction: Dry friction in [N.m], likewise.
        gravity: Acceleration (x, z) in [m/s^2], (2,).
        legs: Lengths of the legs.
    """

    mass: Vector
    com: Vector
    inertia: Vector
    rotor: Vector
    damping: Vector
    friction: Vector
    gravity: Vector
    legs: LegGeometry

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "FiveLinks":
        """The links of a compiled walker."""
        mass, com, inertia = np.zeros(ANGLES), np.zeros((ANGLES, 2)), np.zeros(ANGLES)
        for i, name in enumerate(LINKS):
            parts, places, about = _parts(model, model.body(name).id)
            masses = model.body_mass[parts]
            mass[i] = masses.sum()
            com[i] = masses @ places / mass[i]
            inertia[i] = about.sum() + masses @ np.sum((places - com[i]) ** 2, axis=1)
        dofs = [int(model.jnt_dofadr[model.joint(name).id]) for name in COORDINATES]
        return cls(
            mass=mass,
            com=com,
            inertia=inertia,
            rotor=model.dof_armature[dofs],
            damping=model.dof_damping[dofs],
            friction=model.dof_frictionloss[dofs],
            gravity=model.opt.gravity[[0, 2]],
            legs=LegGeometry.of(model),
        )

    def arms(self, leg: int) -> Vector:
        """The c_ij of the walker pinned at the foot of a leg in [m], (5, 5, 2)."""
        c = np.zeros((ANGLES, ANGLES, 2))
        c[:, [1 + 2 * leg, 2 + 2 * leg], 1] -= self.legs.lengths[leg]
        for side, (femur, _) in enumerate(self.legs.lengths):
            c[2 + 2 * side, 1 + 2 * side, 1] += femur
        c[range(ANGLES), range(ANGLES)] += self.com
        return c

    def sums(self, leg: int) -> tuple[Vector, Vector, Vector]:
        """Sums over the links of the walker pinned at a foot.

        Returns:
            Of m_i c_ij . c_ik and of m_i (z of c_ij x of c_ik - x of c_ij z of c_ik) in [kg m^2], (5, 5) each, and of
            m_i c_ij in [kg m], (5, 2).
        """
        c = self.arms(leg)
        along = np.einsum("i,ijx,ikx->jk", self.mass, c, c)
        cross = np.einsum("i,ij,ik->jk", self.mass, c[:, :, 1], c[:, :, 0])
        return along, cross - cross.T, np.einsum("i,ijx->jx", self.mass, c)

    def turning(self) -> Vector:
        """Inertia about the centres of mass and of the rotors, which no angle changes, in [kg m^2], (5, 5)."""
        return np.diag(self.inertia) + TURN.T @ np.diag(self.rotor) @ TURN


def _parts(model: mujoco.MjModel, link: int) -> tuple[list[int], Vector, Vector]:
    """A link and what is welded to it.

    Returns:
        MuJoCo's numbers of the bodies, their centres of mass (x, z) in the link's frame in [m], (n, 2), and their
        inertia about them, across the plane, in [kg m^2], (n,).
    """
    parts = np.flatnonzero(model.body_weldid == link).tolist()  # a body's parent comes before it
    frames = {link: (np.zeros(3), np.eye(3))}
    for body in parts:
        if body != link:
            at, turned = frames[model.body_parentid[body]]
            frames[body] = at + turned @ model.body_pos[body], turned @ _matrix(model.body_quat[body])
    places, about = np.empty((len(parts), 2)), np.empty(len(parts))
    for n, body in enumerate(parts):
        at, turned = frames[body]
        places[n] = (at + turned @ model.body_ipos[body])[[0, 2]]
        about[n] = (turned @ _matrix(model.body_iquat[body]))[1] ** 2 @ model.body_inertia[body]
    return parts, places, about


def _matrix(quaternion: Vector) -> Vector:
    found = np.empty(9)
    mujoco.mju_quat2Mat(found, quaternion)
    return found.reshape(3, 3)


def refuse_shape(model: mujoco.MjModel, path: Path) -> None:
    """Raises `UserError` where the links are not on one another's axes, or the base is more than a place."""
    femurs, tibias, feet = (
        [model.body("left_femur").id, model.body("right_femur").id],
        [model.body("left_tibia").id, model.body("right_tibia").id],
        [model.geom("left_foot").id, model.geom("right_foot").id],
    )
    slides, hinges = [model.joint(name).id for name in ("hip_x", "hip_z")], [model.joint(n).id for n in COORDINATES]
    base = model.jnt_dofadr[slides]
    for what, values in (
        ("x and z of the femurs' pos", model.body_pos[femurs][:, [0, 2]]),
        ("x of the tibias' pos", model.body_pos[tibias, 0]),
        ("x of the feet's pos", model.geom_pos[feet, 0]),
        ("x and z of the hinges' pos", model.jnt_pos[hinges][:, [0, 2]]),
        ("axis of the hinges beside (0, -1, 0)", model.jnt_axis[hinges] - [0.0, -1.0, 0.0]),
        ("axis of hip_x beside (1, 0, 0)", model.jnt_axis[slides[0]] - [1.0, 0.0, 0.0]),
        ("axis of hip_z beside (0, 0, 1)", model.jnt_axis[slides[1]] - [0.0, 0.0, 1.0]),
        ("turn of the links' frames", model.body_quat[[model.body(n).id for n in LINKS], 1:]),
        ("armature of hip_x and hip_z", model.dof_armature[base]),
    ):
        if np.abs(values).max() > 1e-12:
            raise UserError(f'model file {path}: {what} must be 0 on the rigid plant, or plant.kind = "mujoco"')
