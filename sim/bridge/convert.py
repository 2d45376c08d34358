"""A walker of a file as published: its folder, and the proof that it is the same robot."""

import math
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from controller.belief import WalkerModel
from controller.belief.lumped import Link
from controller.belief.published import Published
from sim.errors import UserError
from sim.interface import Vector
from sim.walkers import mjcf, new, urdf, xacro
from sim.walkers.new import Source
from sim.walkers.planar import Given, PlanarLink, PlanarWalker, placement
from sim.walkers.reduction import reduce
from sim.walkers.tree import Row, Tree

Kind = Literal["urdf", "mjcf", "xacro"]

STATES = 1000
EXACT = 1e-9
"""Relative: how far the made walker may be from the file as published."""

PER_ROUNDING = 10.0  # of it for each part that was rounded

MASS = (0.05, 200.0)  # [kg] of a link
LENGTH = (0.05, 3.0)  # [m]
GYRATION = 2.0  # largest radius of gyration by the link's length; reflected rotors make 1.35 of rabbit-tac's tibia


@np.errstate(all="ignore")  # numbers of a file may be anything; what comes of them is judged
def new_walker(
    folder: Path, file: Path, kind: Kind, given: Given, *, show: Callable[[Sequence[Row]], None]
) -> tuple[WalkerModel, dict[str, float]]:
    """Make a walker's folder from a file as published.

    Args:
        folder: To be made.
        file: URDF, MJCF or xacro.
        kind: Which of them.
        given: What the file does not say.
        show: Told the whole table of the conversion before anything is made or refused.

    Returns:
        The made walker, and how far it is from the file.

    Raises:
        UserError: the file is no walker's, something must be given, or the folder cannot be made.
    """
    new.check_name(folder)
    tree, source = _read(file, kind, given)
    walker, rows = reduce(tree, given)
    if walker is not None:
        rows += _implausible(walker)
    show(rows)
    stops = [f"{row.part}: {row.found}; {_legal(row)}" for row in rows if row.stops]
    if walker is None or stops:
        raise UserError(f"{file}: no walker made of it: {' | '.join(stops)}")
    as_it_is = file if kind == "urdf" and given == Given() and _ours(walker) and _canonical(file) else None
    with new.new_folder(folder):
        new.fill(folder, walker, rows, source, as_it_is=as_it_is)
        model = WalkerModel(folder / f"{folder.name}.urdf")
        return model, proof(model, walker, tree, source, str(file))


def _legal(row: Row) -> str:
    return f"must be {row.made}" if row.verdict == "outside" else f"{row.verdict}: {row.made}"


def _read(file: Path, kind: Kind, given: Given) -> tuple[Tree, Source]:
    if kind == "mjcf":
        tree = mjcf.read(file)
        return tree, Source(text=mjcf.whole(file), kind="xml", given=given)
    turned = False
    if kind == "xacro":
        text, turned = xacro.expand(file)
    else:
        text = _text(file)
    tree = urdf.read(text, str(file))
    if turned:
        tree.rows.append(Row(part="macros", found="used before they are defined", made="read first", verdict="made"))
    return tree, Source(text=text, kind="urdf", given=given)


def _text(file: Path) -> str:
    if not file.is_file():
        raise UserError(f"{file}: no such file; expected the URDF of a five-link walker")
    try:
        return file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{file}: not a text file ({str(error).splitlines()[0]})") from error


def _ours(walker: PlanarWalker) -> bool:
    """Whether the file's joints are our coordinates."""
    return all((m.name, m.sign, m.zero, m.offset) == (role, 1.0, 0.0, 0.0) for role, m in walker.coordinates.items())


def _canonical(file: Path) -> bool:
    """Whether a URDF is in this program's conventions already."""
    try:
        WalkerModel(file)
    except UserError:
        return False
    return True


def _implausible(walker: PlanarWalker) -> list[Row]:
    rows = []
    for name, link in (("torso", walker.torso), ("femurs", walker.femur), ("tibias", walker.tibia)):
        complaint = complaint_of(link)
        if complaint:
            found, _, legal = complaint.partition("; must be ")
            rows.append(Row(part=name, found=found, made=legal, verdict="outside"))
    return rows


def complaint_of(link: Link | PlanarLink) -> str:
    """What is implausible about a link's numbers; empty where nothing is."""
    if not MASS[0] <= link.mass <= MASS[1]:
        unit = "; is that in grams?" if link.mass > MASS[1] else ""
        return f"mass = {link.mass:g} kg; must be {MASS[0]:g} to {MASS[1]:g} kg{unit}"
    for what, value in (("length", link.length), ("centre of mass", abs(link.com))):
        if value and not value <= LENGTH[1]:
            return f"{what} = {value:g} m; must be up to {LENGTH[1]:g} m; is that in millimetres?"
    if link.length and link.length < LENGTH[0]:
        return f"length = {link.length:g} m; must be {LENGTH[0]:g} m or more"
    size = link.length or max(2.0 * abs(link.com), LENGTH[0])
    gyration = math.sqrt(link.inertia / link.mass)
    if gyration > GYRATION * size:
        return (
            f"inertia = {link.inertia:g} kg m^2: a radius of gyration of {gyration:.3g} m in a link of {size:.3g} m; "
            f"must be up to {GYRATION:g} times the link"
        )
    return ""


def published_walker(folder: Path) -> PlanarWalker | None:
    """The file a walker was made from as that walker, for its coordinates; None where there is no file.

    Raises:
        UserError: the file can no longer be read.
    """
    source = new.conversion(folder)
    if source is None:
        return None
    return _again(folder, source)[1]


def _again(folder: Path, source: Source) -> tuple[Tree, PlanarWalker, str]:
    file = folder / f"{new.PUBLISHED}.{source.kind}"
    tree = mjcf.read(file) if source.kind == "xml" else urdf.read(source.text, str(file))
    walker, rows = reduce(tree, source.given)
    if walker is None:
        stops = " | ".join(f"{row.part}: {row.found}" for row in rows if row.stops)
        raise UserError(f"{file}: no walker can be made of it any more: {stops}")
    return tree, walker, str(file)


def proof_of(folder: Path, model: WalkerModel) -> tuple[dict[str, float], float] | None:
    """How far a made walker is from the file it was made from, and how far it may be; None where there is no file.

    Raises:
        UserError: the file can no longer be read.
    """
    source = new.conversion(folder)
    if source is None:
        return None
    tree, walker, where = _again(folder, source)
    return proof(model, walker, tree, source, where), allowed(walker)


def allowed(walker: PlanarWalker) -> float:
    """Relative: how far a made walker may be from its file."""
    return EXACT + PER_ROUNDING * walker.rounded


def proof(model: WalkerModel, walker: PlanarWalker, tree: Tree, source: Source, where: str) -> dict[str, float]:
    """Largest relative differences of mass matrix, bias and feet between a made walker and its file as published.

    The file's own robot is read anew, a URDF by Pinocchio and an MJCF by MuJoCo, its torso free in space, and led
    through the coordinate map at `STATES` random states.

    Raises:
        UserError: it cannot be read.
    """
    published: Published | mjcf.Published
    if source.kind == "xml":
        with tempfile.TemporaryDirectory(prefix="cmpc-walker-") as name:
            copy = Path(name) / "published.xml"
            copy.write_text(source.text, encoding="utf-8")
            published = mjcf.Published(copy, walker.root)
    else:
        published = Published(source.text, walker.root, where)
    maps = [walker.coordinates[role] for role in model_order()]
    rotors = [link.joint.rotor for m in maps for link in tree.links if link.joint and link.joint.name == m.name]
    rng = np.random.default_rng(0)
    worst = {"mass matrix": 0.0, "Coriolis, centrifugal and gravity terms": 0.0, "feet": 0.0}
    for _ in range(STATES):
        q, dq = rng.uniform(-3.0, 3.0, 7), rng.uniform(-5.0, 5.0, 7)
        rotation, place, jacobian, drift = placement(walker, q[:3], dq[:3])
        signs = np.array([m.sign for m in maps])
        joints = {m.name: (m.theirs(q[3 + i]), m.sign * dq[3 + i]) for i, m in enumerate(maps)}
        D, h, index = published.at(rotation, place, jacobian @ dq[:3], joints)
        J = np.zeros((10, 7))
        J[:6, :3], J[range(6, 10), range(3, 7)] = jacobian, signs
        D, h = D[np.ix_(index, index)], h[index]
        if source.kind != "xml":
            D[range(6, 10), range(6, 10)] += rotors
        a = np.zeros(10)
        a[:3] = drift
        theirs = J.T @ D @ J, J.T @ (h + D @ a), _feet(published, walker)
        for name, mine, its in zip(worst, model.unpinned(q, dq), theirs, strict=True):
            worst[name] = max(worst[name], float(np.abs(mine - its).max() / np.abs(its).max()))
    return worst


def model_order() -> tuple[str, ...]:
    """Roles in the order of the unpinned walker's coordinates."""
    return ("left_hip", "left_knee", "right_hip", "right_knee")


def _feet(published: Published | mjcf.Published, walker: PlanarWalker) -> Vector:
    return np.array([published.point(link, point)[[0, 2]] for link, point in walker.feet])


__all__ = ["Given", "Kind", "allowed", "complaint_of", "new_walker", "proof", "proof_of"]
