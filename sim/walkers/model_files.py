"""Model files of one run."""

import json
from dataclasses import dataclass
from pathlib import Path

from sim.scenario import Scenario
from sim.walkers.folder import WalkerFolder

LIBRARY = "gait-library.json"
"""Attachment with the gait library; only runs that follow other gaits than their own have it."""


LAW = "controller.py"
"""Attachment with the file of a controller from outside."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFiles:
    """Files a run is made from.

    Attributes:
        mjcf: The plant's model.
        urdf: The controller's model.
        gait: The gait.
        library: Folder of the gait library, in which a controller that fits its gait looks for others.
    """

    mjcf: Path
    urdf: Path
    gait: Path
    library: Path

    @classmethod
    def of(cls, scenario: Scenario) -> "ModelFiles":
        """The files a scenario names.

        Raises:
            UserError: one of them does not exist.
        """
        return cls.named(scenario.walker, scenario.gait)

    @classmethod
    def named(cls, walker: str, gait: str) -> "ModelFiles":
        """The files of a walker and a gait, as a scenario names them.

        Raises:
            UserError: one of them does not exist.
        """
        folder = WalkerFolder.find(walker)
        return cls(mjcf=folder.mjcf, urdf=folder.urdf, gait=folder.gait(gait), library=folder.gaits)

    @property
    def read(self) -> tuple[Path, ...]:
        """Every file that may decide a run: the three, and the gaits of the library."""
        library = sorted(self.library.glob("*.toml"))
        return (self.mjcf, self.urdf, self.gait, *(path for path in library if path != self.gait))


def library_json(folder: Path) -> bytes:
    """All gait files of a folder as one attachment: their names and texts."""
    return json.dumps({path.name: path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.toml"))}).encode()
