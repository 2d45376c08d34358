"""The observer as a service: what a law tells it at a tick, and what it is told."""

from dataclasses import dataclass

import numpy as np

from controller.belief import WalkerModel, kernels
from controller.common.compiled import compiled
from controller.common.records import Leg, Observation, StanceState
from controller.common.settings import ObserverSettings
from controller.observer.momentum import MEMORY, Body, Tuning, forget, observe

LEGS = tuple(Leg)
RISE = 2.6  # of lag times bandwidth: a step seen through two poles at 45 degrees reaches 90 %
HEIGHT = 1.0  # [m] of the torso above the foot, for which the lag is right


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What is believed to act on the walker.

    Attributes:
        push: Horizontal force on the torso's centre of mass in [N], forward.
        load: Mass added to the torso, spread as its own is, in [kg]; negative where it is lighter than believed.
        moment: Of both about the stance foot in [N.m], forward.
        slope: Tangent of the ground's slope between the last two footholds, uphill positive.
    """

    push: float = 0.0
    load: float = 0.0
    moment: float = 0.0
    slope: float = 0.0

    def figures(self) -> dict[str, float]:
        """For `ControlStep.diagnostics`."""
        return {
            "observed push [N]": self.push,
            "observed load [kg]": self.load,
            "observed moment [N.m]": self.moment,
            "observed slope": self.slope,
        }


class PushObserver:
    """Tells push, load and slope from measured angles and rates; for any law, once a tick.

    Compiled laws may call `momentum.observe` themselves with `body`, `tuning` and `memory`.
    """

    def __init__(
        self,
        model: WalkerModel,
        settings: ObserverSettings | None = None,
        *,
        period: float = 1e-3,
        impact_time: float = 0.012,
    ) -> None:
        """Put the parts together.

        Args:
            model: The walker believed in.
            settings: Of the filter; their defaults if not given.
            period: Of the ticks in [s].
            impact_time: How long rates say nothing after a landing in [s].
        """
        settings = settings or ObserverSettings()
        self.body = body_of(model)
        self.tuning = tuning_of(settings, period, impact_time)
        self.memory = np.zeros(1, MEMORY)
        self._stage = kernels.new_stage()
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        forget(self.tuning, self.memory)

    def update(self, observation: Observation, state: StanceState) -> Estimate:
        """Take in a tick.

        Args:
            observation: What is measured.
            state: What the law's `StanceEstimator` makes of it.
        """
        leg = LEGS.index(state.leg)
        stands = observation.contact[leg]
        _take(self.body, self.tuning, self.memory, self._stage, observation.t, leg, stands, state.q, state.dq)
        return self.estimate

    @property
    def estimate(self) -> Estimate:
        """What is believed now."""
        m = self.memory[0]
        return Estimate(
            push=float(m["push"]), load=float(m["load"]), moment=float(m["moment"]), slope=float(m["slope"])
        )


def body_of(model: WalkerModel) -> Body:
    """The walker as the filter knows it."""
    femur, tibia, torso = model.femur.length, model.tibia.length, model.torso
    across = torso.com_across if model.known.com_across else 0.0
    return Body(model.lumped, np.array([-femur, 0.0, -tibia, 0.0, torso.com]), across, torso.inertia / torso.mass)


def tuning_of(settings: ObserverSettings, period: float, impact_time: float) -> Tuning:
    """The filter's intensities from the lag that is asked for."""
    bandwidth = RISE / settings.lag
    walk = bandwidth**2 * settings.noise / HEIGHT
    return Tuning(
        noise=settings.noise,
        walk=walk * walk * period,
        load_walk=settings.load_walk * settings.load_walk,
        load_doubt=settings.load_doubt,
        slope_memory=settings.slope_memory,
        impact_time=impact_time,
    )


@compiled
def _take(body, tuning, memory, stage, t, leg, stands, q, dq):  # type: ignore[no-untyped-def]
    kernels.place(q, dq, stage)
    observe(body, tuning, memory, stage, t, leg, stands)
