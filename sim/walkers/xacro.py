"""A xacro as the URDF it stands for, by xacrodoc."""

import contextlib
import io
import logging
import xml.dom.minidom
from pathlib import Path

from sim.errors import UserError


def expand(path: Path) -> tuple[str, bool]:
    """The URDF's text, and whether macros had to be read before those that use them, as xacro once did.

    Raises:
        UserError: missing, not a xacro, or xacrodoc is not installed.
    """
    if not path.is_file():
        raise UserError(f"{path}: no such file; expected a xacro")
    try:
        from xacrodoc import XacroDoc
    except ImportError as error:
        raise UserError("--xacro needs xacrodoc; install it: pip install 'cmpc-walker[xacro]'") from error
    nowhere = io.StringIO()
    logging.getLogger("rospkg").setLevel(logging.CRITICAL)
    with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        try:
            return str(XacroDoc.from_file(str(path)).to_urdf_string()), False
        except (Exception, SystemExit) as error:  # whatever the expressions in the file raise
            complaint = error
        if "unknown macro name" in str(complaint):
            try:
                return str(XacroDoc.from_string(_macros_first(path), rootdir=path.parent).to_urdf_string()), True
            except (Exception, SystemExit) as error:
                complaint = error
    lines = [line.strip() for line in str(complaint).splitlines() if line.strip()] or [type(complaint).__name__]
    raise UserError(f"{path}: not a xacro that expands ({lines[0][:200]})") from complaint


def _macros_first(path: Path) -> str:
    document = xml.dom.minidom.parse(str(path))
    root = document.documentElement
    assert root is not None
    macros = [node for node in root.childNodes if getattr(node, "tagName", "") == "xacro:macro"]
    for macro in reversed(macros):
        root.insertBefore(root.removeChild(macro), root.firstChild)
    return str(document.toxml())
