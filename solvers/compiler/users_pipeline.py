"""Compilers for functions of the user: Numba's own passes, into the libraries of kernels where those are fast.

The code of a loop around such functions can be kept on disk (users_cache.py). So the names in it are made of contents:
another process may number its functions differently, and must not take one for the other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core.compiler import CompileResult

from solvers.compiler.function_digest import function_digest
from solvers.compiler.pipeline import FAST, PlainCompiler

__all__ = ["UsersCompiler", "UsersEntryCompiler", "UsersInnerCompiler"]


class UsersCompiler(PlainCompiler):
    """Plain compiler for functions of the user, and loops around them."""

    own = False


class _UsersLibraryCompiler(UsersCompiler):
    """The same, into a library of our own, under a name of the content."""

    library: Any

    def compile_extra(self, func: Callable[..., Any]) -> CompileResult:
        """Compile one function."""
        self.state.library = self.library(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(func)

    def _compile_bytecode(self) -> CompileResult:
        """Compile its byte code."""
        identity = self.state.func_id
        if (digest := function_digest(identity.func, {})) is not None:
            identity.func_qualname += f"_{digest}"
        return super()._compile_bytecode()


UsersEntryCompiler: type[UsersCompiler] = UsersCompiler  # called from Python
UsersInnerCompiler: type[UsersCompiler] = UsersCompiler  # called by loops, and by each other
if FAST:
    from solvers.compiler.libraries import EntryLibrary, InnerLibrary

    class _Entry(_UsersLibraryCompiler):
        library = EntryLibrary

    class _Inner(_UsersLibraryCompiler):
        library = InnerLibrary

    UsersEntryCompiler, UsersInnerCompiler = _Entry, _Inner
