"""Errors a user can cause or meet; every message names the thing, its value, its unit and what is legal."""


class UserError(ValueError):
    """Bad input. The command line prints the message on one line and exits with code 2.

    Attributes:
        what: What is wrong: file or setting and its value; the whole message where it says no more.
        must: What it must be, empty where the message does not say.
    """

    @property
    def what(self) -> str:
        """The message up to what it must be."""
        return str(self).partition("must be ")[0].rstrip(" :;,") or str(self)

    @property
    def must(self) -> str:
        """The message from what it must be."""
        return str(self).partition("must be ")[2]


class ControllerFailed(RuntimeError):
    """A controller broke, or gave what is no torque: the run ends as an error, which is never a fall."""
