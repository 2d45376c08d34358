"""A ledge that the swing foot has run into: where it is, and how high it may be until a foot has stood on it."""

from controller.plan.dynamics import Terrain

AIR = 0.005  # [m] above the ground a foot that is stopped has not landed
HIGHER = 0.05  # [m] that a ledge is believed higher than the foot that met its riser
SPARE = 0.015  # [m] the same for the other foot, once one has stood on it
LOW = 0.01  # [m] of difference between two footholds that no ledge makes
BEFORE = 0.01  # [m] before the place where a foot met it, the ground is believed to have risen
RAMP = 0.03  # [m] of way over which it rises
NEAR = 0.004  # [m] that a stance foot at its riser is believed before it, at least
PAST = 0.02  # [m] past the edge a swing foot without contact, or a landing, tells that it is lower
UNDER = 2e-3  # [m] the ground is believed under such a swing foot


class Ledge:
    """What is believed of the one ledge that matters, between the feet or just ahead.

    Attributes:
        edge: Where it is, ahead of the stance foot in [m].
        rise: Its height in [m]; 0 where none is known.
        ramp: Way before it over which the ground rises in [m].
        level: Of the ground before it, from the stance foot in [m]: below 0 where that stands on it.
    """

    def __init__(self) -> None:
        """Know of none."""
        self.reset()

    def reset(self) -> None:
        """Forget it."""
        self.edge = self.rise = self.level = 0.0
        self.ramp = RAMP

    def terrain(self, tangent: float) -> Terrain:
        """The ground with it, on a slope of a tangent."""
        return Terrain(tangent, self.level, self.edge, self.rise, self.ramp)

    def met(self, blow: float, ahead: float, height: float, tangent: float) -> bool:
        """Take in a blow to a swing foot that feels no ground; whether it has run into a riser.

        Args:
            blow: Change of its speed in a tick that nothing known explains in [m/s], forward; 0 without one.
            ahead: Of the stance foot in [m].
            height: Above the stance foot in [m].
            tangent: Of the ground's slope.
        """
        above = height - tangent * ahead
        if blow >= 0.0 or above - self.level < AIR:
            return False
        if not (self.level < 0.0 and ahead < RAMP):  # or else it is the one that the stance foot is on
            self.level, self.rise = 0.0, above + HIGHER
        self.edge = ahead - BEFORE
        self._ahead()
        return True

    def missed(self, ahead: float, height: float, tangent: float) -> None:
        """Take in where a swing foot feels no ground: past the edge it is lower than believed."""
        if self.rise > 0.0 and ahead > self.edge + PAST:
            self.rise = min(self.rise, height - tangent * ahead - self.level - UNDER)
            if self.rise <= 0.0:
                self.reset()

    def landed(self, behind: float, height: float, tangent: float) -> bool:
        """Take in a landing; whether the ledge is what makes the footholds differ in height.

        Args:
            behind: The old foot, ahead of the new one in [m], negative.
            height: Of the old foot above the new one in [m].
            tangent: Of the ground's slope.
        """
        if self.rise == 0.0:
            return False
        step = tangent * behind - height
        self.edge += behind
        if self.level == 0.0 and self.edge < RAMP and step > LOW:
            self.rise = step + SPARE
            self.level = -self.rise
            return True
        if self.level < 0.0 or self.edge < -PAST:  # both feet are on it, or it is none
            self.reset()
        self._ahead()
        return False

    def _ahead(self) -> None:
        """However near its riser is, a stance foot that is not on it is before it."""
        if self.rise > 0.0 and self.level == 0.0:
            self.edge = max(self.edge, NEAR)
            self.ramp = min(RAMP, self.edge)
