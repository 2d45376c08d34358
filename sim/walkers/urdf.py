"""A URDF as a tree of links. Its numbers alone: what is drawn is looked at only for where a foot may be."""

import math
import xml.etree.ElementTree as ET

import numpy as np

from sim.errors import UserError
from sim.walkers.tree import FULL_TURN, Array, Inertial, Joint, Kind, Link, Row, Tip, Tree, at, placed, rotation, words

KINDS: dict[str, Kind] = {
    "fixed": "fixed",
    "revolute": "hinge",
    "continuous": "hinge",
    "prismatic": "slide",
    "planar": "planar",
    "floating": "free",
}
FOOT = ("foot", "toe", "tip", "sole", "contact")
IGNORED = ("material", "gazebo", "transmission", "link", "joint")


def read(text: str, where: str) -> Tree:
    """A URDF's text as a tree.

    Args:
        text: XML.
        where: The file, for messages.

    Raises:
        UserError: not the XML of a robot, a number that is none, links that make no tree.
    """
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError, LookupError) as error:
        raise UserError(f"{where}: not an XML file ({str(error).splitlines()[0]})") from error
    for element in root.iter():  # some toolboxes give their files a namespace
        if isinstance(element.tag, str) and element.tag.startswith("{"):
            element.tag = element.tag.rpartition("}")[2]
    if root.tag != "robot":
        raise UserError(f"{where}: its root is <{root.tag[:40]}>; must be the <robot> of a URDF")
    rows: list[Row] = []
    links = {}
    for element in root.findall("link"):
        link = _link(element, where)
        if link.name in links:
            raise UserError(f"{where}: two links named {link.name!r}; names must differ")
        links[link.name] = link
    if not links:
        raise UserError(f"{where}: no <link> in it; must have five links or more")
    motors = _motors(root, where, rows)
    for element in root.findall("joint"):
        _join(element, links, motors, root, where, rows)
    others = sorted({item.tag[:40] for item in root if isinstance(item.tag, str)} - set(IGNORED))
    if others:
        rows.append(Row(part="elements", found=", ".join(others), made="of no mechanical effect", verdict="left out"))
    drawn = sum(1 for shape in root.iter("mesh"))
    if drawn:
        rows.append(Row(part="meshes", found=f"{drawn}", made="not looked at", verdict="left out"))
    return Tree(links=_sorted(links, where), rows=rows)


def _number(text: str | None, otherwise: float, where: str) -> float:
    if text is None:
        return otherwise
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UserError(f"{where} = {text.strip()[:40]!r}; must be a finite number")
    return value


def _attribute(element: ET.Element | None, key: str, otherwise: float, where: str) -> float:
    return _number(None if element is None else element.get(key), otherwise, f"{where} {key}")


def _vector(element: ET.Element | None, key: str, otherwise: tuple[float, ...], where: str) -> Array:
    text = None if element is None else element.get(key)
    if text is None:
        return np.array(otherwise)
    parts = text.split()
    if len(parts) != 3:
        raise UserError(f"{where} {key} = {text[:40]!r}; must be three numbers")
    return np.array([_number(part, 0.0, f"{where} {key}") for part in parts])


def _origin(element: ET.Element | None, where: str) -> Array:
    origin = None if element is None else element.find("origin")
    rpy = _vector(origin, "rpy", (0.0, 0.0, 0.0), where)
    return placed(rotation(rpy), _vector(origin, "xyz", (0.0, 0.0, 0.0), where))


def _name(element: ET.Element, what: str, where: str) -> str:
    name = element.get("name")
    if not name:
        raise UserError(f"{where}: a <{what}> without a name")
    return name


def _link(element: ET.Element, where: str) -> Link:
    name = _name(element, "link", where)
    here = f"{where}: link {name}"
    link = Link(name=name, parent=None, placement=np.eye(4))
    inertial = element.find("inertial")
    if inertial is not None:
        frame = _origin(inertial, here)
        mass = _attribute(inertial.find("mass"), "value", 0.0, f"{here} mass")
        tensor = inertial.find("inertia")
        xx, yy, zz, xy, xz, yz = (
            _attribute(tensor, key, 0.0, here) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        turned = frame[:3, :3]
        if mass < 0.0 or yy < 0.0:
            raise UserError(f"{here}: mass = {mass:g} kg, iyy = {yy:g} kg m^2; must not be below 0")
        if mass or matrix.any():
            link.inertials.append(Inertial(mass=mass, com=frame[:3, 3], inertia=turned @ matrix @ turned.T))
    for kind, rank in (("collision", 1), ("visual", 2)):
        for drawn in element.findall(kind):
            link.tips += _tips(drawn, kind, rank, here)
    return link


def _tips(drawn: ET.Element, kind: str, rank: int, where: str) -> list[Tip]:
    frame, geometry = _origin(drawn, where), drawn.find("geometry")
    shape = None if geometry is None or not len(geometry) else geometry[0]
    if shape is None:
        return []
    ends: list[float]
    radius = _attribute(shape, "radius", 0.0, where)
    if shape.tag == "sphere":
        ends = [-radius, radius]
    elif shape.tag in ("cylinder", "capsule"):
        half = 0.5 * _attribute(shape, "length", 0.0, where) + (radius if shape.tag == "capsule" else 0.0)
        ends = [-half, half]
    elif shape.tag == "box":
        half = 0.5 * float(_vector(shape, "size", (0.0, 0.0, 0.0), where)[2])
        ends = [-half, half]
    else:
        return []
    return [Tip(what=f"end of its {kind} {shape.tag}", point=at(frame, np.array([0, 0, z])), rank=rank) for z in ends]


def _motors(root: ET.Element, where: str, rows: list[Row]) -> dict[str, float]:
    """Rotor inertia as each joint feels it in [kg m^2]."""
    found: dict[str, float] = {}
    for transmission in root.iter("transmission"):
        here = f"{where}: transmission {transmission.get('name', '')}"
        inertia, reduction = (
            _number(next((e.text for e in transmission.iter(tag)), None), otherwise, f"{here} {tag}")
            for tag, otherwise in (("motorInertia", 0.0), ("mechanicalReduction", 1.0))
        )
        if inertia < 0.0:
            raise UserError(f"{here} motorInertia = {inertia:g} kg m^2; must not be below 0")
        for joint in transmission.findall("joint"):
            name = joint.get("name", "")
            found[name] = found.get(name, 0.0) + inertia * reduction**2
            if inertia:
                rows.append(
                    Row(
                        part=f"transmission of {name}",
                        found=f"motorInertia {inertia:g} kg m^2, reduction {reduction:g}",
                        made=f"rotor inertia {inertia * reduction**2:g} kg m^2 at the joint",
                        verdict="made",
                    )
                )
    return found


def _join(
    element: ET.Element, links: dict[str, Link], motors: dict[str, float], root: ET.Element, where: str, rows: list[Row]
) -> None:
    name = _name(element, "joint", where)
    here, given = f"{where}: joint {name}", element.get("type", "")
    if given not in KINDS:
        raise UserError(f"{here}: type = {given[:40]!r}; must be one of {', '.join(KINDS)}")
    ends = []
    for end in ("parent", "child"):
        found = element.find(end)
        link = "" if found is None else found.get("link", "")
        if link not in links:
            raise UserError(f"{here}: {end} = {link[:40]!r}; must be the name of a <link>")
        ends.append(link)
    child = links[ends[1]]
    if child.parent is not None:
        raise UserError(f"{here}: link {child.name} is joined twice; must have one parent")
    child.parent, child.placement = ends[0], _origin(element, here)
    kind = KINDS[given]
    if kind == "fixed":
        return
    axis = _vector(element.find("axis"), "xyz", (1.0, 0.0, 0.0), here)
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise UserError(f"{here}: axis = 0 0 0; must be a direction")
    if abs(length - 1.0) > 1e-6:
        rows.append(Row(part=name, found=f"axis {words(axis)}", made="made of length 1", verdict="made"))
    if element.find("mimic") is not None:
        rows.append(
            Row(part=name, found="mimics another joint", made="joints that move on their own", verdict="outside")
        )
    limit, dynamics = element.find("limit"), element.find("dynamics")
    low, high = -math.inf, math.inf
    if given == "revolute":
        low = _attribute(limit, "lower", -math.inf, here)
        high = _attribute(limit, "upper", math.inf, here)
        low, high = (low if low > -FULL_TURN else -math.inf), (high if high < FULL_TURN else math.inf)
        if low > high:
            raise UserError(f"{here}: lower = {low:g} rad above upper = {high:g} rad")
        if limit is not None and (limit.get("lower") is None) != (limit.get("upper") is None):
            rows.append(Row(part=name, found="one limit of two", made="no stop on the other side", verdict="made"))
    spring = next((item for item in root.iter("gazebo") if item.get("reference") == name), None)
    stiffness, rest = (
        _number(None if spring is None else spring.findtext(tag), 0.0, f"{here} {tag}")
        for tag in ("springStiffness", "springReference")
    )
    child.joint = Joint(
        name=name,
        kind=kind,
        axis=axis / length,
        anchor=np.zeros(3),
        low=low,
        high=high,
        effort=_attribute(limit, "effort", math.nan, here),
        damping=_attribute(dynamics, "damping", 0.0, here),
        friction=_attribute(dynamics, "friction", 0.0, here),
        rotor=motors.get(name, 0.0),
        stiffness=stiffness,
        rest=rest,
    )


def _sorted(links: dict[str, Link], where: str) -> list[Link]:
    """Parents before children; a fixed link without mass at a tip may be a foot."""
    roots = [link.name for link in links.values() if link.parent is None]
    if len(roots) != 1:
        raise UserError(f"{where}: {len(roots)} links without a parent {roots[:4]}; must be one, the root of a tree")
    children: dict[str, list[str]] = {}
    for link in links.values():
        if link.parent is not None:
            children.setdefault(link.parent, []).append(link.name)
    order, waiting = [], roots
    while waiting:
        name = waiting.pop(0)
        order.append(links[name])
        waiting += children.get(name, [])
    if len(order) != len(links):
        raise UserError(f"{where}: links {sorted(set(links) - {link.name for link in order})[:4]} hang in a circle")
    for link in order:
        if link.joint is None and link.parent is not None and name_of_foot(link.name):
            link.tips.append(Tip(what=f"frame {link.name}", point=np.zeros(3), rank=0))
        elif link.joint is None and link.parent is not None and not link.inertials and not link.tips:
            link.tips.append(Tip(what=f"frame {link.name}", point=np.zeros(3), rank=3))
    return order


def name_of_foot(name: str) -> bool:
    """Whether a name says that this is a foot."""
    return any(word in name.lower() for word in FOOT)
