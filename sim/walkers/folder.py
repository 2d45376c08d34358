"""Where walkers and their gaits lie on disk: a folder each, with `<name>.xml`, `<name>.urdf` and `gaits/`."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sim.errors import UserError
from sim.scenario import Scenario, names_a_path
from sim.scenario.files import is_file, is_folder

PLACES = tuple(Path(__file__).resolve().parents[up] / "models" for up in (2, 1))
SHIPPED = next((place for place in PLACES if (place / "rabbit").is_dir()), PLACES[0])
"""Beside the packages in a checkout; in `sim` where they are installed, as others may have folders named so."""
DEFAULT_GAIT = Scenario().gait
MOST_NAMED = 6  # gaits that a message lists


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkerFolder:
    """Files of one walker.

    Attributes:
        name: Folder name, and stem of its model files.
        mjcf: The plant's model.
        urdf: The controller's model.
        gaits: Folder of gait files.
    """

    name: str
    mjcf: Path
    urdf: Path
    gaits: Path

    @classmethod
    def find(cls, walker: str) -> "WalkerFolder":
        """A walker by its name under `models/`, or by the path of its folder; one here needs no "./".

        Raises:
            UserError: no such folder, or a model file is missing in it.
        """
        beside = not is_folder(SHIPPED / walker) and is_file(Path(walker) / f"{Path(walker).name}.urdf")
        folder = Path(walker) if names_a_path(walker) or beside else SHIPPED / walker
        if not (walker and is_folder(folder)):
            names = sorted(p.name for p in SHIPPED.iterdir() if (p / f"{p.name}.urdf").is_file())
            raise UserError(f"walker = {walker!r}: no such folder; {_choice(walker, names)}, or the path of a folder")
        folder = folder.resolve()
        found = cls(
            name=folder.name,
            mjcf=folder / f"{folder.name}.xml",
            urdf=folder / f"{folder.name}.urdf",
            gaits=folder / "gaits",
        )
        for file in (found.mjcf, found.urdf):
            if not is_file(file):
                raise UserError(f"walker = {walker!r}: model file {file} is missing")
        return found

    @property
    def is_shipped(self) -> bool:
        """Whether it can be named by its name alone."""
        return self.urdf.parent.parent == SHIPPED

    def gait(self, gait: str) -> Path:
        """A gait file by its name in `gaits/`, or by its path.

        The default of scenarios, "paper", is RABBIT's; a walker that has none of that name walks the first of its own.

        Raises:
            UserError: no such file.
        """
        path = Path(gait) if names_a_path(gait) else self.gaits / f"{gait}.toml"
        if is_file(path):
            return path
        own = sorted(self.gaits.glob("*.toml"))
        if gait == DEFAULT_GAIT and own:
            return own[0]
        names = [p.stem for p in own]
        raise UserError(f"gait = {gait!r}: no such gait; {_choice(gait, names)}, or the path of a .toml file")


def _choice(word: str, names: Sequence[str]) -> str:
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    more = f" and {len(names) - MOST_NAMED} more" * (len(names) > MOST_NAMED)
    shown = ", ".join(map(repr, names[-MOST_NAMED:])) + more
    return f"{f'did you mean {near[0]}? ' if near else ''}must be one of {shown or 'none'}"
