"""Errors of a run; those of a user's input are common ground."""

from controller.errors import UserError

__all__ = ["PlantDiverged", "UserError"]


class PlantDiverged(RuntimeError):
    """The plant's state is not finite any more, or the engine raised a warning that means the same."""
