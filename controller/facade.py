"""For laws from outside: the dynamics of the outputs, by the objects a factory is given."""

import numpy as np

from controller.belief import Gait, WalkerModel
from controller.common.records import Vector
from controller.rivals.output_dynamics import OutputDynamics, output_dynamics


def outputs(model: WalkerModel, gait: Gait, q: Vector, dq: Vector) -> OutputDynamics:
    """Clock, outputs y = h_0(q) - h_d(theta), their dynamics ddy = drift + decoupling u, and the stance force.

    Args:
        model: The walker believed in.
        gait: The outputs.
        q: Coordinates in [rad], (5,), stance order.
        dq: Rates in [rad/s], (5,).
    """
    state = np.ascontiguousarray(q, dtype=float), np.ascontiguousarray(dq, dtype=float)
    found: OutputDynamics = output_dynamics(model.lumped, gait.table, *state)
    return found
