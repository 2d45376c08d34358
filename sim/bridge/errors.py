"""Part of the composition root: what the controller's side refuses, as the user's errors."""

import contextlib
from collections.abc import Iterator

from controller.errors import ControllerInputError
from sim.errors import UserError


@contextlib.contextmanager
def as_user_errors() -> Iterator[None]:
    """What the controller's side refuses is a user's error here."""
    try:
        yield
    except ControllerInputError as error:
        raise UserError(str(error)) from error
