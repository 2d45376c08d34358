"""Errors the controller raises; messages name the file or argument, the value, its unit and what is legal."""


class ControllerInputError(ValueError):
    """A model, gait or setting the controller can not work with."""
