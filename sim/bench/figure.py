"""What a benchmark gives: figures with their units and targets."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One measured figure.

    Attributes:
        name: What was measured.
        value: In `unit`.
        unit: Symbol, "x" for a ratio.
        target: What is asked for, with its direction, such as "<= 0.15"; empty where nothing is.
        multiple: A time over that of four bare substeps in the same run; None for what is no time.
    """

    name: str
    value: float
    unit: str
    target: str = ""
    multiple: float | None = None

    @property
    def holds(self) -> bool | None:
        """Whether the target is met; None without one."""
        if not self.target:
            return None
        direction, bound = self.target.split()
        return self.value <= float(bound) if direction == "<=" else self.value >= float(bound)
