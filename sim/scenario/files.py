"""Scenarios as TOML files: shipped ones by name, others by path."""

import contextlib
import difflib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from controller.common import toml
from controller.common.outside import inert
from sim.errors import UserError
from sim.scenario.scenario import Scenario
from sim.settings import tree as settings

SHIPPED = Path(__file__).parent / "shipped"
DEFAULT = "push-25N"


def to_toml(scenario: Scenario) -> str:
    """The whole scenario as TOML text; `from_toml` reads back an equal one."""
    return settings.to_toml(scenario)


def from_toml(source: str | Path, *, trusted: bool = True) -> Scenario:
    """A scenario from TOML.

    Args:
        source: A `Path` is read as a file, whose name is the scenario's unless it says otherwise; a `str`
            is the TOML text itself.
        trusted: Whether a controller from outside may be imported to know its settings; else they are as they stand.

    Raises:
        UserError: unreadable file, invalid TOML, unknown key, wrong type or illegal value, on one line.
    """
    where = str(source) if isinstance(source, Path) else "scenario"
    try:
        text = source.read_text(encoding="utf-8") if isinstance(source, Path) else source
        tree = toml.loads(text)
        if isinstance(source, Path):
            _check_kind(tree, source)
            tree.setdefault("name", source.stem)
        with contextlib.nullcontext() if trusted else inert():
            return settings.build(Scenario, tree)
    except OSError as error:
        raise UserError(f"{where}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise UserError(f"{where}: is not UTF-8 text (byte {error.start})") from None
    except UserError as error:
        raise UserError(f"{where}: {error}") from None
    except ValueError as error:
        raise UserError(f"{where}: is not valid TOML: {error}") from None


def kind_of(tree: Mapping[str, Any]) -> str:
    """What a TOML file is by its keys: "gait", "plan" or "scenario"."""
    if "alpha" in tree or "q_minus" in tree:
        return "gait"
    studies = ("scenario", "grid", "margin", "montecarlo", "reliability", "certificate", "controllers")
    return "plan" if any(key in tree for key in studies) else "scenario"


def _check_kind(tree: Mapping[str, Any], path: Path) -> None:
    """Tell another kind of file by what to do with it.

    Raises:
        UserError: it is no scenario.
    """
    other = {"gait": f"cmpc run --gait {path}", "plan": f"cmpc trials {path} --out DIR"}.get(kind_of(tree))
    if other:
        raise UserError(f"is a {kind_of(tree)}, must be a scenario here; {other}")


def shipped() -> dict[str, str]:
    """Names of the scenarios that come with the program, each with its description."""
    return {name: load(name).description for name in shipped_names(SHIPPED)}


def names_a_path(word: str) -> bool:
    """Whether a word is a path and no name: "/" is one on every system, whatever its own separator."""
    return word.endswith(".toml") or "/" in word or os.sep in word or word in (".", "..")


def load(name: str) -> Scenario:
    """A shipped scenario by name, or any other by the path of its .toml file.

    Raises:
        UserError: no such name (the message has the nearest and the list), or an illegal file.
    """
    if names_a_path(name):
        return from_toml(Path(name))
    return from_toml(shipped_file(name, SHIPPED, "scenario"))


def shipped_file(name: str, folder: Path, what: str) -> Path:
    """The file of a name in a folder of shipped ones.

    Raises:
        UserError: no such name; the message has the nearest and the list.
    """
    path = folder / f"{name}.toml"
    if not is_file(path):
        names = shipped_names(folder)
        near = difflib.get_close_matches(name, names, n=1, cutoff=0.4)
        guess = f"; did you mean {near[0]}?" if near else ";"
        raise UserError(f"no {what} {name!r}{guess} Shipped: {', '.join(names)}; or give a .toml file")
    return path


def shipped_names(folder: Path) -> list[str]:
    """Names of the files in a folder of shipped ones."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def is_file(path: Path) -> bool:
    """Whether there is such a file; a name that no disk can have, or a folder that is closed, is a no."""
    with contextlib.suppress(OSError, ValueError):
        return path.is_file()
    return False


def is_folder(path: Path) -> bool:
    """Whether there is such a folder, as `is_file`."""
    with contextlib.suppress(OSError, ValueError):
        return path.is_dir()
    return False
