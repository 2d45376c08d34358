"""The table of a conversion as it grows, and what stops it."""

from collections.abc import Iterable

from sim.walkers.tree import Row


class Impossible(Exception):
    """The rows say why."""


class Table:
    """Rows of what deviates, in the order they are found."""

    def __init__(self, rows: Iterable[Row]) -> None:
        """Args: rows: of the file's tree."""
        self.rows = list(rows)

    def row(self, part: str, found: str, made: str, verdict: str = "made") -> None:
        """Add a row; see `tree.Row`."""
        self.rows.append(Row(part=part, found=found, made=made, verdict=verdict))

    def outside(self, part: str, found: str, legal: str) -> None:
        """Add what no walker can be made of, and go on so that the table is whole."""
        self.row(part, found, legal, "outside")

    def stop(self, part: str, found: str, legal: str) -> Impossible:
        """Add what no walker can be made of; the caller raises it."""
        self.outside(part, found, legal)
        return Impossible()
