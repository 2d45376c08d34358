"""Tuples of arrays kept where compiled code finds them: handing over their address instead of all their parts.

A call from Python costs 0.1 us for every array in its arguments, more than the arithmetic on most of them. What does
not change from tick to tick is handed over once: `Held` stores the tuple as compiled code sees it, and `held` in
compiled code gives it back. Its arrays are lent for as long as the `Held` lives: no kernel may return them to Python.
Types that are handed over are named on disk: they must be this project's or plain tuples.

Common ground of both worlds: it knows nothing of a walker.
"""

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core.registry import cpu_target
from numba.extending import NativeValue, intrinsic, models, register_model, unbox


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


def _held(typing: Any, handle: Any) -> Any:
    """The tuple that a `Held` keeps."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        there = builder.inttoptr(arguments[0], context.get_value_type(signature.return_type).as_pointer())
        return builder.load(there, align=8)

    return handle.of(handle), generate


held: Any = intrinsic(_held)


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
        return (
            type(value),
            value.dtype,
            value.ndim,
            flags.c_contiguous,
            flags.f_contiguous,
            flags.aligned,
            flags.writeable,
        )
    return type(value)


_OWN: dict[int, Any] = {}


def _keeper(kind: Any) -> tuple[HeldType, struct.Struct]:
    """What a tuple of a type is handed over as, and how the numbers that it is made of lie in memory."""
    context = cpu_target.target_context
    target, layout = context.target_data, context.get_value_type(kind)
    text, end = "=", 0
    for offset, code in _numbers(kind, layout, target, 0):
        text += f"{offset - end}x{code}"
        end = offset + struct.calcsize(f"={code}")
    return HeldType(kind), struct.Struct(f"{text}{layout.get_abi_size(target) - end}x")


def _numbers(kind: Any, layout: Any, target: Any, at: int) -> Iterator[tuple[int, str]]:
    """Offset in bytes and code, as `struct` has them, of each number that a value of a type is made of."""
    if isinstance(kind, types.Array):
        yield at, f"{5 + 2 * kind.ndim}q"
    elif isinstance(kind, types.BaseTuple):
        parts: Any = kind
        for number, part in enumerate(parts.types):
            if isinstance(layout, ir.ArrayType):
                below, offset = layout.element, number * layout.element.get_abi_size(target)
            else:
                below, offset = layout.elements[number], layout.get_element_offset(target, number)
            yield from _numbers(part, below, target, at + offset)
    elif (code := _CODES.get(str(layout))) is not None:
        unsigned = not getattr(kind, "signed", True)
        yield at, code.upper() if unsigned else code
    else:
        raise TypeError(f"{kind} cannot be handed over: must be arrays, numbers and flags, in tuples or not")


_CODES = {"i1": "?", "i8": "b", "i16": "h", "i32": "i", "i64": "q", "float": "f", "double": "d"}


def _values(value: Any) -> Iterator[Any]:
    """The numbers that a value is made of; an array's owner, who would be counted, is nobody."""
    if isinstance(value, tuple):
        for part in value:
            yield from _values(part)
    elif isinstance(value, np.ndarray):
        yield from (0, 0, value.size, value.itemsize, value.__array_interface__["data"][0])
        yield from value.shape
        yield from value.strides
    else:
        yield getattr(value, "address", value)


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
        self._numba_type_, numbers = _KNOWN[key]
        self._memory = np.zeros(numbers.size // 8 + 1, dtype=np.int64)
        self.address = int(self._memory.__array_interface__["data"][0])
        numbers.pack_into(self._memory.data, 0, *_values(value))


_KNOWN: dict[Any, tuple[HeldType, struct.Struct]] = {}
"""By the mark of a tuple."""
