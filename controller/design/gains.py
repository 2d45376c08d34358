"""What gains are worth: K_P and K_D should make the sampled closed loop converge fast.

The paper picks them by "a basic search algorithm ... that seeks small eigenvalue combinations" of the Poincare map.
delta^2 belongs to the gait and no gain moves it (up to what sampling does), so beside the largest eigenvalue the
sum of the others counts a little. Torque limits count through a disturbed step, sampling through the held torque
of the map itself.
"""

from dataclasses import dataclass

import numpy as np

from controller.belief import Gains, Gait, WalkerModel
from controller.design.poincare import NoReturn, return_map, step

LOWEST = np.array([5.0] * 4 + [2.0] * 4)  # [1/s^2], [1/s]
HIGHEST = np.array([800.0] * 4 + [80.0] * 4)
OTHERS = 0.05  # weight of the other eigenvalues' mean
EXCESS = 1.0  # weight of the torque beyond the limits, as a share of them
FALLEN = 10.0  # score of gains under which the walker does not come back
DISTURBANCE = np.array([0.04, 0.04, -0.06, -0.06, -0.04, 0.4, -0.4, 0.4, -0.4, -0.4])
"""[rad], [rad/s]: added to the state before impact in the step that shows torques: faster, and off the outputs."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Score:
    """What gains are worth.

    Attributes:
        value: Smaller is better.
        largest: Magnitude of the largest eigenvalue of the sampled map.
        eigenvalues: Magnitudes of all nine, descending.
        torque_excess: Largest torque asked for in the disturbed step beyond the limit, by the limit; 0 if none.
    """

    value: float
    largest: float
    eigenvalues: tuple[float, ...]
    torque_excess: float


def score(model: WalkerModel, gait: Gait, gains: Gains, hold: float) -> Score:
    """Judge gains on a gait.

    Args:
        model: The walker.
        gait: Its gait.
        gains: ZD+PD gains.
        hold: Sampling period in [s].
    """
    try:
        section = return_map(model, gait, gains, hold=hold, substeps=1)
        disturbed = step(model, gait, gains, section.x_minus + DISTURBANCE, hold=hold, substeps=1)
    except (NoReturn, np.linalg.LinAlgError):
        return Score(value=FALLEN, largest=FALLEN, eigenvalues=(), torque_excess=0.0)
    sizes = tuple(float(x) for x in np.abs(section.eigenvalues))
    excess = max(0.0, float((disturbed.peak / model.torque_limits).max()) - 1.0)
    value = sizes[0] + OTHERS * float(np.mean(sizes[1:])) + EXCESS * excess
    return Score(value=min(value, FALLEN), largest=sizes[0], eigenvalues=sizes, torque_excess=excess)
