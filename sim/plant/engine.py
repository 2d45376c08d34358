"""MuJoCo's C functions as compiled code calls them, by name, on the addresses of a model and its data.

The library is the one in MuJoCo's own wheel, which its Python module has loaded already: the same code on the same
memory, so that states are those of `mujoco.mj_step` bit for bit. A call costs what the C function costs.
"""

from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import mujoco
from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def _library() -> Path:
    names = ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll")
    found = [path for name in names for path in Path(mujoco.__file__).parent.glob(name)]
    if not found:
        raise ImportError(f"{Path(mujoco.__file__).parent} has no MuJoCo library ({', '.join(names)})")
    return found[0]


llvm.load_library_permanently(str(_library()))

_model = _data = types.intp  # addresses
mj_step: Any = types.ExternalFunction("mj_step", types.void(_model, _data))


@intrinsic
def _pointer(typingctx: Any, address: Any) -> Any:
    """The address of doubles as a pointer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.DoubleType().as_pointer())

    return types.CPointer(types.float64)(types.intp), generate


@intrinsic
def _whole_pointer(typingctx: Any, address: Any) -> Any:
    """The address of whole numbers of 32 bits as a pointer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.IntType(32).as_pointer())

    return types.CPointer(types.int32)(types.intp), generate


pointer: Any = _pointer
"""The address of doubles as a pointer, for `numba.carray`."""

whole_pointer: Any = _whole_pointer
"""The address of whole numbers of 32 bits as a pointer, for `numba.carray`."""


def address(array: Any) -> int:
    """Where an array's numbers begin."""
    return int(array.__array_interface__["data"][0])
