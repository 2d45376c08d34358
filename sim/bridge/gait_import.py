"""A gait of another program's step: what its file says is read, fitted and polished."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from controller.belief import WalkerModel, load_gait
from controller.common import files, toml
from controller.design import frost, gait_file, imported
from controller.design.orbit import periodic_orbit
from controller.design.polish import polish
from sim.bridge import convert
from sim.bridge.gaits import Belief, check_new_file
from sim.errors import UserError
from sim.interface import Vector
from sim.walkers import WalkerFolder
from sim.walkers.new import conversion


def import_gait(
    walker: str,
    file: Path,
    out: Path,
    *,
    stance: str,
    degrees: bool,
    degree: int,
    force: bool,
    number: int | None = None,
) -> tuple[Belief, dict[str, float]]:
    """A gait of ours from another program's step, fitted and polished; returns it and how far it is from the file.

    Args:
        walker: Name or folder.
        file: CSV of a trajectory over one step, TOML or JSON of Bezier outputs, or a .mat of FROST.
        out: File to write.
        stance: "left" or "right", the foot that stands.
        degrees: Whether the file's angles are in degrees.
        degree: Of our Bezier polynomials.
        force: Whether to write over a file that is there.
        number: Which gait of a .mat, from 1; None for the only one.

    Raises:
        UserError: the file is no step, or no periodic orbit is near it.
    """
    folder = WalkerFolder.find(walker)
    model = WalkerModel(folder.urdf)
    where = str(file)
    maps = _maps(folder)
    columns = _columns(file, _joints(folder, maps), stance, number)
    step = imported.step_of(columns, maps, stance, degrees=degrees, where=where)
    how = "" if number is None else f" --number {number}"
    how += f" --walker {folder.name} --stance {stance}{' --degrees' if degrees else ''} --degree {degree}"
    remark = f"Made by: cmpc gait import {file.name}{how}"
    check_new_file(out, remark, force=force)
    fitted, residual = imported.fit(model, step, degree, out.stem, f"imported from {file.name}", where)
    gait = polish(model, fitted)
    orbit = periodic_orbit(model, gait)
    apart = {
        "fit_rad": residual,
        "polish_rad": float(abs(gait.alpha - fitted.alpha).max()),
        "step_time_file_s": step.time,
        "step_time_s": orbit.step_time,
    }
    files.write(out, gait_file.to_toml(model, gait, orbit, (remark,)))
    return Belief(model=model, gait=load_gait(out, model), path=out), apart


def _columns(file: Path, joints: Sequence[str], stance: str, number: int | None) -> dict[str, Vector]:
    """What a file says of one step, by name."""
    where = str(file)
    try:
        if file.suffix == ".mat":
            return frost.read_mat(file.read_bytes(), joints, stance, number, where)
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{where}: cannot be read ({str(error).splitlines()[0]})") from error
    if number is not None:
        raise UserError(f"--number {number}: only a .mat holds several gaits, and {where} is none")
    if file.suffix == ".csv":
        return imported.read_csv(text, where)
    try:
        data = json.loads(text) if file.suffix == ".json" else toml.loads(text)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{where}: neither CSV, TOML, JSON nor .mat by its name and content ({error})") from error
    if not isinstance(data, dict):
        raise UserError(f"{where}: a {type(data).__name__}; must be a table with outputs, alpha, clock, clock_range")
    return imported.sample_bezier(data, where)


def _joints(folder: WalkerFolder, maps: Mapping[str, imported.Map]) -> list[str]:
    """Names of the four joints in the order in which the robot's file has them."""
    source = conversion(folder.urdf.parent)
    text = source.text if source else folder.urdf.read_text(encoding="utf-8-sig")
    known = {maps[role].name if role in maps else role for role in imported.COORDINATES if role != "torso"}
    names = [joint.get("name", "") for joint in ElementTree.fromstring(text).iter("joint")]
    return list(dict.fromkeys(name for name in names if name in known))


def _maps(folder: WalkerFolder) -> dict[str, imported.Map]:
    """Of our coordinates onto the joints of the file a walker was made from, where there is one."""
    walker = convert.published_walker(folder.urdf.parent)
    if walker is None:
        return {}
    return {role: imported.Map(name=m.name, sign=m.sign, offset=m.ours(0.0)) for role, m in walker.coordinates.items()}
