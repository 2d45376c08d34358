"""Controllers from outside this project, by name: `package.module:make`, `./mine.py:make`, or an installed entry point.

A factory takes what it asks for by the names of its parameters and gives a controller; see docs/own-controller.md. A
dataclass among its parameters is its settings. Common ground: scenario files, flags and the laws look here.

To know a controller's settings its code has to be imported. A log is data that nobody has to trust, so its scenario is
read `inert`: the settings are what stands there, and no code runs.
"""

import contextlib
import dataclasses
import functools
import hashlib
import importlib
import importlib.metadata
import importlib.util
import inspect
import os
import re
import sys
import types
import typing
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controller.common.errors import UserError

GROUP = "cmpc.controllers"
"""Entry-point group under which a package offers controllers."""

FACTORY = "make"
"""Name of the factory where none is given."""

LEGAL = "MODULE:FACTORY, FILE.py:FACTORY, or an installed controller's name"

_INERT: ContextVar[bool] = ContextVar("inert", default=False)
_GIVEN: dict[str, Any] = {}
"""Factories given from Python, by the kind they go by in this process."""
_SENT: dict[str, bytes] = {}
"""Text of a file by its kind, where another process sent it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outside:
    """A controller from outside.

    Attributes:
        kind: The name it was asked for by.
        factory: Makes it.
        settings: Its settings class, None if it takes none.
        taken: Name of the factory's parameter that takes them.
        file: The file its factory stands in, None if unknown.
        text: That file, empty if unknown.
    """

    kind: str
    factory: Callable[..., Any]
    settings: type | None
    taken: str
    file: Path | None
    text: bytes

    @property
    def digest(self) -> str:
        """SHA-256 of the file as hexadecimal digits, empty if unknown."""
        return hashlib.sha256(self.text).hexdigest() if self.text else ""


@contextlib.contextmanager
def inert() -> Iterator[None]:
    """Read scenarios without importing the controllers they name."""
    token = _INERT.set(True)
    try:
        yield
    finally:
        _INERT.reset(token)


def is_inert() -> bool:
    """Whether code must not be imported now."""
    return _INERT.get()


def is_named(kind: str) -> bool:
    """Whether a word names a controller from outside: by its form, or as an installed one."""
    return ":" in kind or kind.endswith(".py") or kind in _entry_points()


def file_label(kind: str) -> str:
    """The kind as a part of a file's name: "mine-make" of "./mine.py:make"."""
    return re.sub(r"[^\w.]+", "-", kind.replace(".py:", ":").replace("./", "")).strip(".-") or "controller"


def give(factory: Any) -> str:
    """Let a factory or a controller of this process be asked for; returns the kind it goes by.

    Args:
        factory: A function or class that makes a controller, or a controller itself.
    """
    if hasattr(factory, "step") and not isinstance(factory, type):
        kind, made = f"python:{type(factory).__qualname__}", factory
        _GIVEN[kind] = lambda: made
        return kind
    module, name = getattr(factory, "__module__", ""), getattr(factory, "__qualname__", type(factory).__qualname__)
    if module not in ("", "__main__") and _attribute(sys.modules.get(module), name) is factory:
        return f"{module}:{name}"
    kind = f"python:{name}"
    _GIVEN[kind] = factory
    return kind


def find(kind: str) -> Outside:
    """A controller by its name; its code is imported.

    Raises:
        UserError: there is none, or its code cannot be imported; one line with file and line.
    """
    try:
        return _given(kind) if kind in _GIVEN else _found(kind)
    except UserError as error:
        raise UserError(f"controller {kind}: {error}") from error


def source_of(kind: str) -> tuple[Path | None, bytes]:
    """The file of a controller and its content, without running it; (None, b"") where it cannot be told."""
    if kind in _GIVEN:
        return _file_of(_GIVEN[kind])
    try:
        where, _ = _split(kind)
    except UserError:
        return None, b""
    path = _file(where)
    if kind in _SENT:
        return path, _SENT[kind]
    if not where.endswith(".py"):
        with contextlib.suppress(Exception):  # a missing package, or one that fails
            spec = importlib.util.find_spec(where)
            path = Path(spec.origin) if spec and spec.origin else path
    return (path, path.read_bytes()) if path.is_file() else (None, b"")


def remember(kind: str, text: bytes) -> None:
    """Use this text for a controller's file, whatever stands on this machine's disk."""
    if text:
        _SENT[kind] = text


def call(outside: Outside, offers: Mapping[str, Any], settings: Any) -> Any:
    """Make a controller.

    Args:
        outside: Which.
        offers: What a factory may ask for by the names of its parameters.
        settings: Its settings.

    Raises:
        UserError: the factory asks for something else, or fails; one line with file and line.
    """
    wanted = {}
    for name, parameter in _parameters(outside.factory).items():
        if name == outside.taken and settings is not None:
            wanted[name] = settings
        elif name in offers:
            wanted[name] = offers[name]
        elif parameter.default is parameter.empty:
            raise UserError(
                f"controller {outside.kind}: its factory asks for {name!r}; must be of {', '.join(offers)}, "
                "or a dataclass for its settings"
            )
    try:
        return outside.factory(**wanted)
    except (Exception, SystemExit) as error:
        raise UserError(f"controller {outside.kind}: {place(error, outside.file)}") from error


def asks_for(outside: Outside, name: str) -> bool:
    """Whether a factory has a parameter of that name that is not its settings."""
    return name in _parameters(outside.factory) and name != outside.taken


def place(error: BaseException, file: Path | None, called: str = "") -> str:
    """What went wrong and where, in one line.

    Args:
        error: What was raised.
        file: The controller's own, whose deepest line is meant.
        called: What stands for the place if nothing of that file was reached; else the deepest line of all.
    """
    if isinstance(error, SyntaxError):
        number = f", line {error.lineno}" if error.lineno else ""
        return f"{type(error).__name__}: {error.msg} ({error.filename or file}{number})"
    frames = []
    trace = error.__traceback__
    while trace is not None:
        frames.append((trace.tb_frame.f_code.co_filename, trace.tb_lineno))
        trace = trace.tb_next
    own = [frame for frame in frames if file is not None and frame[0] == str(file)]
    name, line = (own or frames or [("?", 0)])[-1]
    text = " ".join(str(error).split())
    at = called if called and not own and file is not None else f" ({name}, line {line})"
    return f"{type(error).__name__}{': ' if text else ''}{text}{at}"


def _split(kind: str) -> tuple[str, str]:
    """Module or file, and the name in it."""
    if kind.endswith(".py"):
        return kind, FACTORY
    if ":" not in kind:
        point = _entry_points().get(kind)
        if point is None:
            raise UserError(f"no such controller; must be {LEGAL}")
        kind = point
    where, _, name = kind.rpartition(":")
    if not where.endswith(".py") and (not where or where.startswith(".")):
        raise UserError(f"names no module; must be {LEGAL}")
    return where, name or FACTORY


@functools.cache
def _entry_points() -> dict[str, str]:
    """Installed controllers: name -> MODULE:FACTORY."""
    return {point.name: point.value for point in importlib.metadata.entry_points(group=GROUP)}


def _given(kind: str) -> Outside:
    file, text = _file_of(_GIVEN[kind])
    return _outside(kind, _GIVEN[kind], file, text)


def _found(kind: str) -> Outside:
    where, name = _split(kind)
    if where == "python":
        raise UserError("was given from Python in another process and is not here; give it again, or name its file")
    if where.endswith(".py"):
        file = _file(where)
        text = _SENT.get(kind) or _read(file)
        return _of(kind, _run(str(file), text), name, file, text)
    module = _import(where)
    origin = Path(getattr(module, "__file__", None) or "")
    text = origin.read_bytes() if origin.is_file() else b""
    if text and _SENT.get(kind, text) != text:
        raise UserError(f"{origin}: is another version than the one this campaign began with")
    return _of(kind, module, name, origin if text else None, text)


def _of(kind: str, module: Any, name: str, file: Path | None, text: bytes) -> Outside:
    factory = _attribute(module, name)
    if factory is not None and not callable(factory):
        raise UserError(f"{file or module.__name__}: {name} is no factory: it is {factory!r:.40}, and cannot be called")
    if factory is None:
        there = [key for key, value in vars(module).items() if callable(value) and not key.startswith("_")]
        own = [key for key in there if getattr(vars(module)[key], "__module__", "") == module.__name__]
        raise UserError(f"{file or module.__name__}: has no factory {name!r}; it has {', '.join(own) or 'none'}")
    return _outside(kind, factory, file, text)


def _outside(kind: str, factory: Any, file: Path | None, text: bytes) -> Outside:
    if inspect.iscoroutinefunction(factory):
        raise UserError(f"its factory {factory.__qualname__} is async; must be a plain one that returns a controller")
    taken, settings = _settings_of(factory)
    for field in dataclasses.fields(settings) if settings is not None else ():
        if field.default is field.default_factory is dataclasses.MISSING:
            raise UserError(
                f"its settings {getattr(settings, '__qualname__', '')}: field {field.name}: must have a default"
            )
    return Outside(kind=kind, factory=factory, settings=settings, taken=taken, file=file, text=text)


def _file(where: str) -> Path:
    return Path(os.path.expanduser(where)).resolve()  # which leaves the home of nobody as it is


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise UserError(f"{file}: cannot be read: {error.strerror}") from error


@functools.lru_cache(maxsize=32)
def _run(file: str, text: bytes) -> types.ModuleType:
    """The module of a file, once for each content of it; its folder is where it finds its neighbours."""
    name = f"{Path(file).stem}_{hashlib.sha256(text).hexdigest()[:12]}"
    module = types.ModuleType(name)
    module.__file__ = file
    sys.modules[name] = module
    _look_in(str(Path(file).parent))
    try:
        with contextlib.redirect_stdout(sys.stderr):  # stdout is for results
            exec(compile(text, file, "exec"), module.__dict__)
    except Exception as error:
        del sys.modules[name]
        raise UserError(place(error, Path(file))) from error
    except SystemExit:
        del sys.modules[name]
        raise UserError(f"{file}: ends the program when imported") from None
    return module


def _import(name: str) -> types.ModuleType:
    _look_in(os.getcwd())
    try:
        with contextlib.redirect_stdout(sys.stderr):
            return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise UserError(f"no module {error.name!r}; must be {LEGAL}") from error
    except Exception as error:
        raise UserError(place(error, None)) from error
    except SystemExit:
        raise UserError(f"module {name}: ends the program when imported") from None


def _look_in(folder: str) -> None:
    if folder not in sys.path and "" not in sys.path:
        sys.path.append(folder)


def _attribute(module: Any, name: str) -> Any:
    for part in name.split("."):
        module = getattr(module, part, None)
    return module


def _file_of(factory: Any) -> tuple[Path | None, bytes]:
    with contextlib.suppress(TypeError, OSError):
        file = Path(inspect.getsourcefile(inspect.unwrap(factory)) or "")
        return file, file.read_bytes()
    return None, b""


def _parameters(factory: Any) -> Mapping[str, inspect.Parameter]:
    """Parameters that can be given by name; those of "*rest" and "**rest" are left alone."""
    try:
        found = inspect.signature(factory).parameters
    except (TypeError, ValueError):
        return {}
    rest = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return {name: parameter for name, parameter in found.items() if parameter.kind not in rest}


def _settings_of(factory: Any) -> tuple[str, type | None]:
    """The parameter that takes a factory's settings, and their dataclass, by its annotation or its default."""
    target = vars(factory).get("__init__") if isinstance(factory, type) else factory
    try:
        hints = typing.get_type_hints(target) if target else {}
    except Exception:  # a name that exists for type checkers alone
        hints = {}
    for name, parameter in _parameters(factory).items():
        for found in (hints.get(name), type(parameter.default)):
            own = isinstance(found, type) and dataclasses.is_dataclass(found) and name not in ("model", "gait")
            if own and (name == "settings" or not str(found.__module__).startswith("controller.")):
                return name, found
    return "", None
