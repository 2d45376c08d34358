"""Write the folder of a new walker: its URDF, the MJCF that agrees with it, its source, a README to fill in."""

import json
import math
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from string import Template

from sim.errors import UserError
from sim.walkers.planar import Given, PlanarJoint, PlanarLink, PlanarWalker
from sim.walkers.tree import Row

TEMPLATES = Path(__file__).parent
NAME = re.compile(r"[a-z][a-z0-9_-]*")
TIBIA_BARE = 0.015  # [m] of the tibia's end is left to the foot in the picture
TOE = 0.012  # [m] from the tip to the middle of the drawn toe
TORSO_LENGTH = 2.6  # times its centre of mass: how long the torso is drawn
TORSO_SHORTEST = 0.1  # [m]
OUT_OF_PLANE = 0.04  # izz by iyy; without effect in the plane
FREE = 6.2832  # [rad] written where a joint has no stop

PUBLISHED = "published"
"""Stem of the copy of the file a walker was made from."""

CONVERSION = "conversion.json"
"""How it was made of it, for the check to make it again."""

README = """\
# $name

| file | what it is | read by |
|---|---|---|
| `$name.urdf` | the controller's belief: links, joints, effort limits | `controller/` |
| `$name.xml` | the plant: MJCF, contact, motors, sensors | `sim/` |
| `gaits/` | gaits, made by `cmpc gait design --walker $walker` | both |
$source
Conventions (axes, order of coordinates, contact settings) are those of `models/rabbit`.
Where the numbers come from: say it here.

`cmpc walker check $walker` says how far the two models agree, judges every gait, and lets the walker walk.
$table"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """The file a walker was made from.

    Attributes:
        text: URDF or MJCF, as it was read.
        kind: "urdf" or "xml".
        given: What was given beside it.
    """

    text: str
    kind: str
    given: Given


@contextmanager
def new_folder(folder: Path) -> Iterator[None]:
    """A folder to be filled; gone again where that fails or is interrupted.

    Raises:
        UserError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made: {error.strerror}") from error
    try:
        yield
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def fill(folder: Path, walker: PlanarWalker, rows: Sequence[Row], source: Source, *, as_it_is: Path | None) -> None:
    """Write a walker's files.

    Args:
        folder: An empty one; its name is the walker's.
        walker: Its numbers.
        rows: Table of the conversion, for the README.
        source: Kept in the folder.
        as_it_is: URDF that is already in this program's conventions and is copied; None to write one.

    Raises:
        UserError: they cannot be written.
    """
    name = folder.name
    fields = _fields(walker)
    try:
        (folder / "gaits").mkdir()
        if as_it_is is not None:
            shutil.copyfile(as_it_is, folder / f"{name}.urdf")
        else:
            (folder / f"{name}.urdf").write_text(_urdf(name, walker), encoding="utf-8")
            (folder / f"{PUBLISHED}.{source.kind}").write_text(source.text, encoding="utf-8")
            (folder / CONVERSION).write_text(_conversion(source), encoding="utf-8")
        mjcf = Template((TEMPLATES / "template.xml").read_text(encoding="utf-8")).substitute(fields, name=name)
        (folder / f"{name}.xml").write_text(mjcf, encoding="utf-8")
        kept = f"| `{PUBLISHED}.{source.kind}` | the file it was made from | `cmpc walker check` |\n"
        text = Template(README).substitute(
            name=name,
            walker=folder.as_posix(),
            source="" if as_it_is else kept,
            table=_table(rows) if rows and not as_it_is else "",
        )
        (folder / "README.md").write_text(text, encoding="utf-8")
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror}") from error


def check_name(folder: Path) -> str:
    """The walker's name.

    Raises:
        UserError: the folder exists, or its name is not legal.
    """
    name = folder.name
    if not NAME.fullmatch(name):
        raise UserError(f"walker {name!r}: must be a folder name of a-z, 0-9, _ and -, beginning with a letter")
    if folder.exists():
        raise UserError(f"{folder}: already exists and is never overwritten; choose another folder")
    return name


def conversion(folder: Path) -> Source | None:
    """The file a walker was made from; None where there is none.

    Raises:
        UserError: a file of it is not what was written.
    """
    record = folder / CONVERSION
    if not record.is_file():
        return None
    try:
        data = json.loads(record.read_text(encoding="utf-8"))
        given = Given(
            torque=tuple(data["torque"]) if data["torque"] else None,
            even_legs=bool(data["even_legs"]),
            tibia_length=data["tibia_length"],
            names=dict(data["names"]),
        )
        kind = data["kind"]
        text = (folder / f"{PUBLISHED}.{kind}").read_text(encoding="utf-8")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UserError(f"{record}: not what cmpc walker new writes ({str(error).splitlines()[0]})") from error
    return Source(text=text, kind=kind, given=given)


def _conversion(source: Source) -> str:
    given = asdict(source.given)
    return json.dumps({"kind": source.kind, **given}, indent=2) + "\n"


def _number(value: float) -> str:
    return f"{value:.12g}" if float(f"{value:.12g}") == value else repr(float(value))


def _fields(walker: PlanarWalker) -> dict[str, str]:
    numbers: dict[str, float] = {}
    for name, link in (("torso", walker.torso), ("femur", walker.femur), ("tibia", walker.tibia)):
        numbers |= {f"{name}_{key}": value for key, value in asdict(link).items()}
    numbers |= {"hip_torque": walker.hip.torque, "knee_torque": walker.knee.torque}
    numbers |= {"hip_damping": walker.hip.damping, "knee_damping": walker.knee.damping}
    fields = {key: _number(value) for key, value in numbers.items()}
    for name in ("torso", "femur", "tibia"):
        fields[f"{name}_izz"] = f"{OUT_OF_PLANE * numbers[f'{name}_inertia']:.6g}"
    fields["torso_length"] = f"{max(TORSO_LENGTH * walker.torso.com, TORSO_SHORTEST):.4g}"
    fields["shaft_length"] = f"{max(walker.tibia.length - TIBIA_BARE, 0.5 * walker.tibia.length):.6g}"
    fields["toe"] = f"{max(walker.tibia.length - TOE, 0.5 * walker.tibia.length):.6g}"
    fields |= {"hip_more": _more(walker.hip), "knee_more": _more(walker.knee)}
    return fields


def _more(joint: PlanarJoint) -> str:
    """Attributes of an MJCF joint beyond its damping, those that are not zero."""
    found = ""
    for key, value in (("armature", joint.rotor), ("frictionloss", joint.friction), ("stiffness", joint.stiffness)):
        found += f' {key}="{_number(value)}"' if value else ""
    found += f' springref="{_number(joint.rest)}"' if joint.stiffness else ""
    if math.isfinite(joint.low) or math.isfinite(joint.high):
        low, high = _stops(joint)
        found += f' range="{low} {high}"'
    return found


def _stops(joint: PlanarJoint) -> tuple[str, str]:
    low = joint.low if math.isfinite(joint.low) else -FREE
    high = joint.high if math.isfinite(joint.high) else FREE
    return _number(low), _number(high)


def _urdf(name: str, walker: PlanarWalker) -> str:
    """The walker in this program's conventions."""
    lines = [
        '<?xml version="1.0"?>',
        f"<!-- Written by cmpc walker new from {PUBLISHED}.*; conventions of models/rabbit/rabbit.urdf. -->",
        f'<robot name="{name}">',
        *_link("torso", walker.torso),
    ]
    for side in ("left", "right"):
        lines += [
            *_link(f"{side}_femur", walker.femur),
            *_joint(f"{side}_hip", "torso", f"{side}_femur", 0.0, walker.hip),
            *_link(f"{side}_tibia", walker.tibia),
            *_joint(f"{side}_knee", f"{side}_femur", f"{side}_tibia", walker.femur.length, walker.knee),
            f'  <link name="{side}_foot"/>',
            f'  <joint name="{side}_tip" type="fixed">',
            f'    <parent link="{side}_tibia"/><child link="{side}_foot"/>',
            f'    <origin xyz="0 0 {_number(walker.tibia.length)}"/>',
            "  </joint>",
        ]
    return "\n".join([*lines, "</robot>", ""])


def _link(name: str, link: PlanarLink) -> list[str]:
    inertia, izz = _number(link.inertia), f"{OUT_OF_PLANE * link.inertia:.6g}"
    return [
        f'  <link name="{name}">',
        "    <inertial>",
        f'      <origin xyz="{_number(link.com_across)} 0 {_number(link.com)}"/>',
        f'      <mass value="{_number(link.mass)}"/>',
        f'      <inertia ixx="{inertia}" iyy="{inertia}" izz="{izz}" ixy="0" ixz="0" iyz="0"/>',
        "    </inertial>",
        "  </link>",
    ]


def _joint(name: str, parent: str, child: str, height: float, joint: PlanarJoint) -> list[str]:
    low, high = _stops(joint)
    lines = [
        f'  <joint name="{name}" type="revolute">',
        f'    <parent link="{parent}"/><child link="{child}"/>',
        f'    <origin xyz="0 0 {_number(height)}"/>',
        '    <axis xyz="0 -1 0"/>',
        f'    <limit effort="{_number(joint.torque)}" velocity="1000" lower="{low}" upper="{high}"/>',
        f'    <dynamics damping="{_number(joint.damping)}" friction="{_number(joint.friction)}"/>',
        "  </joint>",
    ]
    if joint.rotor:
        lines += [
            f'  <transmission name="{name}"><joint name="{name}"/><actuator name="{name}">',
            f"    <mechanicalReduction>1</mechanicalReduction><motorInertia>{_number(joint.rotor)}</motorInertia>",
            "  </actuator></transmission>",
        ]
    if joint.stiffness:
        stiffness, rest = _number(joint.stiffness), _number(joint.rest)
        lines += [
            f'  <gazebo reference="{name}"><springStiffness>{stiffness}</springStiffness>'
            f"<springReference>{rest}</springReference></gazebo>"
        ]
    return lines


def _table(rows: Sequence[Row]) -> str:
    lines = ["", "What was made of the file:", "", "| part | found | made of it | |", "|---|---|---|---|"]
    lines += [f"| {row.part} | {row.found} | {row.made} | {row.verdict} |".replace("\n", " ") for row in rows]
    return "\n".join(lines) + "\n"
