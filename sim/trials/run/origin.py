"""What a trial ran with: versions, sources, the files it read, the machine. Results of different origin do not mix."""

import functools
import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from controller.common import outside
from controller.common.settings import BUILT_IN
from sim.log import provenance
from sim.scenario import Scenario
from sim.walkers import ModelFiles

ROOT = Path(__file__).resolve().parents[3]
SOURCES = ("controller", "sim/bridge", "sim/loop", "sim/plant", "sim/scenario", "sim/trials/falls", "sim/walkers")
"""Folders whose modules can change what a trial finds."""


def origin(scenario: Scenario, controller: str) -> str:
    """What a trial of a scenario with a kind of controller runs with, as JSON.

    Args:
        scenario: The plan's; its walker and gait are meant.
        controller: Its kind; of one from outside, its file counts too.
    """
    return json.dumps(_facts(scenario, controller), sort_keys=True)


def _facts(scenario: Scenario, controller: str) -> dict[str, Any]:
    try:
        files = _files(scenario)
        if controller not in BUILT_IN:
            file, text = outside.source_of(controller)
            files[file.name if file else controller] = hashlib.sha256(text).hexdigest()[:16]
    except (ValueError, OSError):  # every trial will say what is missing
        files = {}
    return {
        "versions": provenance.package_versions(),
        "sources": _sources(),
        "platform": provenance.platform_name(),
        "files": files,
    }


def _files(scenario: Scenario) -> dict[str, str]:
    """Digests of the files a scenario reads, by names that hold wherever its walker and the program stand."""
    files = ModelFiles.of(scenario)
    home = files.mjcf.parent
    fits = scenario.controller.gait_fitting.enabled
    read = [*(files.read if fits else (files.mjcf, files.urdf, files.gait)), *_included(files.mjcf)]

    def name(path: Path) -> str:
        return path.relative_to(home.parent).as_posix() if path.is_relative_to(home) else path.name

    return {name(path): _digest(path) for path in read}


def _included(model: Path) -> Iterable[Path]:
    """Files that a model names and that lie beside it, such as meshes."""
    for name in sorted(set(re.findall(r'\bfile="([^"]+)"', model.read_text(encoding="utf-8", errors="replace")))):
        path = next((p for p in (model.parent / name, model.parent / "meshes" / name) if p.is_file()), None)
        if path:
            yield path


def _digest(path: Path) -> str:
    stat = path.stat()
    return _digest_of(str(path), stat.st_mtime_ns, stat.st_size, stat.st_ino)


@functools.lru_cache(maxsize=256)
def _digest_of(path: str, *stamp: int) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]


@functools.cache
def _sources() -> str:
    digest = hashlib.sha256()
    for folder in SOURCES:
        for file in sorted((ROOT / folder).rglob("*.py")):
            digest.update(file.relative_to(ROOT).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


def origin_key(text: str) -> str:
    """Short name of an origin."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def origin_differences(there: str, here: str, *, machine: bool = True) -> list[str]:
    """How two origins differ, in words.

    Args:
        there: Of the results there are.
        here: Of those to come.
        machine: Whether a difference of the machine counts.
    """
    old, new = _flat(json.loads(there)), _flat(json.loads(here))
    return [
        f"{name} {old.get(name, 'absent')} -> {new.get(name, 'absent')}"
        for name in sorted(old.keys() | new.keys())
        if old.get(name) != new.get(name) and (machine or name != "platform")
    ]


def _flat(facts: Mapping[str, Any]) -> dict[str, str]:
    files = {f"file {name}:": digest for name, digest in facts["files"].items()}
    return {**facts["versions"], **files, "sources": facts["sources"], "platform": facts["platform"]}
