"""The folder of a campaign: what lies in it, one campaign at a time, old results set aside."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from sim.errors import UserError

FILE = "results.sqlite"
LOGS = "logs"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep a second campaign out of a folder while the context lasts.

    Raises:
        UserError: the folder cannot be made, or another campaign is writing there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / ".lock", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC)
    except OSError as error:
        raise UserError(f"--out {folder}: cannot be written: {error.strerror}") from error
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as error:
        raise UserError(f"--out {folder}: another campaign is writing there; wait for it or use another") from error
    finally:
        os.close(handle)


def set_aside(folder: Path) -> Path | None:
    """Move the results and logs of a folder into a backup beside them; the backup, None if there was nothing."""
    file = folder / FILE
    if not file.exists():
        return None
    backup = folder / f"backup-{datetime.now(UTC):%Y%m%dT%H%M%S%f}Z"
    backup.mkdir()
    for path in sorted(folder.iterdir()):
        if not path.name.startswith(("backup-", ".lock")):
            path.rename(backup / path.name)
    return backup
