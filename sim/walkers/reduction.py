"""A five-link walker of a robot's tree, with a table of everything that deviates from this program's conventions."""

import math

import numpy as np

from sim.walkers import masses, skeleton
from sim.walkers.pairs import Pairs
from sim.walkers.planar import ROLES, Coordinate, Given, PlanarWalker
from sim.walkers.skeleton import SIDES, Body
from sim.walkers.table import Impossible, Table
from sim.walkers.tree import Array, Row, Tree, at, words

MAPPED = ("torso", *ROLES)
"""What `--map` may name."""

PARALLEL = 1e-4  # [rad] an axis so far off counts as rounded in the file
TIP = 0.02  # [m] from the knee, at least
PLACE = 1e-6  # [m]


def reduce(tree: Tree, given: Given) -> tuple[PlanarWalker | None, list[Row]]:
    """The walker of a tree, None where a row of the table stops it, and the table.

    The walk is in the file's +x unless its knees bend only the other way.
    """
    walker, rows = _attempt(tree, given, backward=False)
    if walker is not None and walker.knee.low > -0.2 and walker.knee.high > 0.3:
        turned, more = _attempt(tree, given, backward=True)
        if turned is not None and turned.knee.low < -0.2:
            span = f"{walker.knee.low:.3g} to {walker.knee.high:.3g} rad"
            found = f"bend only forward, {span} with the walk in {words(walker.plane[0])}"
            row = Row(part="knees", found=found, made=f"the walk is in {words(turned.plane[0])}", verdict="made")
            walker, rows = turned, [*more, row]
    return (None if any(row.stops for row in rows) else walker), rows


def _attempt(tree: Tree, given: Given, *, backward: bool) -> tuple[PlanarWalker | None, list[Row]]:
    table = Table(tree.rows)
    try:
        return _walker(tree, given, table, backward=backward), table.rows
    except Impossible:
        return None, table.rows


def _walker(tree: Tree, given: Given, table: Table, *, backward: bool) -> PlanarWalker:
    pairs = Pairs(given, table)
    bodies = skeleton.bodies(tree)
    torso = skeleton.torso_of(bodies, tree, given, table)
    for key in given.names:
        if key not in MAPPED:
            raise table.stop(f"--map {key}", "no such part", f"one of {', '.join(MAPPED)}")
    legs = skeleton.legs_of(torso, given, table)
    held = skeleton.base(torso, tree, table)
    plane, rounded = _plane(legs, backward, table)
    flat = plane[[0, 2]]
    anchors = {role: body.anchor for role, body in legs.items()}
    hip = flat @ anchors["left_hip"]
    apart = float(np.linalg.norm(hip - flat @ anchors["right_hip"]))
    if apart > PLACE:
        table.outside("hips", f"{apart:.3g} m apart in the plane of the walk", "one axis for both hips")
    up = _upright(torso, flat)
    lean = _angle(up)
    coordinates, femurs, tibias, feet = {}, [], [], []
    for side in SIDES:
        femur, tibia = legs[f"{side}_hip"], legs[f"{side}_knee"]
        start, knee = flat @ anchors[f"{side}_hip"], flat @ anchors[f"{side}_knee"]
        link, point = _foot(tibia, plane, knee, f"{side}_knee", given, table)
        feet.append((link, point))
        foot = flat @ at(tibia.frames[link], point)
        thigh, shank = knee - start, foot - knee
        lengths = float(np.linalg.norm(thigh)), float(np.linalg.norm(shank))
        if min(lengths) < 1e-3:
            raise table.stop(f"{side} leg", f"femur {lengths[0]:g} m, tibia {lengths[1]:g} m long", "above 0.001 m")
        thigh, shank = thigh / lengths[0], shank / lengths[1]
        femurs.append(masses.link_of(femur, plane, start, thigh, lengths[0], f"{side} femur", table))
        tibias.append(masses.link_of(tibia, plane, knee, shank, lengths[1], f"{side} tibia", table))
        of_thigh, of_shank = _angle(thigh), _angle(shank)
        for role, offset in ((f"{side}_hip", of_thigh - lean), (f"{side}_knee", of_shank - of_thigh)):
            coordinates[role] = _coordinate(role, legs[role], plane, offset, table)
    trunk = masses.link_of(torso, plane, hip, up, 0.0, "torso", table)
    thigh_of_both, shank_of_both = pairs.link(femurs, "femurs"), pairs.link(tibias, "tibias")
    masses.beside(legs, torso, plane, held, thigh_of_both.length + shank_of_both.length, table)
    middle3 = 0.5 * (anchors["left_hip"] + anchors["right_hip"])
    return PlanarWalker(
        torso=trunk,
        femur=thigh_of_both,
        tibia=shank_of_both,
        hip=pairs.joint(("left_hip", "right_hip"), legs, coordinates),
        knee=pairs.joint(("left_knee", "right_knee"), legs, coordinates),
        coordinates=coordinates,
        plane=plane,
        root=_root(torso),
        frame=torso.frames[_root(torso)],
        middle=middle3,
        lean=lean,
        feet=(feet[0], feet[1]),
        rounded=max(rounded, pairs.uneven),
    )


def _plane(legs: dict[str, Body], backward: bool, table: Table) -> tuple[Array, float]:
    """Forward, left, up in the file's world, and the largest angle of an axis off the plane's normal."""
    axes = {}
    for role, body in legs.items():
        assert body.joint is not None
        axes[role] = body.frame[:3, :3] @ body.joint.axis
    a = axes["left_hip"].copy()
    # Rounding of the file's rpy is not the plane's business.
    a[np.abs(a) < PARALLEL] = 0.0
    a /= np.linalg.norm(a)
    a *= 1.0 if a[np.abs(a).argmax()] > 0.0 else -1.0
    if abs(a[2]) > PARALLEL:
        assert legs["left_hip"].joint is not None
        found = f"axis {words(axes['left_hip'])} in the zero pose"
        raise table.stop(legs["left_hip"].joint.name, found, "a horizontal axis: this one leaves the plane of the walk")
    rounded = 0.0
    for role, axis in axes.items():
        angle = float(np.arctan2(np.linalg.norm(np.cross(axis, a)), abs(axis @ a)))
        rounded = max(rounded, angle)
        if angle > PARALLEL:
            joint = legs[role].joint
            assert joint is not None
            found = f"axis {words(axis)}, {angle:.3g} rad off {words(a)}"
            table.outside(joint.name, found, f"parallel to the others within {PARALLEL:g} rad: it leaves the plane")
        elif angle > 1e-12:
            table.row(f"axis of {role}", f"{angle:.2g} rad off the plane's normal", "in the plane", "made")
    forward = np.cross(a, [0.0, 0.0, 1.0])
    forward *= 1.0 if forward[np.abs(forward).argmax()] > 0.0 else -1.0
    forward *= -1.0 if backward else 1.0
    up = np.array([0.0, 0.0, 1.0])
    if abs(a[1]) < 1.0 - 1e-12:
        table.row("plane", f"hinges about {words(a)}", f"the walk is towards {words(forward)}", "made")
    return np.array([forward, np.cross(up, forward), up]), rounded


def _foot(body: Body, plane: Array, knee: Array, role: str, given: Given, table: Table) -> tuple[str, Array]:
    """Link and point of a foot; the most likely tip, and of those the farthest from the knee."""
    flat, length = plane[[0, 2]], given.tibia_length
    found = []
    for link in body.links:
        for tip in link.tips:
            distance = float(np.linalg.norm(flat @ at(body.frames[link.name], tip.point) - knee))
            if distance > TIP:
                found.append((tip.rank, -distance, link.name, tip))
    if found:
        _, distance, name, tip = min(found, key=lambda item: item[:2])
        what, direction = tip.what, flat @ at(body.frames[name], tip.point) - knee
        if length is None:
            if tip.rank > 0:
                words = f"{what}, {-distance:.6g} m from the knee"
                table.row(f"foot of {role}", words, "a point foot; or --tibia-length M")
            return name, tip.point
    else:
        name, what = body.name, "no frame or shape below the knee"
        z = body.frame[:3, 2]
        direction = flat @ (z if (masses.com(body) - body.frame[:3, 3]) @ z > 0.0 else -z)
        if length is None:
            table.row(f"foot of {role} ({body.name})", what, "--tibia-length M", "must be given")
            length = 1.0  # to go on with, so that the table is whole
    if given.tibia_length is not None:
        table.row(f"foot of {role}", what, f"{length:g} m from the knee", "given")
    target = knee + length * direction / max(float(np.linalg.norm(direction)), 1e-12)
    frame = body.frames[name]
    world = plane[0] * target[0] + plane[2] * target[1] + plane[1] * (plane[1] @ frame[:3, 3])
    return name, frame[:3, :3].T @ (world - frame[:3, 3])


def _upright(torso: Body, flat: Array) -> Array:
    """The torso's axis: its frame's z where that is in the plane and nearly up in the zero pose, or up itself."""
    axis: Array = flat @ torso.frames[_root(torso)][:3, 2]
    if axis[1] > 0.5 and abs(float(np.linalg.norm(axis)) - 1.0) < 1e-9:
        return axis / np.linalg.norm(axis)
    return np.array([0.0, 1.0])


def _root(torso: Body) -> str:
    """The torso's first link, the world not counted."""
    if torso.links[0].name == "world" and len(torso.links) > 1 and not torso.links[0].inertials:
        return torso.links[1].name
    return torso.name


def _coordinate(role: str, body: Body, plane: Array, offset: float, table: Table) -> Coordinate:
    joint = body.joint
    assert joint is not None
    sign = 1.0 if float((body.frame[:3, :3] @ joint.axis) @ plane[1]) < 0.0 else -1.0
    low = -0.5 * math.pi if role.endswith("hip") else -math.pi
    offset = (offset - low) % (2.0 * math.pi) + low
    offset = 0.0 if abs(offset) < 1e-12 else offset
    found = Coordinate(name=joint.name, sign=sign, zero=joint.zero, offset=offset)
    if joint.name != role or sign < 0.0 or abs(offset) > 1e-9 or joint.zero:
        ours = f"{'' if sign > 0.0 else '-'}{joint.name}"
        ours += f" {'+' if found.ours(0.0) >= 0.0 else '-'} {abs(found.ours(0.0)):.6g}" if found.ours(0.0) else ""
        turn = words(body.frame[:3, :3] @ joint.axis)
        table.row(role, f"{joint.name}, about {turn}", f"{role} = {ours}")
    return found


def _angle(direction: Array) -> float:
    """Absolute angle of a link along (x, z): counter-clockwise about (0, -1, 0) from up."""
    return math.atan2(-direction[0], direction[1])
