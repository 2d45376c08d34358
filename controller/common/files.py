"""Files written whole or not at all.

Common ground of both worlds: it knows nothing of a walker.
"""

import os
import tempfile
from pathlib import Path

from controller.common.errors import UserError


def write(path: Path, text: str) -> None:
    """Write a file whole or not at all; one of that name is replaced, a device or a pipe is written into.

    Raises:
        UserError: it cannot be written.
    """
    data = text.encode("utf-8", errors="replace")
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(data)
            return
        with tempfile.NamedTemporaryFile("wb", dir=path.parent, prefix=f".{path.name}-", delete=False) as file:
            part = Path(file.name)
            try:
                file.write(data)
                file.close()
                part.chmod(0o666 & ~_umask())
                part.replace(path)
            except BaseException:
                part.unlink(missing_ok=True)
                raise
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror}") from error


def _umask() -> int:
    """Bits that files of this process do not get."""
    now = os.umask(0)
    os.umask(now)
    return now
