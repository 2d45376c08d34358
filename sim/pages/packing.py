"""Numbers for a page's script, small: floats with fewer digits, as differences, byte by byte, deflated."""

import base64
import zlib
from typing import Any

import numpy as np

MANTISSA = 23  # bits of a float32's


def packed(rows: Any, bits: int = 15) -> dict[str, Any]:
    """Rows of numbers; `unpacked` of plot.js reads them.

    Args:
        rows: (m, n).
        bits: Of the mantissa that are kept, 22 at most: 15 are right to 2e-5 of each value.
    """
    values = np.ascontiguousarray(np.atleast_2d(np.asarray(rows)), dtype="<f4")
    drop = MANTISSA - bits
    whole = values.view("<u4").astype(np.int64)
    finite = np.isfinite(values)
    whole[finite] += (1 << drop) >> 1
    whole >>= drop
    steps = np.diff(whole, axis=1, prepend=0)
    steps = np.ascontiguousarray((steps << 1) ^ (steps >> 63), dtype="<u4")  # small whatever the sign
    planes = steps.view(np.uint8).reshape(*steps.shape, 4).transpose(0, 2, 1)
    data = base64.b64encode(zlib.compress(planes.tobytes(), 6)).decode("ascii")
    return {"rows": values.shape[0], "length": values.shape[1], "drop": drop, "data": data}
