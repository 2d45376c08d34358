"""A gait of another program's step: what its file says is read, fitted and polished."""

import json
import tomllib
from pathlib import Path

from controller.belief import WalkerModel, load_gait
from controller.design import gait_file, imported
from controller.design.orbit import periodic_orbit
from controller.design.polish import polish
from sim.bridge import convert
from sim.bridge.gaits import Belief, check_new_file
from sim.errors import UserError
from sim.walkers import WalkerFolder


def import_gait(
    walker: str, file: Path, out: Path, *, stance: str, degrees: bool, degree: int, force: bool
) -> tuple[Belief, dict[str, float]]:
    """A gait of ours from another program's step, fitted and polished; returns it and how far it is from the file.

    Args:
        walker: Name or folder.
        file: CSV of a trajectory over one step, or TOML or JSON of Bezier outputs.
        out: File to write.
        stance: "left" or "right", the foot that stands.
        degrees: Whether the file's angles are in degrees.
        degree: Of our Bezier polynomials.
        force: Whether to write over a file that is there.

    Raises:
        UserError: the file is no step, or no periodic orbit is near it.
    """
    folder = WalkerFolder.find(walker)
    model = WalkerModel(folder.urdf)
    where = str(file)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{where}: cannot be read ({str(error).splitlines()[0]})") from error
    if file.suffix == ".csv":
        columns = imported.read_csv(text, where)
    else:
        try:
            data = json.loads(text) if file.suffix == ".json" else tomllib.loads(text)
        except ValueError as error:
            raise UserError(f"{where}: neither CSV, TOML nor JSON by its name and content ({error})") from error
        if not isinstance(data, dict):
            raise UserError(
                f"{where}: a {type(data).__name__}; must be a table with outputs, alpha, clock, clock_range"
            )
        columns = imported.sample_bezier(data, where)
    step = imported.step_of(columns, _maps(folder), stance, degrees=degrees, where=where)
    remark = f"Made by: cmpc gait import {file.name} --walker {folder.name} --degree {degree}"
    check_new_file(out, remark, force=force)
    fitted, residual = imported.fit(model, step, degree, out.stem, f"imported from {file.name}", where)
    try:
        gait = polish(model, fitted)
    except ValueError as error:
        raise UserError(f"{where}: no gait of this walker is near it ({error})") from error
    orbit = periodic_orbit(model, gait)
    if not orbit.exists:
        raise UserError(f"{where}: the nearest gait of {model.path} has no periodic orbit: it stops or does not settle")
    apart = {
        "fit_rad": residual,
        "polish_rad": float(abs(gait.alpha - fitted.alpha).max()),
        "step_time_file_s": step.time,
        "step_time_s": orbit.step_time,
    }
    gait_file.write(out, gait_file.to_toml(model, gait, orbit, (remark,)))
    return Belief(model=model, gait=load_gait(out, model), path=out), apart


def _maps(folder: WalkerFolder) -> dict[str, imported.Map]:
    """Of our coordinates onto the joints of the file a walker was made from, where there is one."""
    walker = convert.published_walker(folder.urdf.parent)
    if walker is None:
        return {}
    return {role: imported.Map(name=m.name, sign=m.sign, offset=m.ours(0.0)) for role, m in walker.coordinates.items()}
