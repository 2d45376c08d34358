"""Words from a log, made safe for a terminal and for file names."""

import re

LONGEST = 300  # characters of a text from a log that are shown


def printable(text: object, longest: int = LONGEST) -> str:
    """A text on one line without control characters, cut where it is too long."""
    words = "".join(c if c.isprintable() else " " for c in str(text)[: longest + 1])
    return words if len(words) <= longest else words[:longest] + "..."


def file_stem(name: str) -> str:
    """A file name without folders, dots in front or anything a file system could take for more than a name."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name).strip("._")[:80] or "unnamed"
