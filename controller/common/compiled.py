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
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba import types
from numba.core.caching import _CacheLocator
from numba.core.registry import CPUDispatcher
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


def nested(function: Callable[..., Any]) -> Any:
    """The same for a kernel that kernels call: half the work of compiling it is what Python needs to call it.

    Python may call it, too; that is compiled when it does, as a kernel around this one.
    """
    return _nested(function)


def inlined(function: Callable[..., Any]) -> Any:
    """`nested`, into the caller's body: to hand a record of arrays over takes longer than the work on it."""
    return _nested(function, forceinline=True)


def spliced(function: Callable[..., Any]) -> Any:
    """`nested`, compiled as a piece of its caller's source: for a long one that has one caller."""
    return _nested(function, inline="always")


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


def compile_for(kernel: Any, *arguments: Any) -> None:
    """Compile a kernel for arguments like these, as another kernel would call it, without calling it."""
    kernel.compile(tuple(kernel.typeof_pyval(argument) for argument in arguments))


_OPTIONS: dict[str, Any] = {"nopython": True, "boundscheck": None, "error_model": "numpy", "no_cfunc_wrapper": True}


def _kept(function: Callable[..., Any]) -> Any:
    return _cached(Kernel(function, targetoptions=dict(_OPTIONS)))


def _nested(function: Callable[..., Any], **options: Any) -> Any:
    return _cached(Nested(function, targetoptions=_OPTIONS | options | {"no_cpython_wrapper": True}))


def _cached(kernel: Any) -> Any:
    with _our_locator():
        kernel._cache = KernelCache(kernel.py_func)
    return kernel


class Kernel(CPUDispatcher):
    """Compiled once for all numbers of a type, where Numba compiles anew for every constant that it is called with."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What another kernel calls."""
        named = {name: types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template(tuple(map(types.unliteral, args)), named)


class Nested(Kernel):
    """A kernel that Python cannot call; where it does, it calls one made around this one."""

    _caller: Any = None

    def add_overload(self, cres: Any) -> None:
        """Keep what has been compiled for other kernels, and only for them."""
        self.overloads[tuple(cres.signature.args)] = cres

    def _compile_for_args(self, *arguments: Any, **named: Any) -> Any:
        """What Python calls in place of this kernel."""
        if self._caller is None:
            self._caller = _kept(_around(self))
        entry = self._caller._compile_for_args(*arguments, **named)
        if not named:
            kernel: Any = self
            kernel._insert([kernel.typeof_pyval(argument)._code for argument in arguments], entry, False)
        return entry


def _around(kernel: Any) -> Callable[..., Any]:
    """A function that calls a kernel, from the same place."""
    code, name = kernel.py_func.__code__, f"call_{kernel.py_func.__name__}"
    arguments = ", ".join(code.co_varnames[: code.co_argcount])
    text = "\n" * (code.co_firstlineno - 1) + f"def {name}({arguments}): return kernel({arguments})"
    scope: dict[str, Any] = {"kernel": kernel, "__name__": kernel.py_func.__module__}
    exec(compile(text, code.co_filename, "exec"), scope)
    function: Callable[..., Any] = scope[name]
    return function


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
