"""What a log that nobody has to trust brings along to be run again: its scenario and model files."""

import contextlib
import json
import re
import tempfile
import xml.parsers.expat
from collections.abc import Iterator, Mapping
from hashlib import sha256
from pathlib import Path

from controller.common import outside
from controller.common.settings import BUILT_IN
from sim.errors import UserError
from sim.log.read.log import Log
from sim.scenario import Scenario, from_toml
from sim.walkers import ModelFiles
from sim.walkers.model_files import LAW, LIBRARY

LONGEST_HORIZON = 2000  # stages; the horizon of a log from elsewhere could ask for any amount of memory
MOST_SUBSTEPS = 1000
LARGEST_MODEL = 4 * 2**20  # [B]; ours have 6 kB
LARGEST_IMAGE = 8192  # [pixel]
_LIBRARY_FILE = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,80}\.toml")
_IMAGE = ("width", "height", "offwidth", "offheight", "shadowsize")
LONGEST_NAME = 200  # [B] of an attached file
DEEPEST = 100  # levels of nested XML elements
_OUTSIDE = ("file", "dir", "url", "path")
"""An attribute whose name contains one of these reaches out of the model, to a mesh, a texture or another model."""
_FORBIDDEN = frozenset(
    (
        "include",
        "attach",
        "plugin",
        "extension",
        "replicate",
        "composite",
        "flexcomp",
        "mesh",
        "hfield",
        "skin",
        "size",
    )
)
"""Elements a walker does not need, that read other files or ask for any amount of memory."""


def scenario_of(log: Log) -> Scenario:
    """The scenario of a log.

    Raises:
        UserError: it is missing, not legal, or asks for more than a run from elsewhere may.
    """
    if "scenario.toml" not in log.attachments:
        raise UserError(f"{log.path} has no attachment scenario.toml: it cannot be run again")
    try:
        text = log.attachments["scenario.toml"][1].decode("utf-8")
        scenario = from_toml(text, trusted=False)
        if scenario.controller.kind not in BUILT_IN:
            _check_controller(log, scenario.controller.kind)
            scenario = from_toml(text)
    except UnicodeDecodeError:
        raise UserError(f"{log.path}: scenario.toml is not UTF-8 text") from None
    horizon = scenario.controller.horizon
    if horizon > LONGEST_HORIZON:
        raise UserError(f"{log.path}: controller.horizon = {horizon} ticks: at most {LONGEST_HORIZON} are run again")
    if scenario.substeps > MOST_SUBSTEPS:
        raise UserError(f"{log.path}: {scenario.substeps} physics steps a tick: at most {MOST_SUBSTEPS} are run again")
    return scenario


def _check_controller(log: Log, kind: str) -> None:
    """See, before any code runs, that a controller from outside is here and is the one of the log."""
    file, text = outside.source_of(kind)
    then = log.attachments.get(LAW, ("", b""))[1]
    if file is None:
        raise UserError(f"{log.path}: its controller {kind} is not here; cmpc log export saves its file, {LAW}")
    if not then:
        raise UserError(f"{log.path}: holds no file of its controller {kind}, which {file} could be compared with")
    if text != then:
        raise UserError(
            f"{log.path}: its controller {kind} has changed: {file} has the digest {_digest(text)}, in the log it was "
            f"{_digest(then)}; cmpc log export saves the log's, {LAW}"
        )


def _digest(text: bytes) -> str:
    return sha256(text).hexdigest()[:12]


@contextlib.contextmanager
def unpacked(scenario: Scenario, attachments: Mapping[str, tuple[str, bytes]]) -> Iterator[ModelFiles]:
    """Model files from the attachments of a log, in a temporary folder of names of our own.

    Args:
        scenario: The scenario of the log.
        attachments: Name -> (media type, content).

    Yields:
        The files; they vanish with the context.

    Raises:
        UserError: a model is missing, twice there, too large, or reaches out of itself.
    """
    others = {name: data for name, (_, data) in attachments.items() if name not in ("scenario.toml", LIBRARY)}
    with tempfile.TemporaryDirectory(prefix="cmpc-") as folder:
        found = {}
        for suffix, use in ((".xml", "plant"), (".urdf", "controller"), (".toml", "gait")):
            names = [name for name in others if name.endswith(suffix)]
            if len(names) != 1:
                raise UserError(f"the log has {len(names)} attachments for the {use} (*{suffix}): must be one")
            if suffix != ".toml":
                check_xml(names[0], others[names[0]])
            found[suffix] = Path(folder) / _name(names[0], suffix)
            found[suffix].write_bytes(others[names[0]])
        library = Path(folder) / "library"
        library.mkdir()
        if LIBRARY in attachments:
            for name, text in _library(attachments[LIBRARY][1]).items():
                (library / name).write_text(text, encoding="utf-8")
        yield ModelFiles(mjcf=found[".xml"], urdf=found[".urdf"], gait=found[".toml"], library=library)


def _library(data: bytes) -> dict[str, str]:
    """Names and texts of an attached gait library."""
    try:
        found = json.loads(data) if len(data) <= LARGEST_MODEL else None
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict) or not all(isinstance(text, str) for text in found.values()):
        raise UserError(f"{LIBRARY} of the log: must hold names and texts of gait files, {LARGEST_MODEL} bytes at most")
    for name in found:
        if not _LIBRARY_FILE.fullmatch(name):
            raise UserError(f"{LIBRARY} of the log names {name[:40]!r}: must be letters, digits, - and ., then .toml")
    return found


def _name(name: str, suffix: str) -> str:
    """The attachment's own name where a file may be called that, so that a new log calls it the same."""
    plain = (
        name.isprintable() and not set(name) & set('/\\:*?"<>|') and name[0] not in ". " and len(name) <= LONGEST_NAME
    )
    return name if plain and len(name.encode(errors="replace")) <= LONGEST_NAME else f"model{suffix}"


def _is_huge(text: str) -> bool:
    try:
        return abs(float(text)) > LARGEST_IMAGE
    except ValueError:
        return False


def check_xml(name: str, data: bytes) -> None:
    """See that a model stands for itself alone.

    Args:
        name: For the message.
        data: The XML text.

    Raises:
        UserError: it is no XML, too large, has a document type, or would read other files.
    """
    if len(data) > LARGEST_MODEL:
        raise UserError(f"{name} has {len(data)} bytes: a model may have {LARGEST_MODEL}")
    parser = xml.parsers.expat.ParserCreate()
    depth = 0

    def refuse_doctype(*_: object) -> None:
        raise UserError(f"{name} has a document type (<!DOCTYPE>): a model in a log may not")

    def begin(element: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise UserError(f"{name} is nested more than {DEEPEST} deep")
        if element.lower() in _FORBIDDEN:
            raise UserError(f"{name} has an element <{element}>: a model in a log must stand for itself alone")
        for attribute in attributes:
            if any(word in attribute.lower() for word in _OUTSIDE) and attribute not in ("dir", "directional"):
                raise UserError(f'{name} has an attribute "{attribute}": a model in a log may not name other files')
            if attribute in _IMAGE and _is_huge(attributes[attribute]):
                raise UserError(f'{name} has {attribute} = "{attributes[attribute][:20]}": at most {LARGEST_IMAGE}')

    def finish(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = refuse_doctype
    parser.StartElementHandler = begin
    parser.EndElementHandler = finish
    try:
        parser.Parse(data, True)
    except xml.parsers.expat.ExpatError as error:
        raise UserError(f"{name} is no XML: {error}") from error
