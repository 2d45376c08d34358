"""Compiled kernels handed over as values: where one begins, called from another that was compiled without knowing it.

A kernel that calls another by its name is compiled together with it, and with all that the other calls. What a loop
calls in each tick is of one plant or another, one law or another: handed over as an `Entry`, each is compiled once.

Common ground of both worlds: it knows nothing of a walker.
"""

from typing import Any, NamedTuple

from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.extending import NativeValue, intrinsic, models, register_model, unbox

from controller.common.compiled import Kernel
from controller.common.held import mark


class EntryType(types.Type):
    """The address of a kernel of a given signature."""

    def __init__(self, returns: Any, arguments: tuple[Any, ...]) -> None:
        """Args: returns: type of its result; arguments: types of its arguments."""
        self.returns, self.arguments = returns, arguments
        super().__init__(name=f"Entry({returns}, {arguments})")

    @property
    def key(self) -> Any:
        """What tells one from another."""
        return self.returns, self.arguments


@register_model(EntryType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.IntType(64))


@unbox(EntryType)
def _unbox(kind: Any, thing: Any, c: Any) -> Any:
    number = c.pyapi.object_getattr_string(thing, "address")
    value = c.pyapi.long_as_longlong(number)
    c.pyapi.decref(number)
    return NativeValue(value)


class Entry:
    """A kernel, compiled for arguments of given types, as another kernel calls it.

    Attributes:
        address: Where its machine code begins.
    """

    def __init__(self, kernel: Kernel, *arguments: Any) -> None:
        """Args: kernel: made by `compiled`; arguments: of the types it is called with."""
        key = kernel, mark(arguments)
        if key not in _FOUND:
            kinds = tuple(map(typeof, arguments))
            kernel.compile(kinds)
            found: Any = kernel.overloads[kinds]
            kind = EntryType(found.signature.return_type, kinds)
            _FOUND[key] = kind, int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))
        self._kernel = kernel  # whose machine code it is
        self._numba_type_, self.address = _FOUND[key]


_FOUND: dict[Any, tuple[EntryType, int]] = {}


class Bound(NamedTuple):
    """A kernel with its first arguments.

    Attributes:
        entry: The kernel.
        arguments: The first of its arguments.
    """

    entry: Any
    arguments: tuple[Any, ...]


def bind(kernel: Kernel, first: tuple[Any, ...], rest: tuple[Any, ...]) -> Bound:
    """A kernel with its first arguments, to be called with the rest by `call(*bound, rest)`.

    Args:
        kernel: Made by `compiled`.
        first: Handed over once.
        rest: Of the types that are handed over with each call.
    """
    return Bound(Entry(kernel, *first, *rest), first)


def _call(typing: Any, entry: Any, first: Any, rest: Any) -> Any:
    """What the kernel behind an entry returns; `first` and `rest` are tuples of its arguments."""
    if not isinstance(entry, EntryType) or (*first.types, *rest.types) != entry.arguments:
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind, *tuples = signature.args
        address, *packed = arguments
        values = [
            builder.extract_value(values, number)
            for values, of in zip(packed, tuples, strict=True)
            for number in range(len(of.types))
        ]
        convention = context.call_conv
        shape = convention.get_function_type(kind.returns, kind.arguments)
        code = builder.inttoptr(address, shape.as_pointer())
        status, result = convention.call_function(builder, code, kind.returns, kind.arguments, values)
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return result

    return entry.returns(entry, first, rest), generate


call: Any = intrinsic(_call)
