"""Tuples of arrays kept where compiled code finds them: handing over their address instead of all their parts.

A call from Python costs 0.1 us for every array in its arguments, more than the arithmetic on most of them. What does
not change from tick to tick is handed over once: `Held` stores the tuple as compiled code sees it, and `held` in
compiled code gives it back. Its arrays are lent for as long as the `Held` lives: no kernel may return them to Python.
Types that are handed over are named on disk: they must be this project's or plain tuples.

Common ground of both worlds: it knows nothing of a walker.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import NativeValue, intrinsic, models, register_model, unbox

from controller.common.compiled import generic


class HeldType(types.Type):
    """The address of a tuple of a given type."""

    def __init__(self, of: Any) -> None:
        """Args: of: the tuple's type."""
        self.of = of
        super().__init__(name=f"Held({of})")

    @property
    def key(self) -> Any:
        """What tells one from another."""
        return self.of


@register_model(HeldType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.IntType(64))


@unbox(HeldType)
def _unbox(kind: Any, thing: Any, c: Any) -> Any:
    number = c.pyapi.object_getattr_string(thing, "address")
    value = c.pyapi.long_as_longlong(number)
    c.pyapi.decref(number)
    return NativeValue(value)


def _room(context: Any, builder: Any, kind: Any, address: Any) -> Any:
    return builder.inttoptr(address, context.get_value_type(kind).as_pointer())


def _lent(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """A value whose arrays have no owner: counting who holds them costs as much as small arithmetic on them."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value=value)
        array.meminfo = array.parent = cgutils.get_null_value(array.meminfo.type)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        for number, part in enumerate(parts.types):
            lent = _lent(context, builder, part, builder.extract_value(value, number))
            value = builder.insert_value(value, lent, number)
    return value


def _store(typing: Any, address: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = signature.args[1]
        lent = _lent(context, builder, kind, arguments[1])
        builder.store(lent, _room(context, builder, kind, arguments[0]), align=8)
        return context.get_dummy_value()

    return types.void(types.int64, value), generate


def _held(typing: Any, handle: Any) -> Any:
    """The tuple that a `Held` keeps."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = signature.return_type
        return builder.load(_room(context, builder, kind, arguments[0]), align=8)

    return handle.of(handle), generate


store: Any = intrinsic(_store)
held: Any = intrinsic(_held)


@generic
def _keep(address: int, value: Any) -> None:
    store(address, value)


def mark(value: Any) -> Any:
    """What tells values of one type from those of another, found without Numba.

    To Numba the type of an array of records or of a nested tuple is a millisecond's work.
    """
    if (own := getattr(value, "_numba_type_", None)) is not None:
        return id(_OWN.setdefault(id(own), own))  # Numba has one of each; kept, so that its number stays its own
    if isinstance(value, tuple):
        return (type(value), *map(mark, value))
    if isinstance(value, np.ndarray):
        flags = value.flags
        return value.dtype, value.ndim, flags.c_contiguous, flags.f_contiguous, flags.aligned, flags.writeable
    return type(value)


_OWN: dict[int, Any] = {}


def _keeper(kind: Any) -> tuple[HeldType, Any, int]:
    """What a tuple of a type is handed over as, what keeps it, and how many numbers of 64 bits it takes."""
    kinds = types.int64, kind
    _keep.compile(kinds)
    context = cpu_target.target_context
    size = context.get_abi_sizeof(context.get_value_type(kind)) // 8 + 1
    return HeldType(kind), _keep.overloads[kinds].entry_point, size


class Held:
    """A tuple of arrays, flags and numbers, nested or not, as it is now; its arrays stay shared with Python.

    Attributes:
        value: The tuple.
        address: Where it is kept.
    """

    def __init__(self, value: Any) -> None:
        """Args: value: the tuple."""
        self.value = value
        key = mark(value)
        if key not in _KNOWN:
            _KNOWN[key] = _keeper(typeof(value))
        self._numba_type_, keep, size = _KNOWN[key]
        self._memory = np.zeros(size, dtype=np.int64)
        self.address = int(self._memory.__array_interface__["data"][0])
        keep(self.address, value)


_KNOWN: dict[Any, tuple[HeldType, Any, int]] = {}
"""By the mark of a tuple."""
