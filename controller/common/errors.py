"""Errors a user can cause or meet; every message names the thing, its value, its unit and what is legal."""


class UserError(ValueError):
    """Bad input. The command line prints the message on one line and exits with code 2."""


class ControllerFailed(RuntimeError):
    """A controller broke, or gave what is no torque: the run ends as an error, which is never a fall."""
