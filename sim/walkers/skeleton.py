"""Which links of a tree are the torso, the legs and the base: what is fixed welded together, names and maps obeyed."""

from dataclasses import dataclass, field

import numpy as np

from sim.walkers.planar import Given
from sim.walkers.table import Table
from sim.walkers.tree import Array, Joint, Link, Tree, at

SIDES = ("left", "right")
MASSLESS = 1e-2  # of the whole: a carriage of the base with less is left out


@dataclass(slots=True, eq=False)
class Body:
    """Links welded into one.

    Attributes:
        links: The first is the one that moves on the joint.
        joint: To the parent; None for the root.
        frames: Of each link by name, in the file's world in the zero pose, (4, 4).
        parent, children: What it hangs on, and what hangs on it.
    """

    links: list[Link]
    joint: Joint | None
    frames: dict[str, Array]
    parent: "Body | None"
    children: list["Body"] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Of its first link."""
        return self.links[0].name

    @property
    def frame(self) -> Array:
        """Of its first link, (4, 4)."""
        return self.frames[self.links[0].name]

    @property
    def anchor(self) -> Array:
        """Its joint in the file's world in the zero pose in [m], (3,)."""
        assert self.joint is not None
        return at(self.frame, self.joint.anchor)


def bodies(tree: Tree) -> list[Body]:
    """The tree with everything fixed welded together."""
    found: list[Body] = []
    of: dict[str, Body] = {}
    for link in tree.links:
        above = np.eye(4) if link.parent is None else of[link.parent].frames[link.parent]
        frame = above @ link.placement
        if link.parent is not None and link.joint is None:
            body = of[link.parent]
            body.links.append(link)
            body.frames[link.name] = frame
        else:
            parent = None if link.parent is None else of[link.parent]
            body = Body([link], link.joint, {link.name: frame}, parent)
            found.append(body)
            if parent:
                parent.children.append(body)
        of[link.name] = body
    return found


def torso_of(bodies: list[Body], tree: Tree, given: Given, table: Table) -> Body:
    """The body both legs hang on."""
    asked = given.names.get("torso")
    if asked is not None:
        for body in bodies:
            if asked in (link.name for link in body.links):
                return body
        names = ", ".join(link.name for link in tree.links)
        raise table.stop("--map torso", f"no link {asked!r}", f"one of {names}")
    forks = [body for body in bodies if len(body.children) > 1]
    if not forks:
        found = f"{len(bodies) - 1} moving joints in one chain"
        raise table.stop("topology", found, "a torso on which two legs of a hip and a knee hang")
    return forks[0]


def legs_of(torso: Body, given: Given, table: Table) -> dict[str, Body]:
    """Femurs and tibias by the role of their joint."""
    moving = [child for child in torso.children if child.joint]
    shape = {body.name: _below(body) for body in moving}
    if len(moving) != 2 or any(kinds != ["hinge", "hinge"] for kinds in shape.values()):
        parts = "; ".join(f"{body.joint.name}: {_words(body)}" for body in moving if body.joint)
        found = f"at {torso.name}, {parts}" if parts else f"nothing moves at {torso.name}"
        raise table.stop("topology", found, "two legs of a hip and a knee, five links in all")
    sides = _sides(moving, given, table)
    found_legs = {}
    for side, femur in zip(SIDES, sides, strict=True):
        found_legs[f"{side}_hip"], found_legs[f"{side}_knee"] = femur, femur.children[0]
    return found_legs


def base(torso: Body, tree: Tree, table: Table) -> bool:
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
            raise table.stop("base", f"{now.name} carries {names}", "one robot, its torso at the end of the base")
    kinds = [joint.kind for joint in joints[::-1]]
    links = torso.links[0].name
    whole = sum(i.mass for link in tree.links for i in link.inertials)
    if carried > MASSLESS * whole:
        table.outside("base", f"its carriages weigh {carried:g} kg", "a base without mass")
    elif carried:
        table.row("base", f"its carriages weigh {carried:g} kg", "a base without mass", "left out")
    if joints:
        named = ", ".join(f"{joint.name} ({joint.kind})" for joint in joints[::-1])
        table.row("base", named, "taken off: the walker is free in its plane")
    elif torso.parent is not None or (len(torso.links) > 1 and not torso.links[0].inertials):
        fixed = [link.name for link in torso.links[1:] if link.parent == links][:1] or [torso.name]
        if links == "world" and not torso.links[0].inertials:
            table.row("base", f"{fixed[0]} fixed to the world", "taken off: the walker is free in its plane")
    for joint in joints:
        for what, size, unit in (
            ("damping", joint.damping, ""),
            ("friction", joint.friction, ""),
            ("armature", joint.rotor, ""),
            ("stiffness", joint.stiffness, ""),
        ):
            if size:
                table.row(f"base joint {joint.name}", f"{what} {size:g}{unit}", "none", "left out")
    return "planar" in kinds or kinds.count("slide") == 2


def _below(body: Body) -> list[str]:
    kinds: list[str] = []
    now = body
    while True:
        kinds.append(now.joint.kind if now.joint else "fixed")
        if not now.children:
            return kinds
        if len(now.children) > 1:
            return [*kinds, "fork"]
        now = now.children[0]


def _words(body: Body) -> str:
    names, now = [], body
    while True:
        joint = now.joint
        if joint:
            names.append(f"{joint.kind} {joint.name}")
        if len(now.children) != 1:
            return " - ".join(names) + (" - a fork" if now.children else "")
        now = now.children[0]


def _sides(femurs: list[Body], given: Given, table: Table) -> list[Body]:
    """Left, then right: by what was given, by their names, or as they come."""
    for index, role in ((0, "left_hip"), (1, "right_hip"), (0, "left_knee"), (1, "right_knee")):
        asked = given.names.get(role)
        if asked is None:
            continue
        names = [
            (b.joint.name if role.endswith("hip") else b.children[0].joint.name)  # type: ignore[union-attr]
            for b in femurs
        ]
        if asked not in names:
            raise table.stop(f"--map {role}", f"no such joint {asked!r}", f"one of {', '.join(names)}")
        at_left = names.index(asked) == index
        return femurs if at_left else femurs[::-1]
    scores = [_leftness(body) for body in femurs]
    if scores[0] == scores[1]:
        first, second = (body.joint.name for body in femurs if body.joint)
        table.row("sides", f"{first}, {second}: no left or right in the names", f"left: {first}; --map left_hip=...")
        return femurs
    return femurs if scores[0] > scores[1] else femurs[::-1]


def _leftness(body: Body) -> int:
    """1 for a leg whose names say left, -1 for right."""
    names = " ".join([*(link.name for link in body.links), body.joint.name if body.joint else ""]).lower()
    child = body.children[0]
    names += " " + (child.joint.name if child.joint else "").lower()
    padded = "_" + names.replace(" ", "_").replace("-", "_").replace(".", "_") + "_"
    left = "left" in names or "_l_" in padded
    right = "right" in names or "_r_" in padded
    return int(left) - int(right)
