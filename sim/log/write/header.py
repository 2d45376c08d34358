"""What a log says about its run before the first tick."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256

from sim.log.format.fields import LINKS
from sim.log.format.topics import FORMAT


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RunHeader:
    """Everything needed to know what ran, and to run it again.

    Attributes:
        scenario_name: Short name, such as "push-25N".
        scenario_toml: The resolved scenario as TOML text; attached as "scenario.toml".
        seed: Root seed of the run.
        versions: Package -> version.
        git_revision: Commit of this project, None outside a checkout.
        git_dirty: Whether tracked files differed from it, None outside a checkout.
        platform: Operating system, machine and Python.
        started: Wall time of the start, ISO 8601.
        machine: What may change the last bits: "cpu", "blas", "kernels".
        link_lengths: Length of each link in [m], keyed as `LINKS`.
        ground: Line of the ground through (x, z) in [m], x growing; where it jumps, two points share x.
        attachments: File name -> (media type, content), such as the MJCF, the URDF and the gait.
    """

    scenario_name: str
    scenario_toml: str
    seed: int
    versions: Mapping[str, str]
    git_revision: str | None
    git_dirty: bool | None
    platform: str
    started: str
    machine: Mapping[str, str] = field(default_factory=dict)
    link_lengths: Mapping[str, float]
    ground: Sequence[tuple[float, float]] = ((-10.0, 0.0), (100.0, 0.0))
    attachments: Mapping[str, tuple[str, bytes]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        missing = [link for link in LINKS if link not in self.link_lengths]
        if missing:
            raise ValueError(f"link_lengths lacks {missing}; each of {LINKS} needs a length in [m]")

    @property
    def headline(self) -> str:
        """One line on the run; the same for the same scenario, seed and versions."""
        versions = ", ".join(f"{name} {version}" for name, version in sorted(self.versions.items()))
        return f"scenario {self.scenario_name}, seed {self.seed} ({versions})"

    def metadata(self, period_ns: int) -> dict[str, str]:
        """The metadata record "run".

        Args:
            period_ns: Control period in [ns].
        """
        return {
            "format": str(FORMAT),
            "scenario": self.scenario_name,
            "seed": str(self.seed),
            "period_ns": str(period_ns),
            "versions": json.dumps(dict(self.versions), sort_keys=True),
            "git_revision": self.git_revision or "",
            "git_dirty": "" if self.git_dirty is None else json.dumps(self.git_dirty),
            "platform": self.platform,
            **self.machine,
            "started": self.started,
            "link_lengths": json.dumps(dict(self.link_lengths), sort_keys=True),
            "ground": json.dumps(self.ground),
            "sha256": json.dumps(
                {name: sha256(data).hexdigest() for name, (_, data) in self.all_attachments().items()},
                sort_keys=True,
            ),
        }

    def all_attachments(self) -> dict[str, tuple[str, bytes]]:
        """The scenario and every other attachment."""
        scenario = ("application/toml", self.scenario_toml.encode())
        return {"scenario.toml": scenario, **self.attachments}
