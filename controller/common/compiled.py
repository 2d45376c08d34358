"""The one module that compiles, and that knows where compiled kernels are kept.

Numba stamps a compiled function on disk with that function's own file, not with the files of what it calls: after an
edit of a callee the caller would go on running the old one. So every module's kernels are kept in a folder named by
a digest of the module, of every module of this project that it imports, and of the versions that compile them.

Common ground of both worlds: it knows nothing of a walker.
"""

import contextlib
import functools
import hashlib
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core.caching import _CacheLocator
from numpy.typing import NDArray

from controller.common.disk import KernelCache

Array = NDArray[np.float64]

CACHE_VARIABLE = "NUMBA_CACHE_DIR"
ROOT = Path(__file__).resolve().parents[2]
"""Folder of the project's packages."""

_IMPORT = re.compile(r"^\s*(?:from\s+((?:controller|sim)[\w.]*)\s+import\s+(\([^)]*\)|.*)|import\s+(.+))$", re.M)
_NAME = re.compile(r"\w+")


def compiled(function: Callable[..., Any]) -> Any:
    """Compile, keep on disk, and divide as NumPy does: a walker that falls gives inf, not an exception."""
    return _kept(function)


def inlined(function: Callable[..., Any]) -> Any:
    """The same, into the caller's body: to hand a record of arrays over takes longer than the work on it."""
    return _kept(function, forceinline=True)


def generic(function: Callable[..., Any]) -> Any:
    """`compiled`, for a kernel that takes records of modules it does not import: any source of the controller counts.

    What lies on disk names the classes of the records, those of a test or of a user's script among them; a process that
    does not have one of them compiles anew.
    """
    _GENERIC.add(function)
    return _kept(function)


_GENERIC: set[Callable[..., Any]] = set()


def on_disk(kernel: Any) -> bool:
    """Whether a kernel needs no compiling: its machine code lies in the cache for this processor."""
    folder = Path(kernel.stats.cache_path)
    return any(folder.glob(f"*.{kernel.py_func.__qualname__}-*.nbc")) if folder.is_dir() else False


@contextlib.contextmanager
def compiled_beside(module: str) -> Iterator[None]:
    """Let another process compile a module's kernels, by its `compile_kernels`, until the body has run and it is done.

    Compilation holds one lock a process; two processes use two cores. What the other one cannot do is compiled here
    when it is asked for.
    """
    if (os.cpu_count() or 1) < 2:
        yield
        return
    code = f"from {module} import compile_kernels; compile_kernels()"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])}
    quiet = subprocess.DEVNULL
    other = subprocess.Popen([sys.executable, "-c", code], env=environment, stdin=quiet, stdout=quiet, stderr=quiet)
    try:
        yield
        other.wait()
    finally:
        other.kill()
        other.wait()


def _kept(function: Callable[..., Any], forceinline: bool = False) -> Any:
    options: dict[str, Any] = {"error_model": "numpy", "forceinline": forceinline, "no_cfunc_wrapper": True}
    kernel: Any = numba.njit(**options)(function)
    with _our_locator():
        kernel._cache = KernelCache(function)
    return kernel


@contextlib.contextmanager
def _our_locator() -> Iterator[None]:
    others = numba.config.CACHE_LOCATOR_CLASSES  # type: ignore[attr-defined]
    numba.config.CACHE_LOCATOR_CLASSES = f"{__name__}.{Locator.__name__}"  # type: ignore[attr-defined]
    try:
        yield
    finally:
        numba.config.CACHE_LOCATOR_CLASSES = others  # type: ignore[attr-defined]


class Locator(_CacheLocator):
    """Tells Numba where a kernel is kept, and that whatever lies there is of these sources."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        """Args: function: the kernel; file: of its source."""
        self._line = str(function.__code__.co_firstlineno)
        self._digest = digest(Path(file), whole=function in _GENERIC)
        self._folder = cache_root() / f"{function.__module__}-{self._digest}"

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> "Locator":
        """The place of a kernel."""
        return cls(function, file)

    def get_cache_path(self) -> str:
        """Folder, which need not exist."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """What must be equal for a kernel on disk to be used."""
        return self._digest

    def get_disambiguator(self) -> str:
        """Tells functions of one name apart."""
        return self._line


@functools.cache
def cache_root() -> Path:
    """Where kernels are kept: `NUMBA_CACHE_DIR`, or beside this file, or in the user's cache, or for this run alone."""
    if chosen := os.environ.get(CACHE_VARIABLE):
        return Path(chosen)
    user = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    for folder in (Path(__file__).resolve().parent / "__pycache__" / "kernels", user / "cmpc-walker"):
        if _writable(folder):
            return folder
    temporary = tempfile.TemporaryDirectory(prefix="cmpc-kernels-")
    _TEMPORARY.append(temporary)
    os.environ[CACHE_VARIABLE] = temporary.name  # for worker processes
    print(
        f"cmpc: compiled kernels are kept for this run alone; set {CACHE_VARIABLE} to a writable folder to keep them",
        file=sys.stderr,
    )
    return Path(temporary.name)


_TEMPORARY: list[Any] = []
"""Removed when the process ends."""


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@functools.cache
def digest(file: Path, whole: bool = False) -> str:
    """Digest of a module's source, of the project's modules it imports, directly or not, and of the compilers.

    Args:
        file: Of the module.
        whole: Whether all sources of the controller count beside it.
    """
    state = hashlib.blake2b(digest_size=8)
    state.update(repr((sys.version_info[:2], numba.__version__, llvmlite.__version__, np.__version__)).encode())
    for source in sorted(_closure(file).union((ROOT / "controller").rglob("*.py") if whole else ())):
        state.update(_text(source).encode())
    return state.hexdigest()


def _closure(file: Path) -> set[Path]:
    """The file and every file of this project that it imports, directly or not."""
    reached, waiting = {file}, [file]
    while waiting:
        for source in _imports(waiting.pop()) - reached:
            reached.add(source)
            waiting.append(source)
    return reached


@functools.cache
def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8")


@functools.cache
def _imports(file: Path) -> frozenset[Path]:
    """Files of the modules of this project named in a file's import statements."""
    found = set()
    for package, names, plain in _IMPORT.findall(_text(file)):
        dotted = [package, *(f"{package}.{name}" for name in _NAME.findall(names))] if package else plain.split(",")
        for name in dotted:
            path = ROOT.joinpath(*name.split(" as ")[0].strip().split("."))
            found |= {source for source in (path.with_suffix(".py"), path / "__init__.py") if source.is_file()}
    return frozenset(found)
