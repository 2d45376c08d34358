"""Where walkers and their gaits lie on disk: a folder each, with `<name>.xml`, `<name>.urdf` and `gaits/`."""

import os
from dataclasses import dataclass
from pathlib import Path

from sim.errors import UserError

SHIPPED = Path(__file__).resolve().parents[2] / "models"
"""Beside this package in a checkout and in an installation alike."""


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
        """A walker by its name under `models/`, or by the path of its folder.

        Raises:
            UserError: no such folder, or a model file is missing in it.
        """
        is_path = os.sep in walker or walker in (".", "..")
        folder = (Path(walker) if is_path else SHIPPED / walker).resolve()
        if not folder.is_dir():
            names = sorted(p.name for p in SHIPPED.iterdir() if (p / f"{p.name}.urdf").is_file())
            raise UserError(f"walker = {walker!r}: no such folder; legal: one of {names}, or the path of a folder")
        found = cls(
            name=folder.name,
            mjcf=folder / f"{folder.name}.xml",
            urdf=folder / f"{folder.name}.urdf",
            gaits=folder / "gaits",
        )
        for file in (found.mjcf, found.urdf):
            if not file.is_file():
                raise UserError(f"walker = {walker!r}: model file {file} is missing")
        return found

    @property
    def is_shipped(self) -> bool:
        """Whether it can be named by its name alone."""
        return self.urdf.parent.parent == SHIPPED

    def gait(self, gait: str) -> Path:
        """A gait file by its name in `gaits/`, or by its path.

        Raises:
            UserError: no such file.
        """
        path = Path(gait) if gait.endswith(".toml") or os.sep in gait else self.gaits / f"{gait}.toml"
        if not path.is_file():
            names = sorted(p.stem for p in self.gaits.glob("*.toml"))
            raise UserError(f"gait = {gait!r}: no such gait; legal: one of {names}, or the path of a .toml file")
        return path
