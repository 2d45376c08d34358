"""Matrix products that are the same to the last bit on every machine.

A BLAS picks its kernel by the processor, and with it the order in which it sums: runs of one scenario would differ
from their first tick. Here the order is written down, with fused multiply-adds, which every processor can do.

Common ground of both worlds: it knows nothing of a walker.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from controller.common.compiled import Array, compiled


def _fma(typing: Any, a: Any, b: Any, c: Any) -> Any:
    """A * b + c in float64, rounded once."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType()
        kind = ir.FunctionType(double, [double] * 3)
        return builder.call(builder.module.declare_intrinsic("llvm.fma", [double], kind), arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


fma: Any = intrinsic(_fma)


@compiled
def product(a: Array, b: Array) -> Array:
    """A b for a (n, k) and b (k, m)."""
    out = a[:, :1] * b[:1]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total = fma(a[i, k], b[k, j], total)
            out[i, j] = total
    return out


@compiled
def inner(a: Array, b: Array) -> float:
    """Inner product of two vectors."""
    total = 0.0
    for k in range(a.shape[0]):
        total = fma(a[k], b[k], total)
    return total


@compiled
def applied(a: Array, x: Array) -> Array:
    """A x for a (n, k) and x (k,), k of 4 to 7; in the order of the BLAS with which logs were first recorded."""
    out = a[:, 0] * x[0]
    for i in range(out.shape[0]):
        row = a[i]
        total = (out[i] + row[2] * x[2]) + (row[1] * x[1] + row[3] * x[3])
        if x.shape[0] == 5:
            total = fma(row[4], x[4], total)
        elif x.shape[0] > 5:
            rest = fma(row[4], x[4], row[5] * x[5])
            total += fma(row[6], x[6], rest) if x.shape[0] == 7 else rest
        out[i] = total
    return out
