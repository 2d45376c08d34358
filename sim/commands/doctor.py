"""`cmpc doctor`: what is installed, what is missing, and what the machine can do."""

import importlib.metadata
import importlib.util
import json
import os
import platform
import re
import shutil
import sys
import tempfile
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from sim.commands.options import add_json
from sim.terminal import console

NAME = "cmpc-walker"
PROJECT_PYTHON = ((3, 11), (3, 15))


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One line.

    Attributes:
        what: What was looked at.
        found: What was found.
        well: Whether it is as it should be; None for what is optional and missing, or only told.
        hint: What to do about it.
    """

    what: str
    found: str
    well: bool | None = True
    hint: str = ""


def add_parser(commands: Any, argv: Sequence[str]) -> None:
    """Add the parser of `cmpc doctor`."""
    parser = commands.add_parser(
        "doctor", description=__doc__, epilog="exit code: 0 nothing that is needed is missing, 1 something is"
    )
    add_json(parser, "the findings")
    parser.set_defaults(run=_run)


def _run(found: Namespace) -> int:
    findings = list(examine())
    if found.json:
        print(json.dumps([asdict(finding) for finding in findings]))
    else:
        from rich.markup import escape

        table = console.table("", "found", " ", "what to do")
        for one in findings:
            verdict = {True: "ok", False: "MISSING", None: "-"}[one.well]
            table.add_row(*map(escape, (one.what, one.found, verdict, one.hint)))
        console.show(table)
    return 0 if all(finding.well is not False for finding in findings) else 1


def examine() -> Iterator[Finding]:
    """Look at everything, cheap things first."""
    version = sys.version_info[:2]
    yield Finding(
        what="Python",
        found=f"{platform.python_version()}, {sys.executable}",
        well=PROJECT_PYTHON[0] <= version < PROJECT_PYTHON[1],
        hint="" if PROJECT_PYTHON[0] <= version < PROJECT_PYTHON[1] else "must be 3.11 to 3.14",
    )
    yield Finding(what="machine", found=f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores")
    yield from _packages()
    yield from _names()
    yield from _numerics()
    yield from _places()
    yield from _pictures()


def _packages() -> Iterator[Finding]:
    """What the program needs, then what each extra would need."""
    wanted: dict[str, list[str]] = {"": []}
    try:
        lines = importlib.metadata.requires(NAME) or []
        ours = importlib.metadata.version(NAME)
    except importlib.metadata.PackageNotFoundError:
        yield Finding(what=NAME, found="not installed", well=False, hint="pip install .")
        return
    for line in lines:
        name = re.match(r"[\w.-]+", line)
        part = re.search(r"extra == ['\"]([\w-]+)['\"]", line)
        wanted.setdefault(part[1] if part else "", []).append(name[0] if name else line)
    missing = [name for name in wanted.pop("") if not _version(name)]
    told = ", ".join(f"{name} {_version(name)}" for name in ("mujoco", "numpy", "numba", "pin") if _version(name))
    hint = f"pip install {' '.join(missing)}" if missing else ""
    yield Finding(
        what=f"{NAME} {ours}", found=f"without {', '.join(missing)}" if missing else told, well=not missing, hint=hint
    )
    for extra, names in sorted(wanted.items()):
        missing = [name for name in names if not _version(name) and name != NAME]
        hint = f"pip install '{NAME}[{extra}]'" if missing else ""
        found = f"without {', '.join(missing)}" if missing else ", ".join(n for n in names if n != NAME)
        yield Finding(what=f"extra {extra}", found=found, well=None if missing else True, hint=hint)


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _names() -> Iterator[Finding]:
    """Files of the user's own that would be imported in place of ours."""
    root = Path(__file__).resolve().parents[2]
    for name in ("sim", "controller"):
        spec = importlib.util.find_spec(name)
        place = Path(spec.origin).resolve().parent.parent if spec and spec.origin else None
        here = [Path(f"{name}.py"), Path(name) / "__init__.py"]
        hides = next((path for path in here if path.is_file() and Path.cwd() != root), None)
        well = place == root and hides is None
        yield Finding(
            what=f"import {name}",
            found=str(hides.resolve() if hides else place),
            well=True if well else None if place == root else False,
            hint="" if well else "python started here would import this; write import cmpc first, or rename it",
        )


def _numerics() -> Iterator[Finding]:
    """BLAS and the kernels on disk."""
    from sim.log.provenance import machine

    about = machine()
    yield Finding(what="processor", found=about["cpu"])
    yield Finding(what="BLAS", found=about["blas"] or "none found")
    from sim.bridge.kernels import kernels

    folder, ready = kernels()
    yield Finding(
        what="kernels on disk",
        found=f"{'ready' if ready else 'not compiled yet'}, {folder}",
        well=True if ready else None,
        hint="" if ready else "the first run compiles them, once",
    )


def _places() -> Iterator[Finding]:
    """Where something is written."""
    for what, folder in (("this folder", Path.cwd()), ("temporary files", Path(tempfile.gettempdir()))):
        try:
            with tempfile.TemporaryFile(dir=folder):
                pass
            free = shutil.disk_usage(folder).free / 1e9
            well, hint = free > 0.1, "" if free > 0.1 else "little room is left"
            yield Finding(what=what, found=f"{folder}, {free:.1f} GB free", well=well, hint=hint)
        except OSError as error:
            yield Finding(what=what, found=f"{folder}: {error.strerror}", well=False, hint="choose another folder")


def _pictures() -> Iterator[Finding]:
    """A display for the viewer, an OpenGL without one for films."""
    from ctypes.util import find_library

    display = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
    shown = display or ("of the system" if sys.platform in ("darwin", "win32") else "")
    hint = "" if shown else "cmpc run --viewer needs one; cmpc review and cmpc video need none"
    yield Finding(what="display", found=shown or "none", well=True if shown else None, hint=hint)
    libraries = [name for name in ("EGL", "OSMesa") if find_library(name)]
    offscreen = ", ".join(libraries) or ("of the system" if sys.platform in ("darwin", "win32") else "")
    hint = "" if offscreen else "cmpc video needs one (on Debian: libegl1 libgl1-mesa-dri)"
    yield Finding(what="OpenGL without display", found=offscreen or "none", well=True if offscreen else None, hint=hint)
