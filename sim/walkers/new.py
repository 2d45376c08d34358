"""Write the folder of a new walker: its URDF, the MJCF that agrees with it, a README to fill in."""

import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from string import Template

from sim.errors import UserError

TEMPLATES = Path(__file__).parent
NAME = re.compile(r"[a-z][a-z0-9_-]*")
TIBIA_BARE = 0.015  # [m] of the tibia's end is left to the foot in the picture
TOE = 0.012  # [m] from the tip to the middle of the drawn toe
TORSO_LENGTH = 2.6  # times its centre of mass: how long the torso is drawn
OUT_OF_PLANE = 0.04  # izz by iyy; without effect in the plane

README = """\
# $name

| file | what it is | read by |
|---|---|---|
| `$name.urdf` | the controller's belief: links, joints, effort limits | `controller/` |
| `$name.xml` | the plant: MJCF, contact, motors, sensors | `sim/` |
| `gaits/` | gaits, made by `cmpc gait design --walker $walker` | both |

Conventions (axes, order of coordinates, contact settings) are those of `models/rabbit`.
Where the numbers come from: say it here.

`cmpc walker check $walker` says how far the two models agree, judges every gait, and lets the walker walk.
"""


def create(folder: Path, urdf: Path, numbers: Mapping[str, float]) -> None:
    """Make the folder.

    Args:
        folder: Must not exist; its name is the walker's.
        urdf: Copied into it.
        numbers: Of the template: masses [kg], lengths and centres of mass [m], inertias [kg m^2], limits [N.m],
            damping [N.m.s/rad].

    Raises:
        UserError: the folder exists, its name is not legal, or it can not be written.
    """
    name = folder.name
    if not NAME.fullmatch(name):
        raise UserError(f"walker {name!r}: legal: a folder name of a-z, 0-9, _ and -, beginning with a letter")
    if folder.exists():
        raise UserError(f"{folder}: already exists and is never overwritten; choose another folder")
    fields = {key: f"{value:.12g}" for key, value in numbers.items()}
    for link in ("torso", "femur", "tibia"):
        fields[f"{link}_izz"] = f"{OUT_OF_PLANE * numbers[f'{link}_inertia']:.6g}"
    fields["torso_length"] = f"{TORSO_LENGTH * numbers['torso_com']:.4g}"
    fields["shaft_length"] = f"{numbers['tibia_length'] - TIBIA_BARE:.6g}"
    fields["toe"] = f"{numbers['tibia_length'] - TOE:.6g}"
    try:
        (folder / "gaits").mkdir(parents=True)
        shutil.copyfile(urdf, folder / f"{name}.urdf")
        mjcf = Template((TEMPLATES / "template.xml").read_text(encoding="utf-8")).substitute(fields, name=name)
        (folder / f"{name}.xml").write_text(mjcf, encoding="utf-8")
        text = Template(README).substitute(name=name, walker=folder)
        (folder / "README.md").write_text(text, encoding="utf-8")
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror}") from error
