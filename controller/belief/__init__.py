"""What the controller believes of the walker: its model, its gait, which leg stands, what contact may bear."""

from controller.belief.closed_loop import Gains, Loop
from controller.belief.friction import Friction
from controller.belief.gait import Gait, load_gait
from controller.belief.law import Law
from controller.belief.model import WalkerModel
from controller.belief.stance import StanceEstimator

__all__ = [
    "Friction",
    "Gains",
    "Gait",
    "Law",
    "Loop",
    "StanceEstimator",
    "WalkerModel",
    "load_gait",
]
