"""The masses of a walker taken into its plane: one link of each body, and what lies beside the plane."""

import numpy as np

from sim.walkers.planar import PlanarLink
from sim.walkers.skeleton import SIDES, Body
from sim.walkers.table import Table
from sim.walkers.tree import Array, at

OFF_PLANE = 1e-2  # of the leg: a floating walker's centre of mass beside its hips
POINT_MASS = 1e-9  # [kg m^2] the least inertia a link is given; MuJoCo needs one


def link_of(body: Body, plane: Array, origin: Array, axis: Array, length: float, role: str, table: Table) -> PlanarLink:
    """A body's mass in the plane; origin and axis (unit) in the plane, (2,)."""
    forward, left, up = plane
    across = np.array([axis[1], -axis[0]])  # the link's own x: its z turned clockwise, seen from the left
    mass, moment, inertia = 0.0, np.zeros(2), 0.0
    beside, skew = 0.0, 0.0
    parts = []
    welded = [link for link in body.links if link.inertials]
    for link in welded:
        frame = body.frames[link.name]
        for item in link.inertials:
            place = at(frame, item.com)
            tensor = frame[:3, :3] @ item.inertia @ frame[:3, :3].T
            parts.append((item.mass, np.array([place @ forward, place @ up]), float(left @ tensor @ left)))
            mass += item.mass
            moment += item.mass * parts[-1][1]
            beside = max(beside, abs(float(place @ left)))
            skew = max(skew, abs(float(left @ tensor @ forward)), abs(float(left @ tensor @ up)))
    if not mass > 0.0:
        raise table.stop(f"{role} ({body.name})", "no mass", "a mass above 0 kg")
    com = moment / mass
    inertia = sum(i + m * float((p - com) @ (p - com)) for m, p, i in parts)
    if len(welded) > 1:
        names = ", ".join(f"{link.name} {sum(i.mass for i in link.inertials):g} kg" for link in welded)
        table.row(role, f"welded together: {names}", f"one link of {mass:g} kg")
    if inertia < POINT_MASS:
        table.row(role, f"a point mass, inertia {inertia:g} kg m^2", f"{POINT_MASS:g} kg m^2 about its centre of mass")
        inertia = POINT_MASS
    if skew > 1e-9:
        table.row(role, f"products of inertia up to {skew:.3g} kg m^2", "without effect in the plane", "left out")
    local = com - origin
    aside = float(local @ across)
    if abs(aside) <= 1e-9:
        aside = 0.0
    else:
        table.row(role, f"centre of mass {aside:.6g} m off its axis", "taken over", "as it is")
    return PlanarLink(mass=mass, length=length, com=float(local @ axis), com_across=aside, inertia=inertia)


def com(body: Body) -> Array:
    """Centre of mass in the file's world in the zero pose in [m], (3,); its origin where nothing weighs."""
    masses = [(i.mass, at(body.frames[link.name], i.com)) for link in body.links for i in link.inertials]
    whole = sum(m for m, _ in masses)
    found: Array = sum((m * p for m, p in masses), np.zeros(3)) / (whole or 1.0)
    return found


def beside(bodies: dict[str, Body], torso: Body, plane: Array, held: bool, leg: float, table: Table) -> None:
    """Masses beside the plane: of no effect where the walker is held in it."""
    left = plane[1]
    middle = 0.5 * sum(float(bodies[f"{side}_hip"].anchor @ left) for side in SIDES)
    every = [torso, *bodies.values()]
    masses = [sum(i.mass for link in body.links for i in link.inertials) for body in every]
    offsets = [float(com(body) @ left) - middle for body in every]
    whole = abs(float(np.dot(masses, offsets)) / sum(masses))
    widest = max(abs(offset) for offset in offsets)
    if widest > 1e-9:
        table.row("beside the plane", f"masses up to {widest:.3g} m beside it", "in it", "left out")
    if whole > OFF_PLANE * leg and not held:
        found = f"centre of mass {whole:.3g} m beside the middle of the hips, on a base that lets the walker tip over"
        table.outside("beside the plane", found, f"up to {OFF_PLANE * leg:.3g} m, or a planar base")
