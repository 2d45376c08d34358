"""Gain search: K_P and K_D that make the sampled closed loop converge fastest, by CMA-ES.

The paper picks them by "a basic search algorithm ... that seeks small eigenvalue combinations" of the Poincare map.
delta^2 belongs to the gait and no gain moves it (up to what sampling does), so beside the largest eigenvalue the
sum of the others counts a little. Torque limits count through a disturbed step, sampling through the held torque
of the map itself. The search is a list of evaluations; replaying a saved one brings it back to where it was.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from controller.design.poincare import NoReturn, return_map, step
from controller.errors import ControllerInputError
from controller.gait import Gait
from controller.kernels import Gains
from controller.model import WalkerModel
from controller.records import Vector

LOWEST = np.array([5.0] * 4 + [2.0] * 4)  # [1/s^2], [1/s]
HIGHEST = np.array([800.0] * 4 + [80.0] * 4)
SPREAD = 0.35  # first standard deviation, in natural logarithms of the gains
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


Evaluation = tuple[tuple[float, ...], float]
"""Gains (K_P, then K_D; 8) and their score."""


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
        _, _, peak, _ = step(model, gait, gains, section.x_minus + DISTURBANCE, hold=hold, substeps=1)
    except (NoReturn, np.linalg.LinAlgError):
        return Score(value=FALLEN, largest=FALLEN, eigenvalues=(), torque_excess=0.0)
    sizes = tuple(float(x) for x in np.abs(section.eigenvalues))
    excess = max(0.0, float((peak / model.torque_limits).max()) - 1.0)
    value = sizes[0] + OTHERS * float(np.mean(sizes[1:])) + EXCESS * excess
    return Score(value=min(value, FALLEN), largest=sizes[0], eigenvalues=sizes, torque_excess=excess)


def search(
    evaluate: Callable[[Gains], float],
    start: Gains,
    *,
    seed: int,
    evaluations: int,
    known: Sequence[Evaluation] = (),
    keep: Callable[[Evaluation], None],
) -> Evaluation:
    """The best gains within a number of evaluations, the start's among them.

    Args:
        evaluate: Score of gains; smaller is better.
        start: First guess.
        seed: Of CMA-ES.
        evaluations: How many, those already known included.
        known: Evaluations of an interrupted search with the same seed and start: taken instead of evaluating.
        keep: Told each new evaluation.

    Raises:
        ControllerInputError: the optimiser is not installed, or `known` is of another search.
    """
    try:
        from cmaes import CMA
    except ImportError as error:
        raise ControllerInputError(
            "the gain search needs the optimiser cmaes; install it with pip install 'cmpc-walker[design]'"
        ) from error
    first = np.clip(np.concatenate([start.kp, start.kd]), LOWEST, HIGHEST)
    low, high = np.log(LOWEST), np.log(HIGHEST)
    optimiser = CMA(mean=np.log(first), sigma=SPREAD, bounds=np.column_stack([low, high]), seed=seed)
    done: list[Evaluation] = []

    def value_of(x: Vector) -> float:
        gains = tuple(float(g) for g in x)
        if len(done) < len(known):
            there, value = known[len(done)]
            if not np.allclose(there, gains, rtol=1e-9):
                raise ControllerInputError(
                    f"evaluation {len(done) + 1} of the search to resume is of other gains; legal: the same walker, "
                    "gait, start and seed, or a new file"
                )
        else:
            value = evaluate(Gains(kp=np.array(gains[:4]), kd=np.array(gains[4:])))
            keep((gains, value))
        done.append((gains, value))
        return value

    value_of(first)
    while len(done) < evaluations:
        asked = [optimiser.ask() for _ in range(optimiser.population_size)]
        optimiser.tell([(x, value_of(np.exp(x))) for x in asked])
    return min(done, key=lambda evaluation: evaluation[1])
