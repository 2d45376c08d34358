"""The paper's controller: ZD+PD, the partial prediction, and the MPC around them."""

from controller.cmpc.cascade import CascadedMpc
from controller.cmpc.prediction import Horizon, predict
from controller.cmpc.zero_dynamics import ZeroDynamicsController

__all__ = [
    "CascadedMpc",
    "Horizon",
    "ZeroDynamicsController",
    "predict",
]
