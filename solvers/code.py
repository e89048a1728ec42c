"""How kernels become machine code: each entry once, with all that it calls; nothing else at all.

Numba 0.68 optimises every function together with all that it calls, translates it to machine code, and does both again
for each of its callers. Here a kernel that kernels call is kept as it was written, and what is optimised and translated
are entries: functions called from Python or by their address. Inside an entry everything but itself is private, so that
the optimiser may drop arguments nobody reads and copies nobody calls.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

from solvers.notice import compiling

__all__ = ["EntryCompiler", "InnerCompiler"]

_ENVIRONMENT = "_ZN08NumbaEnv"  # Numba looks for such a variable of every function


class InnerLibrary(JITCodeLibrary):
    """Code of a kernel for its callers: not optimised beyond single functions, never translated."""

    def _optimize_final_module(self) -> None:
        """Left to the entries."""

    def _finalize_final_module(self) -> None:
        """Keep the code for linking; what is loaded, and cached as translated, is a shell without functions."""
        code: Any = self._final_module  # type: ignore[has-type]
        code.verify()
        for function in code.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        shell = str(self._codegen._create_empty_module(self.name))
        for variable in code.global_variables:
            if variable.name.startswith(_ENVIRONMENT):
                shell += f'\n@"{variable.name}" = common global i8* null'
        self._final_module = llvm.parse_assembly(shell)
        self._final_module.name = self.name
        super()._finalize_final_module()
        self._shared_module = code


class EntryLibrary(JITCodeLibrary):
    """Code of an entry, with all that it calls."""

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._optimize_final_module()


class _Compiler(Compiler):
    """Numba's compiler, into a library of our own."""

    library: type[JITCodeLibrary] = JITCodeLibrary

    def compile_extra(self, func: Any) -> Any:
        """Compile one function."""
        library = self.library(self.state.targetctx.codegen(), func.__qualname__)
        library.enable_object_caching()
        self.state.library = library
        with compiling():
            return super().compile_extra(func)


class InnerCompiler(_Compiler):
    """For kernels that kernels call."""

    library = InnerLibrary


class EntryCompiler(_Compiler):
    """For what Python calls, or what is called by its address."""

    library = EntryLibrary
