"""Compiled kernels as they lie on disk, taken from there without waking Numba's compiler.

Numba prepares to compile before it loads what needs no compiling: it imports SciPy's BLAS, registers all that NumPy
can do and parses the LLVM code of every kernel, at the start of each process. A kernel on disk needs none of it, only
its machine code, Numba's memory manager and the constants of its exceptions. The rest is made up for when a kernel is
compiled after all, by Numba itself.

Common ground of both worlds: it knows nothing of a walker.
"""

import io
import pickle
import sys
from typing import Any

import llvmlite.binding as llvm
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.environment import Environment, lookup_environment
from numba.core.runtime import rtsys


class Library(JITCodeLibrary):
    """Machine code from disk; its LLVM code is parsed where another kernel is compiled that calls it."""

    _bitcode: bytes | None = None
    _parsed: Any = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> "Library":
        """Link machine code, so that it can run."""
        name, kind, (machine_code, bitcode) = state
        assert kind == "object"
        library = cls(codegen, name)
        library.enable_object_caching()
        library._set_compiled_object(machine_code)
        library._bitcode = bitcode
        library._finalize_final_module()
        return library

    def get_pointer_to_function(self, name: str) -> int:
        """Where a function of it begins."""
        return int(self._codegen._engine.get_function_address(name))

    @property
    def _shared_module(self) -> Any:
        if self._parsed is None and self._bitcode is not None:
            self._parsed = llvm.parse_bitcode(self._bitcode)
            self._codegen._engine._load_defined_symbols(self._parsed)
        return self._parsed

    @_shared_module.setter
    def _shared_module(self, module: Any) -> None:
        self._parsed = module


def _environment(module: str, constants: list[Any], name: str) -> Environment:
    """What a kernel finds the constants of its exceptions in; the module that it is of need not be there."""
    known = lookup_environment(name)
    if known is not None:
        return known
    home = sys.modules.get(module)
    environment = Environment({"__name__": module} if home is None else home.__dict__)
    environment.consts[:] = constants
    environment.env_name = name
    Environment._memo[name] = environment
    return environment


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        """What a name on disk stands for; an environment imports nothing."""
        return _environment if name == "_rebuild_env" else super().find_class(module, name)


class _Files(IndexDataCacheFile):
    def _load_data(self, name: str) -> Any:
        with open(self._data_path(name), "rb") as file:
            return _Unpickler(io.BytesIO(file.read())).load()


class _Results(CompileResultCacheImpl):
    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """A kernel that can be called, from what lies on disk; Numba's lock on compiling is held."""
        codegen = target_context.codegen()
        usual, codegen._library_class = codegen._library_class, Library
        try:
            return super().rebuild(target_context, payload)
        finally:
            codegen._library_class = usual


class KernelCache(FunctionCache):
    """Where a kernel lies on disk; what it names must be there, or else it counts as missing.

    That is so for a kernel that takes records of any class: those of a test or of a user's script among them.
    """

    _impl_class = _Results

    def __init__(self, function: Any) -> None:
        """Args: function: the kernel."""
        super().__init__(function)
        place = self._impl.locator
        self._cache_file = _Files(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=place.get_source_stamp(),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What lies there, or None."""
        rtsys.initialize(target_context)
        try:
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except (ImportError, AttributeError):
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a kernel, in place of those of strangers."""
        try:
            super().save_overload(sig, data)
        except (ImportError, AttributeError):
            self.flush()
            super().save_overload(sig, data)
