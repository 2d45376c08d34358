"""`python -m cmpc` is the program, and `import cmpc` is `import sim` that nothing of the user's can hide.

Installed as `cmpc.py`, a name that nobody else has. The packages behind it, `sim` and `controller`, have names that a
user's own folder may have too: a `sim.py` beside a script is imported in place of ours. This module looks for ours
where it was installed itself, and says so where another one has been imported already.
"""

import importlib
import sys
from pathlib import Path

__all__ = ["entry_point"]


def _packages() -> str:
    """The folder of our packages: the first place of the path that has all of them."""
    for place in sys.path:
        folder = Path(place or ".")
        if (folder / "sim" / "cli.py").is_file() and (folder / "controller" / "facade.py").is_file():
            return str(folder.resolve())
    raise ImportError("the packages sim and controller of cmpc-walker are not installed; pip install cmpc-walker")


def _import() -> None:
    """Import our packages from their own folder, whatever else has their names."""
    folder = _packages()
    for name in ("controller", "sim"):
        there = sys.modules.get(name)
        if there is not None and Path(str(there.__file__)).resolve().parents[1] != Path(folder):
            raise ImportError(
                f"{there.__file__} hides the package {name} of cmpc-walker: import cmpc before it, or rename it"
            )
    sys.path.insert(0, folder)
    try:
        for name in ("controller", "sim"):
            importlib.import_module(name)
    finally:
        sys.path.remove(folder)


def entry_point() -> None:
    """Console script `cmpc`."""
    from sim.cli import entry_point as program

    program()


try:
    _import()
except KeyboardInterrupt:
    if Path(sys.argv[0]).stem != "cmpc":  # a user's program, which has its own way to stop
        raise
    print("cmpc: interrupted", file=sys.stderr)
    sys.exit(130)


def __getattr__(name: str) -> object:
    if name.startswith("__"):
        raise AttributeError(name)
    return getattr(sys.modules["sim"], name)


def __dir__() -> list[str]:
    return dir(sys.modules["sim"])


if __name__ == "__main__":
    entry_point()
