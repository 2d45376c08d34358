"""TOML as people and strangers write it, read or refused: with one kind of error, whatever is wrong with it.

Common ground of both worlds: it knows nothing of a walker.
"""

import json
import tomllib
from typing import Any


def loads(text: str) -> dict[str, Any]:
    """What a TOML text says.

    Args:
        text: The text.

    Raises:
        ValueError: no TOML, or one that Python's parser cannot hold: integers of thousands of digits, tables or
            arrays nested deeper than its stack.
    """
    try:
        found = tomllib.loads(text)
        repr(found)  # refuses integers in hexadecimal as those in decimals: no message could tell them
    except RecursionError:
        raise ValueError("its tables or arrays are nested too deeply") from None
    return found


def quoted(text: str) -> str:
    """A text as a string of TOML: JSON's, but that JSON leaves the character 127 as it is."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def comment(text: str) -> str:
    """A text as a comment of TOML, which is one line and holds no control characters."""
    return "# " + "".join(letter if letter.isprintable() else "?" for letter in text)
