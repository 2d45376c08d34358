"""What every law here has: a walker it believes in, a gait to follow, gains, and a view of which leg stands."""

from abc import ABC, abstractmethod

from controller.belief.closed_loop import Gains, Loop
from controller.belief.gait import Gait
from controller.belief.model import WalkerModel
from controller.belief.stance import StanceEstimator
from controller.common.records import ControlStep, Observation, Vector


class Law(ABC):
    """A controller on the closed loop of a walker, a gait and gains.

    Attributes:
        model: The walker believed in.
        gait: The gait followed.
        loop: Walker, gait and gains as the compiled code takes them.
        stance: Tells which leg stands; by default one that takes every measured rate literally.
    """

    def __init__(self, model: WalkerModel, gait: Gait, gains: Gains) -> None:
        """Args: model: the walker believed in; gait: its outputs; gains: of ZD+PD."""
        self.model, self.gait = model, gait
        self.loop = Loop(model.lumped, gait.table, gains)
        self.stance = StanceEstimator(model)

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        self.stance.reset(stance)

    def follow(self, gait: Gait, rate_change: Vector) -> None:
        """Follow another gait from now on.

        Args:
            gait: Of the same walker and clock.
            rate_change: What its nominal clock rate has over the first gait's in [rad/s], a polynomial of the
                normalised clock, lowest power first; a law that does not look at the clock's rate ignores it.
        """
        self.gait = gait
        self.loop = self.loop._replace(gait=gait.table)

    def held(self, step: ControlStep) -> ControlStep:
        """Remember the torque that is held until the next tick; hands the decision on."""
        self.stance.held(step.u_total)
        return step

    @abstractmethod
    def step(self, observation: Observation) -> ControlStep:
        """Decide the torque for the coming control period."""
