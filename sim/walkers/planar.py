"""A five-link walker of a robot's tree, in this program's conventions, with a table of everything that deviates.

In the plane of the walk, with x forward and z up, angles are counted about (0, -1, 0). A link's axis runs from its
joint to the next, or to the foot; the hip's angle is the femur's axis against the torso's z, the knee's the tibia's
against the femur's. Each joint of the file then is one coordinate here up to its sign and an offset: axes either way,
rotated origins, links that hang down and mirrored legs are all that.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sim.walkers.tree import Array, Joint, Link, Row, Tree, at, placed, words

ROLES = ("left_hip", "left_knee", "right_hip", "right_knee")
MAPPED = ("torso", *ROLES)
"""What `--map` may name."""

SIDES = ("left", "right")
PARALLEL = 1e-4  # [rad] an axis so far off counts as rounded in the file
SAME = 1e-6  # relative: legs so equal are equal
TIP = 0.02  # [m] from the knee, at least
UNEVEN = 0.05  # legs farther apart are never made equal
PLACE = 1e-6  # [m]
MASSLESS = 1e-2  # of the whole: a carriage of the base with less is left out
OFF_PLANE = 1e-2  # of the leg: a floating walker's centre of mass beside its hips
POINT_MASS = 1e-9  # [kg m^2] the least inertia a link is given; MuJoCo needs one


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarLink:
    """A link: mass in [kg], length and centre of mass along and across its axis in [m], inertia in [kg m^2]."""

    mass: float
    length: float
    com: float
    com_across: float
    inertia: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarJoint:
    """A joint: torque limit and friction in [N.m], the rest as in `tree.Joint`; angles in our coordinates."""

    torque: float
    damping: float
    friction: float
    rotor: float
    stiffness: float
    rest: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Coordinate:
    """How a joint of the file is a coordinate here: ours = sign (theirs - zero) + offset."""

    name: str
    sign: float
    zero: float
    offset: float

    def ours(self, theirs: float) -> float:
        """Our coordinate in [rad]."""
        return self.sign * (theirs - self.zero) + self.offset

    def theirs(self, ours: float) -> float:
        """The file's coordinate in [rad]."""
        return self.sign * (ours - self.offset) + self.zero


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanarWalker:
    """What a file's robot is here.

    Attributes:
        torso, femur, tibia: The links; the legs are alike.
        hip, knee: The joints.
        coordinates: Of each of `ROLES`.
        plane: Forward, left and up in the file's world, rows, (3, 3).
        root: First link of the file's torso.
        frame: Its frame in the file's world in the zero pose, (4, 4).
        middle: The hips' axis in the middle between the legs, there, (3,).
        lean: Angle of the torso in the file's zero pose in [rad].
        feet: Link and point in its frame of the left and the right foot.
        rounded: Largest angle by which an axis was taken into the plane in [rad], or share by which legs were made
            equal.
    """

    torso: PlanarLink
    femur: PlanarLink
    tibia: PlanarLink
    hip: PlanarJoint
    knee: PlanarJoint
    coordinates: dict[str, Coordinate]
    plane: Array
    root: str
    frame: Array
    middle: Array
    lean: float
    feet: tuple[tuple[str, Array], tuple[str, Array]]
    rounded: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What a file does not say.

    Attributes:
        torque: Torque limits of hips and knees in [N.m].
        even_legs: Whether legs that differ a little are made equal.
        tibia_length: From knee to foot in [m].
        names: Link of the torso, and joints of the four roles, by role.
    """

    torque: tuple[float, float] | None = None
    even_legs: bool = False
    tibia_length: float | None = None
    names: Mapping[str, str] = field(default_factory=dict)


@dataclass(slots=True, eq=False)
class _Body:
    """Links welded into one, in the file's world in the zero pose."""

    links: list[Link]
    joint: Joint | None
    frame: Array
    parent: "_Body | None"
    children: list["_Body"] = field(default_factory=list)

    @property
    def name(self) -> str:
        return self.links[0].name


class _Impossible(Exception):
    """The rows say why."""


class _Reader:
    def __init__(self, tree: Tree, given: Given) -> None:
        self.tree, self.given, self.rows = tree, given, list(tree.rows)
        self.frames: dict[str, Array] = {}
        self.uneven = 0.0

    def row(self, part: str, found: str, made: str, verdict: str = "made") -> None:
        self.rows.append(Row(part=part, found=found, made=made, verdict=verdict))

    def outside(self, part: str, found: str, legal: str) -> None:
        self.row(part, found, legal, "outside")

    def stop(self, part: str, found: str, legal: str) -> _Impossible:
        self.outside(part, found, legal)
        return _Impossible()

    # Topology

    def bodies(self) -> list[_Body]:
        """The tree with everything fixed welded together."""
        found: list[_Body] = []
        of: dict[str, _Body] = {}
        for link in self.tree.links:
            above = np.eye(4) if link.parent is None else self.frames[link.parent]
            self.frames[link.name] = above @ link.placement
            if link.parent is not None and link.joint is None:
                body = of[link.parent]
                body.links.append(link)
            else:
                parent = None if link.parent is None else of[link.parent]
                body = _Body([link], link.joint, self.frames[link.name], parent)
                found.append(body)
                if parent:
                    parent.children.append(body)
            of[link.name] = body
        return found

    def torso(self, bodies: list[_Body]) -> _Body:
        """The body both legs hang on."""
        asked = self.given.names.get("torso")
        if asked is not None:
            for body in bodies:
                if asked in (link.name for link in body.links):
                    return body
            names = ", ".join(link.name for link in self.tree.links)
            raise self.stop("--map torso", f"no link {asked!r}", f"one of {names}")
        forks = [body for body in bodies if len(body.children) > 1]
        if not forks:
            found = f"{len(bodies) - 1} moving joints in one chain"
            raise self.stop("topology", found, "a torso on which two legs of a hip and a knee hang")
        return forks[0]

    def legs(self, torso: _Body) -> dict[str, _Body]:
        """Femurs and tibias by the role of their joint."""
        moving = [child for child in torso.children if child.joint]
        shape = {body.name: self._below(body) for body in moving}
        if len(moving) != 2 or any(kinds != ["hinge", "hinge"] for kinds in shape.values()):
            parts = "; ".join(f"{body.joint.name}: {self._words(body)}" for body in moving if body.joint)
            found = f"at {torso.name}, {parts}" if parts else f"nothing moves at {torso.name}"
            raise self.stop("topology", found, "two legs of a hip and a knee, five links in all")
        sides = self._sides(moving)
        found_legs = {}
        for side, femur in zip(SIDES, sides, strict=True):
            found_legs[f"{side}_hip"], found_legs[f"{side}_knee"] = femur, femur.children[0]
        return found_legs

    def _below(self, body: _Body) -> list[str]:
        kinds: list[str] = []
        now = body
        while True:
            kinds.append(now.joint.kind if now.joint else "fixed")
            if not now.children:
                return kinds
            if len(now.children) > 1:
                return [*kinds, "fork"]
            now = now.children[0]

    def _words(self, body: _Body) -> str:
        names, now = [], body
        while True:
            joint = now.joint
            if joint:
                names.append(f"{joint.kind} {joint.name}")
            if len(now.children) != 1:
                return " - ".join(names) + (" - a fork" if now.children else "")
            now = now.children[0]

    def _sides(self, femurs: list[_Body]) -> list[_Body]:
        """Left, then right: by what was given, by their names, or as they come."""
        for index, role in ((0, "left_hip"), (1, "right_hip"), (0, "left_knee"), (1, "right_knee")):
            asked = self.given.names.get(role)
            if asked is None:
                continue
            names = [
                (b.joint.name if role.endswith("hip") else b.children[0].joint.name)  # type: ignore[union-attr]
                for b in femurs
            ]
            if asked not in names:
                raise self.stop(f"--map {role}", f"no such joint {asked!r}", f"one of {', '.join(names)}")
            at_left = names.index(asked) == index
            return femurs if at_left else femurs[::-1]
        scores = [_leftness(body) for body in femurs]
        if scores[0] == scores[1]:
            first, second = (body.joint.name for body in femurs if body.joint)
            self.row("sides", f"{first}, {second}: no left or right in the names", f"left: {first}; --map left_hip=...")
            return femurs
        return femurs if scores[0] > scores[1] else femurs[::-1]

    def base(self, torso: _Body) -> bool:
        """Take the base off; returns whether it holds the walker in a plane."""
        joints, now = [], torso
        carried = 0.0
        while now.parent is not None:
            if now.joint:
                joints.append(now.joint)
            now = now.parent
            carried += sum(i.mass for link in now.links for i in link.inertials)
            if len(now.children) > 1:
                names = ", ".join(body.name for body in now.children)
                raise self.stop("base", f"{now.name} carries {names}", "one robot, its torso at the end of the base")
        kinds = [joint.kind for joint in joints[::-1]]
        links = torso.links[0].name
        whole = sum(i.mass for link in self.tree.links for i in link.inertials)
        if carried > MASSLESS * whole:
            self.outside("base", f"its carriages weigh {carried:g} kg", "a base without mass")
        elif carried:
            self.row("base", f"its carriages weigh {carried:g} kg", "a base without mass", "left out")
        if joints:
            named = ", ".join(f"{joint.name} ({joint.kind})" for joint in joints[::-1])
            self.row("base", named, "taken off: the walker is free in its plane")
        elif torso.parent is not None or (len(torso.links) > 1 and not torso.links[0].inertials):
            fixed = [link.name for link in torso.links[1:] if link.parent == links][:1] or [torso.name]
            if links == "world" and not torso.links[0].inertials:
                self.row("base", f"{fixed[0]} fixed to the world", "taken off: the walker is free in its plane")
        for joint in joints:
            for what, size, unit in (
                ("damping", joint.damping, ""),
                ("friction", joint.friction, ""),
                ("armature", joint.rotor, ""),
                ("stiffness", joint.stiffness, ""),
            ):
                if size:
                    self.row(f"base joint {joint.name}", f"{what} {size:g}{unit}", "none", "left out")
        return "planar" in kinds or kinds.count("slide") == 2

    # The plane

    def plane(self, legs: dict[str, _Body], backward: bool) -> tuple[Array, float]:
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
            raise self.stop(
                legs["left_hip"].joint.name, found, "a horizontal axis: this one leaves the plane of the walk"
            )
        rounded = 0.0
        for role, axis in axes.items():
            angle = float(np.arctan2(np.linalg.norm(np.cross(axis, a)), abs(axis @ a)))
            rounded = max(rounded, angle)
            if angle > PARALLEL:
                joint = legs[role].joint
                assert joint is not None
                found = f"axis {words(axis)}, {angle:.3g} rad off {words(a)}"
                self.outside(joint.name, found, f"parallel to the others within {PARALLEL:g} rad: it leaves the plane")
            elif angle > 1e-12:
                self.row(f"axis of {role}", f"{angle:.2g} rad off the plane's normal", "in the plane", "made")
        forward = np.cross(a, [0.0, 0.0, 1.0])
        forward *= 1.0 if forward[np.abs(forward).argmax()] > 0.0 else -1.0
        forward *= -1.0 if backward else 1.0
        up = np.array([0.0, 0.0, 1.0])
        if abs(a[1]) < 1.0 - 1e-12:
            self.row("plane", f"hinges about {words(a)}", f"the walk is towards {words(forward)}", "made")
        return np.array([forward, np.cross(up, forward), up]), rounded

    def link(self, body: _Body, plane: Array, origin: Array, axis: Array, length: float, role: str) -> PlanarLink:
        """A body's mass in the plane; origin and axis (unit) in the plane, (2,)."""
        forward, left, up = plane
        across = np.array([axis[1], -axis[0]])  # the link's own x: its z turned clockwise, seen from the left
        mass, moment, inertia = 0.0, np.zeros(2), 0.0
        beside, skew = 0.0, 0.0
        parts = []
        welded = [link for link in body.links if link.inertials]
        for link in welded:
            frame = self.frames[link.name]
            for item in link.inertials:
                place = at(frame, item.com)
                tensor = frame[:3, :3] @ item.inertia @ frame[:3, :3].T
                parts.append((item.mass, np.array([place @ forward, place @ up]), float(left @ tensor @ left)))
                mass += item.mass
                moment += item.mass * parts[-1][1]
                beside = max(beside, abs(float(place @ left)))
                skew = max(skew, abs(float(left @ tensor @ forward)), abs(float(left @ tensor @ up)))
        if not mass > 0.0:
            raise self.stop(f"{role} ({body.name})", "no mass", "a mass above 0 kg")
        com = moment / mass
        inertia = sum(i + m * float((p - com) @ (p - com)) for m, p, i in parts)
        if len(welded) > 1:
            names = ", ".join(f"{link.name} {sum(i.mass for i in link.inertials):g} kg" for link in welded)
            self.row(role, f"welded together: {names}", f"one link of {mass:g} kg")
        if inertia < POINT_MASS:
            self.row(
                role, f"a point mass, inertia {inertia:g} kg m^2", f"{POINT_MASS:g} kg m^2 about its centre of mass"
            )
            inertia = POINT_MASS
        if skew > 1e-9:
            self.row(role, f"products of inertia up to {skew:.3g} kg m^2", "without effect in the plane", "left out")
        local = com - origin
        aside = float(local @ across)
        if abs(aside) <= 1e-9:
            aside = 0.0
        else:
            self.row(role, f"centre of mass {aside:.6g} m off its axis", "taken over", "as it is")
        return PlanarLink(mass=mass, length=length, com=float(local @ axis), com_across=aside, inertia=inertia)

    def foot(self, body: _Body, plane: Array, knee: Array, role: str) -> tuple[str, Array]:
        """Link and point of a foot; the most likely tip, and of those the farthest from the knee."""
        flat, length = plane[[0, 2]], self.given.tibia_length
        found = []
        for link in body.links:
            for tip in link.tips:
                distance = float(np.linalg.norm(flat @ at(self.frames[link.name], tip.point) - knee))
                if distance > TIP:
                    found.append((tip.rank, -distance, link.name, tip))
        if found:
            _, distance, name, tip = min(found, key=lambda item: item[:2])
            what, direction = tip.what, flat @ at(self.frames[name], tip.point) - knee
            if length is None:
                if tip.rank > 0:
                    words = f"{what}, {-distance:.6g} m from the knee"
                    self.row(f"foot of {role}", words, "a point foot; or --tibia-length M")
                return name, tip.point
        else:
            name, what = body.name, "no frame or shape below the knee"
            z = body.frame[:3, 2]
            direction = flat @ (z if (self._com(body) - body.frame[:3, 3]) @ z > 0.0 else -z)
            if length is None:
                self.row(f"foot of {role} ({body.name})", what, "--tibia-length M", "must be given")
                length = 1.0  # to go on with, so that the table is whole
        if self.given.tibia_length is not None:
            self.row(f"foot of {role}", what, f"{length:g} m from the knee", "given")
        target = knee + length * direction / max(float(np.linalg.norm(direction)), 1e-12)
        frame = self.frames[name]
        world = plane[0] * target[0] + plane[2] * target[1] + plane[1] * (plane[1] @ frame[:3, 3])
        return name, frame[:3, :3].T @ (world - frame[:3, 3])

    def _com(self, body: _Body) -> Array:
        masses = [(i.mass, at(self.frames[link.name], i.com)) for link in body.links for i in link.inertials]
        whole = sum(m for m, _ in masses)
        found: Array = sum((m * p for m, p in masses), np.zeros(3)) / (whole or 1.0)
        return found

    def beside(self, bodies: dict[str, _Body], torso: _Body, plane: Array, held: bool, leg: float) -> None:
        """Masses beside the plane: of no effect where the walker is held in it."""
        left = plane[1]
        middle = 0.5 * sum(float(self._anchor(bodies[f"{side}_hip"]) @ left) for side in SIDES)
        every = [torso, *bodies.values()]
        masses = [sum(i.mass for link in body.links for i in link.inertials) for body in every]
        offsets = [float(self._com(body) @ left) - middle for body in every]
        whole = abs(float(np.dot(masses, offsets)) / sum(masses))
        widest = max(abs(offset) for offset in offsets)
        if widest > 1e-9:
            self.row("beside the plane", f"masses up to {widest:.3g} m beside it", "in it", "left out")
        if whole > OFF_PLANE * leg and not held:
            found = (
                f"centre of mass {whole:.3g} m beside the middle of the hips, on a base that lets the walker tip over"
            )
            self.outside("beside the plane", found, f"up to {OFF_PLANE * leg:.3g} m, or a planar base")

    def _anchor(self, body: _Body) -> Array:
        assert body.joint is not None
        return at(body.frame, body.joint.anchor)

    # Joints

    def joint(self, roles: tuple[str, str], legs: dict[str, _Body], coordinates: dict[str, Coordinate]) -> PlanarJoint:
        """The joints of both legs as one."""
        found = []
        for role in roles:
            joint, map_ = legs[role].joint, coordinates[role]
            assert joint is not None
            ends = sorted(map_.ours(value) if math.isfinite(value) else map_.sign * value for value in _ends(joint))
            found.append(
                {
                    "torque": joint.effort,
                    "damping": joint.damping,
                    "friction": joint.friction,
                    "rotor": joint.rotor,
                    "stiffness": joint.stiffness,
                    "rest": map_.ours(joint.rest) if joint.stiffness else 0.0,
                    "low": ends[0],
                    "high": ends[1],
                }
            )
        kind = roles[0].partition("_")[2]
        given = self.given.torque
        if given is not None:
            torque = given[0 if kind == "hip" else 1]
            said = [f"{side['torque']:g}" for side in found]
            said = ["none" if s == "nan" else s for s in said]
            self.row(f"torque limit, {kind}s", f"{said[0]} and {said[1]} N.m", f"{torque:g} N.m", "given")
            for side in found:
                side["torque"] = torque
        elif not all(side["torque"] > 0.0 for side in found):
            self.row(f"torque limit, {kind}s", "none in the file", "--torque HIP KNEE", "must be given")
            for side in found:
                side["torque"] = 1.0
        for key, unit in (
            ("torque", "N.m"), ("damping", "N.m.s/rad"), ("friction", "N.m"), ("rotor", "kg m^2"),
            ("stiffness", "N.m/rad"), ("rest", "rad"), ("low", "rad"), ("high", "rad"),
        ):  # fmt: skip
            a, b = found[0][key], found[1][key]
            if a < 0.0 and key not in ("rest", "low", "high"):
                self.outside(f"{kind}s", f"{key} {a:g} {unit}", "not below 0")
            if key in ("low", "high"):
                if a != b and not abs(a - b) <= SAME:
                    one = max(a, b) if key == "low" else min(a, b)
                    self.row(f"{kind}s", f"{key} stops at {a:.4g} and {b:.4g} rad, ours", f"{one:.4g} rad for both")
                    found[0][key] = one
            elif a != b and not abs(a - b) <= SAME * max(1.0, abs(a), abs(b)):
                legal = "equal legs" + ("; or --torque HIP KNEE" if key == "torque" else "")
                self.outside(f"{kind}s", f"{key} {a:g} and {b:g} {unit}", legal)
        both = found[0]
        for key, name, unit in (
            ("friction", "dry friction", "N.m"),
            ("stiffness", "a spring of", "N.m/rad"),
            ("rotor", "rotor inertia", "kg m^2"),
        ):
            if both[key]:
                self.row(f"{kind}s", f"{name} {both[key]:g} {unit}", "taken over", "as it is")
        if math.isfinite(both["low"]) or math.isfinite(both["high"]):
            span = f"{both['low']:.4g} to {both['high']:.4g} rad in our coordinates"
            self.row(f"{kind}s", f"stops, {span}", "taken over", "as it is")
        return PlanarJoint(**both)

    # All of it

    def walker(self, *, backward: bool) -> PlanarWalker:
        bodies = self.bodies()
        torso = self.torso(bodies)
        for key in self.given.names:
            if key not in MAPPED:
                raise self.stop(f"--map {key}", "no such part", f"one of {', '.join(MAPPED)}")
        legs = self.legs(torso)
        held = self.base(torso)
        plane, rounded = self.plane(legs, backward)
        flat = plane[[0, 2]]
        anchors = {role: self._anchor(body) for role, body in legs.items()}
        hip = flat @ anchors["left_hip"]
        apart = float(np.linalg.norm(hip - flat @ anchors["right_hip"]))
        if apart > PLACE:
            self.outside("hips", f"{apart:.3g} m apart in the plane of the walk", "one axis for both hips")
        up = self._upright(torso, flat)
        lean = _angle(up)
        coordinates, femurs, tibias, feet = {}, [], [], []
        for side in SIDES:
            femur, tibia = legs[f"{side}_hip"], legs[f"{side}_knee"]
            start, knee = flat @ anchors[f"{side}_hip"], flat @ anchors[f"{side}_knee"]
            link, point = self.foot(tibia, plane, knee, f"{side}_knee")
            feet.append((link, point))
            foot = flat @ at(self.frames[link], point)
            thigh, shank = knee - start, foot - knee
            lengths = float(np.linalg.norm(thigh)), float(np.linalg.norm(shank))
            if min(lengths) < 1e-3:
                raise self.stop(f"{side} leg", f"femur {lengths[0]:g} m, tibia {lengths[1]:g} m long", "above 0.001 m")
            thigh, shank = thigh / lengths[0], shank / lengths[1]
            femurs.append(self.link(femur, plane, start, thigh, lengths[0], f"{side} femur"))
            tibias.append(self.link(tibia, plane, knee, shank, lengths[1], f"{side} tibia"))
            of_thigh, of_shank = _angle(thigh), _angle(shank)
            for role, offset in ((f"{side}_hip", of_thigh - lean), (f"{side}_knee", of_shank - of_thigh)):
                coordinates[role] = self._coordinate(role, legs[role], plane, offset)
        trunk = self.link(torso, plane, hip, up, 0.0, "torso")
        thigh_of_both, shank_of_both = self._even(femurs, "femurs"), self._even(tibias, "tibias")
        self.beside(legs, torso, plane, held, thigh_of_both.length + shank_of_both.length)
        middle3 = 0.5 * (anchors["left_hip"] + anchors["right_hip"])
        return PlanarWalker(
            torso=trunk,
            femur=thigh_of_both,
            tibia=shank_of_both,
            hip=self.joint(("left_hip", "right_hip"), legs, coordinates),
            knee=self.joint(("left_knee", "right_knee"), legs, coordinates),
            coordinates=coordinates,
            plane=plane,
            root=self._root(torso),
            frame=self.frames[self._root(torso)],
            middle=middle3,
            lean=lean,
            feet=(feet[0], feet[1]),
            rounded=max(rounded, self.uneven),
        )

    def _root(self, torso: _Body) -> str:
        """The torso's first link, the world not counted."""
        if torso.links[0].name == "world" and len(torso.links) > 1 and not torso.links[0].inertials:
            return torso.links[1].name
        return torso.name

    def _upright(self, torso: _Body, flat: Array) -> Array:
        """The torso's axis: its frame's z where that is in the plane and nearly up in the zero pose, or up itself."""
        axis: Array = flat @ self.frames[self._root(torso)][:3, 2]
        if axis[1] > 0.5 and abs(float(np.linalg.norm(axis)) - 1.0) < 1e-9:
            return axis / np.linalg.norm(axis)
        return np.array([0.0, 1.0])

    def _coordinate(self, role: str, body: _Body, plane: Array, offset: float) -> Coordinate:
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
            self.row(role, f"{joint.name}, about {turn}", f"{role} = {ours}")
        return found

    def _even(self, pair: list[PlanarLink], what: str) -> PlanarLink:
        """One link of a pair: they are equal, or made so where asked."""
        a, b = pair
        for key, unit in (
            ("mass", "kg"), ("length", "m"), ("com", "m"), ("com_across", "m"), ("inertia", "kg m^2"),
        ):  # fmt: skip
            x, y = getattr(a, key), getattr(b, key)
            share = abs(x - y) / max(abs(x), abs(y), 1e-3)
            if share <= SAME:
                continue
            self.uneven = max(self.uneven, share)
            found = f"{key} {x:.6g} and {y:.6g} {unit}, {100 * share:.2g} % apart"
            if self.given.even_legs and share <= UNEVEN:
                self.row(what, found, f"{0.5 * (x + y):.6g} {unit} for both", "given")
            else:
                more = f"; or --even-legs, up to {100 * UNEVEN:g} %" if share <= UNEVEN else ""
                self.outside(what, found, f"equal legs: the exchange of legs rests on them{more}")
        if not self.uneven:
            return a
        keys = ("mass", "length", "com", "com_across", "inertia")
        return PlanarLink(**{key: 0.5 * (getattr(a, key) + getattr(b, key)) for key in keys})


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
    reader = _Reader(tree, given)
    try:
        return reader.walker(backward=backward), reader.rows
    except _Impossible:
        return None, reader.rows


def placement(walker: PlanarWalker, q: Array, dq: Array) -> tuple[Array, Array, Array, Array]:
    """Where the file's torso is when ours is at q, in a world of x forward, y left, z up.

    Args:
        walker: The walker.
        q: Hip x, z in [m], torso angle in [rad], (3,).
        dq: Their rates, (3,).

    Returns:
        Rotation (3, 3) and origin (3,) of its root link; derivatives of (origin's velocity, angular velocity in the
        link's frame) by the three rates, (6, 3); and the origin's acceleration at zero second derivatives, (3,).
    """
    s, c = math.sin(q[2] - walker.lean), math.cos(q[2] - walker.lean)
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])  # about (0, -1, 0)
    rotation = turn @ walker.plane @ walker.frame[:3, :3]
    arm = turn @ walker.plane @ (walker.frame[:3, 3] - walker.middle)  # from the hips to the origin
    axis = np.array([0.0, -1.0, 0.0])
    jacobian = np.zeros((6, 3))
    jacobian[0, 0] = jacobian[2, 1] = 1.0
    jacobian[:3, 2] = np.cross(axis, arm)
    jacobian[3:, 2] = rotation.T @ axis
    centripetal = -arm.copy()
    centripetal[1] = 0.0
    return rotation, np.array([q[0], 0.0, q[1]]) + arm, jacobian, centripetal * dq[2] ** 2


def _ends(joint: Joint) -> tuple[float, float]:
    return joint.low, joint.high


def _angle(direction: Array) -> float:
    """Absolute angle of a link along (x, z): counter-clockwise about (0, -1, 0) from up."""
    return math.atan2(-direction[0], direction[1])


def _leftness(body: _Body) -> int:
    """1 for a leg whose names say left, -1 for right."""
    names = " ".join([*(link.name for link in body.links), body.joint.name if body.joint else ""]).lower()
    child = body.children[0]
    names += " " + (child.joint.name if child.joint else "").lower()
    padded = "_" + names.replace(" ", "_").replace("-", "_").replace(".", "_") + "_"
    left = "left" in names or "_l_" in padded
    right = "right" in names or "_r_" in padded
    return int(left) - int(right)


__all__ = ["Given", "PlanarJoint", "PlanarLink", "PlanarWalker", "Row", "placed", "placement", "reduce"]
