"""What the controller believes of the walker: its model, its gait, which leg stands, what contact may bear."""

from controller.belief.gait import Gait, load_gait
from controller.belief.model import WalkerModel
from controller.belief.stance import StanceEstimator

__all__ = [
    "Gait",
    "StanceEstimator",
    "WalkerModel",
    "load_gait",
]
