"""When the plan is followed instead of the gait, and how the torque goes over from one to the other."""

from controller.common.settings import PlanSettings

KEPT = 0.55  # of what is off that counts against coming back: the law on the gait sees to the rest
WAKE = 0.3  # of what calls for the plan, from which on one is kept ready


class Share:
    """The plan's share of the torque.

    Attributes:
        value: 0 to 1.
        resting: Whether it is so calm that no plan need be ready.
    """

    def __init__(self, settings: PlanSettings, period: float) -> None:
        """Args: settings: thresholds and times; period: of the ticks in [s]."""
        self._settings, self._period = settings, period
        self.reset()

    def reset(self) -> None:
        """Follow the gait."""
        self.value, self.resting = 0.0, True
        self._wanted, self._quiet = False, 0.0

    def look(self, off: float) -> None:
        """See how far from calm it is: 1 where the plan is wanted."""
        self._quiet = self._quiet + self._period if KEPT * off < self._settings.calm else 0.0
        if off > 1.0:
            self._wanted = True
        elif self._quiet > self._settings.rest:
            self._wanted = False
        self.resting = not self._wanted and self.value == 0.0 and off < WAKE

    def move(self, found: bool) -> bool:
        """Move towards the plan or the gait; where there is no plan, the gait is the one fall-back.

        Returns:
            Whether the gait is come back to after the plan alone was followed.
        """
        self._wanted = self._wanted and found
        before, change = self.value, self._period / self._settings.blend
        self.value = min(1.0, before + change) if self._wanted else max(0.0, before - change)
        return before == 1.0 > self.value
