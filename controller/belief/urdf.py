"""A walker's URDF as text: what Pinocchio does not read of it, and a form of it that Pinocchio reads without a word.

Rotor inertia comes from `<transmission>` (motorInertia times the square of mechanicalReduction), springs from
`<gazebo reference="JOINT">` (springStiffness, springReference), as their own readers have it.
"""

import contextlib
import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from controller.common.errors import UserError

FULL_TURN = 6.28
"""[rad] A bound this far from the zero pose stops nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """What a URDF says of one joint beyond its place.

    Attributes:
        rotor: Rotor inertia as the joint feels it in [kg m^2].
        friction: Dry friction in [N.m].
        stiffness: Of a spring in [N.m/rad].
        rest: Where the spring is slack in [rad].
        low, high: Stops in [rad]; infinite where there is none.
    """

    rotor: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    low: float = -math.inf
    high: float = math.inf


def parse(path: Path) -> ET.Element:
    """The file's root element.

    Raises:
        UserError: missing, unreadable, or not the XML of a robot.
    """
    if not path.is_file():
        raise UserError(f"{path}: no such walker file; expected the URDF of a five-link walker")
    try:
        root = ET.fromstring(path.read_bytes())
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    except (ET.ParseError, ValueError, LookupError) as error:
        raise UserError(f"{path}: not a URDF Pinocchio can read ({str(error).splitlines()[0]})") from error
    if root.tag != "robot":
        raise UserError(f"{path}: not a URDF Pinocchio can read (its root is <{root.tag[:40]}>; must be <robot>)")
    return root


def number(element: ET.Element | None, key: str, otherwise: float, where: str) -> float:
    """A finite number of an element's attribute, or of its text where key is empty.

    Raises:
        UserError: not a number; `where` names the file and the element.
    """
    text = None if element is None else (element.get(key) if key else element.text)
    if text is None:
        return otherwise
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UserError(f"{where}: {key or 'value'} = {text.strip()[:40]!r}; must be a finite number")
    return value


def joints(root: ET.Element, path: Path) -> dict[str, Joint]:
    """What the file says of each of its hinges.

    Raises:
        UserError: a number that is none, or a mimic joint.
    """
    rotors: dict[str, float] = {}
    for transmission in root.iter("transmission"):
        inertia = _motor(transmission, "motorInertia", 0.0, path)
        reduction = _motor(transmission, "mechanicalReduction", 1.0, path)
        for joint in transmission.findall("joint"):
            name = joint.get("name", "")
            rotors[name] = rotors.get(name, 0.0) + inertia * reduction**2
    springs = {item.get("reference", ""): item for item in root.iter("gazebo")}
    found = {}
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        where = f"{path}: joint {name}"
        if joint.find("mimic") is not None:
            raise UserError(f"{where}: mimics another; must move on its own")
        spring = springs.get(name, ET.Element("gazebo"))
        limit = joint.find("limit") if kind == "revolute" else None
        low = number(limit, "lower", -math.inf, where)
        high = number(limit, "upper", math.inf, where)
        low = low if low > -FULL_TURN else -math.inf
        high = high if high < FULL_TURN else math.inf
        if low > high:
            raise UserError(f"{where}: lower = {low:g} rad above upper = {high:g} rad")
        found[name] = Joint(
            rotor=rotors.get(name, 0.0),
            friction=number(joint.find("dynamics"), "friction", 0.0, where),
            stiffness=number(spring.find("springStiffness"), "", 0.0, where),
            rest=number(spring.find("springReference"), "", 0.0, where),
            low=low,
            high=high,
        )
    return found


def _motor(transmission: ET.Element, tag: str, otherwise: float, path: Path) -> float:
    where = f"{path}: transmission {transmission.get('name', '')}"
    return number(next(transmission.iter(tag), None), "", otherwise, where)


def bare(root: ET.Element) -> str:
    """The robot without what is drawn, its unlimited hinges as hinges of one coordinate: what Pinocchio is given."""
    robot = ET.Element("robot", {"name": root.get("name", "walker")})
    for item in root:
        if item.tag not in ("link", "joint"):
            continue
        kept = ET.SubElement(robot, item.tag, dict(item.attrib))
        for part in item:
            if part.tag in ("origin", "parent", "child", "axis", "inertial"):
                kept.append(part)
        if item.tag == "joint" and item.get("type") in ("revolute", "continuous", "prismatic"):
            limit, dynamics = item.find("limit"), item.find("dynamics")
            effort = "0" if limit is None else limit.get("effort", "0")
            wide = {"lower": "-1e3", "upper": "1e3", "velocity": "1e3", "effort": effort}
            ET.SubElement(kept, "limit", wide)
            damping = "0" if dynamics is None else dynamics.get("damping", "0")
            ET.SubElement(kept, "dynamics", {"damping": damping, "friction": "0"})
            if kept.get("type") == "continuous":
                kept.set("type", "revolute")
    return ET.tostring(robot, encoding="unicode")


@contextlib.contextmanager
def silent() -> Iterator[None]:
    """Nothing that a library prints by itself reaches the terminal: its parsers write to the process's own streams."""
    import sys

    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(Exception):
            stream.flush()
    kept: list[tuple[int, int]] = []
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for descriptor in (1, 2):
            with contextlib.suppress(OSError):
                kept.append((descriptor, os.dup(descriptor)))
                os.dup2(nowhere, descriptor)
        os.close(nowhere)
        yield
    finally:
        for descriptor, copy in kept:
            os.dup2(copy, descriptor)
            os.close(copy)
