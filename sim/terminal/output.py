"""Standard output that may be closed, full, or a pipe that nobody reads any more."""

import io
import os
import signal
import sys
from collections.abc import Callable

from sim.terminal.pulse import PULSE

EXIT_UNWRITTEN = 2
EXIT_BROKEN_PIPE = 128 + signal.SIGPIPE
"""As a shell reports a program that SIGPIPE ended."""


class Output(io.TextIOWrapper):
    """Standard output that remembers why it could not be written, whoever swallows the error.

    Attributes:
        failure: The first error, None if there was none.
    """

    failure: OSError | None = None

    def write(self, text: str) -> int:
        """Write a text.

        Raises:
            OSError: it cannot be written.
        """
        PULSE.clear()
        try:
            return super().write(text)
        except OSError as error:
            self.failure = self.failure or error
            raise

    def flush(self) -> None:
        """Write what waits.

        Raises:
            OSError: it cannot be written.
        """
        try:
            super().flush()
        except OSError as error:
            self.failure = self.failure or error
            raise


def with_output(command: Callable[[], int]) -> int:
    """Run a command of a program; its exit code, or one of those above, with one line where output is lost.

    What goes to an output that was closed before is not wanted.

    Args:
        command: Returns an exit code.
    """
    closed = _open_missing()
    buffer = io.BytesIO() if closed else sys.stdout.buffer
    encoding = "utf-8" if closed else sys.stdout.encoding
    # A file name need not be text: it is shown with escapes.
    output = Output(buffer, encoding=encoding, errors="backslashreplace", line_buffering=buffer.isatty())
    sys.stdout = output
    try:
        code = command()
        output.flush()
    except OSError:
        if output.failure is None:
            raise
    if output.failure is None:
        return code
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # for what is still to be flushed
    if isinstance(output.failure, BrokenPipeError):
        return EXIT_BROKEN_PIPE
    print(f"cmpc: error: standard output cannot be written: {output.failure.strerror}", file=sys.stderr)
    return EXIT_UNWRITTEN


def _open_missing() -> bool:
    """Fill closed descriptors, lest a log gets the number of standard output; whether stdout was among them."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest that is free
    if sys.stderr is None:
        sys.stderr = io.StringIO()
    return sys.stdout is None
