"""Walkers as people have them: a folder each, with model files."""

from sim.walkers.folder import WalkerFolder
from sim.walkers.model_files import ModelFiles

__all__ = [
    "ModelFiles",
    "WalkerFolder",
]
