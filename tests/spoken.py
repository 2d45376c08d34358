"""What a command said on stderr beside its signs of life, which depend on how long it took."""

import re

SIGN_OF_LIFE = re.compile(r"[\w .,-]+: (?:.*  )?\d+ s")


def spoken(err: str) -> list[str]:
    """Lines that are no sign of life and not empty."""
    return [line for line in err.splitlines() if line.strip() and not SIGN_OF_LIFE.fullmatch(line.strip())]
