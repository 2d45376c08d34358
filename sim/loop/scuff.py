"""Scuffing: the swing foot below the ground without landing, which only a plant without contact allows for long."""

from dataclasses import dataclass

GRAZE = 1e-6  # [m]; what a foot at rest on compliant ground sinks in, and more than rounding
SHOWN = 1e3  # [mm/m] and [ms/s]


@dataclass(slots=True)
class Scuffing:
    """How deep and for how many ticks the swing foot was below the ground outside landings.

    Attributes:
        depth: Largest depth in [m].
        ticks: Ticks spent below.
        ahead: Of these, ticks ahead of the stance foot.
    """

    depth: float = 0.0
    ticks: int = 0
    ahead: int = 0
    _now: tuple[float, int] | None = None

    def look(self, depth: float, ahead: float) -> str:
        """Take in one tick.

        Args:
            depth: Of the swing foot below the ground in [m]; 0 or below where it is above, or has just landed.
            ahead: Distance of the swing foot ahead of the stance foot in [m].

        Returns:
            What to note in the log: the beginning, the end with its figures, or nothing.
        """
        if depth <= GRAZE:
            if self._now is None:
                return ""
            (deepest, ticks), self._now = self._now, None
            return f"the swing foot is above the ground again: {SHOWN * deepest:.2f} mm deep, {ticks} ticks"
        began = self._now is None
        deepest, ticks = self._now or (0.0, 0)
        self._now = max(deepest, depth), ticks + 1
        self.depth = max(self.depth, depth)
        self.ticks += 1
        self.ahead += ahead > 0.0
        return f"the swing foot passes below the ground, {ahead:+.3f} m from the stance foot" if began else ""
