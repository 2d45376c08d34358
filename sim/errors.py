"""Errors of a run; those of a user's input are common ground."""

from controller.common.errors import ControllerFailed, UserError

__all__ = ["ControllerFailed", "PlantDiverged", "UserError"]


class PlantDiverged(RuntimeError):
    """The plant's state is not finite any more, or the engine raised a warning that means the same."""
