"""The observer beside a controller: told every tick before it decides, its estimates in the log."""

from dataclasses import replace
from typing import Any

from controller.belief import StanceEstimator
from controller.common.records import Controller, ControlStep, Observation
from controller.observer.observer import PushObserver


class Observed:
    """A controller whose figures include what the observer believes; all else is the inner controller's."""

    def __init__(self, inner: Controller, observer: PushObserver, stance: StanceEstimator) -> None:
        """Put the parts together.

        Args:
            inner: The controller; it may read the observer's `estimate`, which is that of its own tick.
            observer: The observer.
            stance: An estimator of its own.
        """
        self.inner, self.observer, self._stance = inner, observer, stance

    def reset(self, stance: str) -> None:
        """Forget the past; `stance` is the leg that stands now, "left" or "right"."""
        self._stance.reset(stance)
        self.observer.reset()
        self.inner.reset(stance)

    def follow(self, gait: Any, rate_change: Any) -> None:
        """Follow another gait from now on, if the inner controller can."""
        self.inner.follow(gait, rate_change)  # type: ignore[attr-defined]

    def step(self, observation: Observation) -> ControlStep:
        """One tick."""
        estimate = self.observer.update(observation, self._stance.update(observation))
        step = self.inner.step(observation)
        self._stance.held(step.u_total)
        return replace(step, diagnostics={**step.diagnostics, **estimate.figures()})
