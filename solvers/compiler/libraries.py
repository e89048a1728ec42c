"""Libraries of LLVM code: of kernels that kernels call, and of entries.

Numba optimises every function together with all that it calls, translates it to machine code, and does both again
for each of its callers. Here a kernel that kernels call is kept as it was written, and only entries are optimised and
translated. Inside an entry everything but itself is private, so that the optimiser may drop unused arguments and
uncalled copies.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core import cgutils
from numba.core.codegen import CodeLibrary, JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.environment import lookup_environment

__all__ = ["EntryLibrary", "InnerLibrary", "OptionalLibrary", "RolledLibrary", "SeldomLibrary", "inner_result"]

_ENVIRONMENT = "_ZN08NumbaEnv"  # Numba looks for such a variable of every function


class _Idle:
    """A code generator without an environment to set: that of code which does not run."""

    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        """Do nothing: entries set those that they hold."""


class InnerLibrary(JITCodeLibrary):
    """Code of a kernel for its callers: made smaller, not optimised, never translated."""

    def __init__(self, codegen: Any, name: str) -> None:
        CodeLibrary.__init__(self, codegen, name)  # Numba's own parses an empty module to link into
        self._linking_libraries: list[Any] = []
        self._final_module: Any = None
        self._shared_module: Any = None

    @property
    def codegen(self) -> Any:
        """For Numba, which has a new function set its environment."""
        return _Idle

    def get_pointer_to_function(self, name: str) -> int:
        """Numba's sign of a function without a way in for Python."""
        self._ensure_finalized()
        return 0

    def add_ir_module(self, ir_module: Any) -> None:
        """Parse the code of the kernel itself."""
        self._raise_if_finalized()
        module = llvm.parse_assembly(cgutils.normalize_ir_text(str(ir_module)))
        module.name = ir_module.name
        self.add_llvm_module(module)

    def add_llvm_module(self, ll_module: Any) -> None:
        """Take the code of the kernel itself; other code is linked to it."""
        self._optimize_functions(ll_module)
        if self._final_module is None:
            self._final_module = ll_module
        else:
            self._final_module.link_in(ll_module)

    def _optimize_functions(self, ll_module: Any) -> None:
        """Numba runs all of its optimisations here; each entry does so again, after these three."""
        ll_module.data_layout = self._codegen._data_layout
        passes, builder = llvm.create_new_function_pass_manager(), self._codegen._pass_builder()
        passes.add_sroa_pass()
        passes.add_instruction_combine_pass()
        passes.add_simplify_cfg_pass()
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, builder)

    def finalize(self) -> None:
        """Link the code of all callees; nothing is optimised."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._final_module.verify()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        self._finalize_dynamic_globals()
        self._final_module.name = self.name
        self._shared_module = self._final_module
        self._finalized = True

    def serialize_using_object_code(self) -> Any:
        """The state that `inner_result` reads."""
        self._ensure_finalized()
        return self.name, self._shared_module.as_bitcode()

    @classmethod
    def read(cls, codegen: Any, kept: tuple[str, bytes]) -> InnerLibrary:
        """A library that was kept."""
        library = cls(codegen, kept[0])
        library._final_module = library._shared_module = llvm.parse_bitcode(kept[1])
        library._finalized = library._disable_inspection = True
        return library


class _Kept:
    """A target context with one change: the library of a kernel that was kept is an `InnerLibrary`."""

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def codegen(self) -> Any:
        """For Numba, which asks it for the library."""
        return self

    def unserialize_library(self, kept: Any) -> InnerLibrary:
        """The library."""
        return InnerLibrary.read(self._context.codegen(), kept)


def inner_result(context: Any, *payload: Any) -> Any:
    """Numba's compile result of a kernel that kernels call, from the reduced one."""
    found = CompileResult._rebuild(_Kept(context), *payload)
    return found._replace(target_context=context)


class EntryLibrary(JITCodeLibrary):
    """Code of an entry, with all that it calls.

    Its copies of kernels are private, not internal. LLVM drops arguments of either, but its JIT linker knows internal
    functions by name too, and takes one for the copy of the same kernel in any function that Numba itself compiles.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = "private"
        self._optimize()

    def _optimize(self) -> None:
        """All that Numba does."""
        super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        """Translate, and set the environments of all kernels in it."""
        super()._finalize_final_module()
        for name in self._environments():
            if (environment := lookup_environment(name)) is not None:
                self._codegen.set_env(name, environment)

    def _environments(self) -> list[str]:
        return [v.name for v in self._final_module.global_variables if v.name.startswith(_ENVIRONMENT)]

    def _get_module_for_linking(self) -> Any:
        """Data cached beside the machine code, a module with the names of this one: nothing links an entry, and Numba
        needs the variables that it looks for, and the external functions.
        """
        self._ensure_finalized()
        text = str(self._codegen._create_empty_module(self.name))
        for name in self._environments():
            text += f'\n@"{name}" = common global i8* null'
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                text += f'\ndefine void @"{function.name}"() {{\n  ret void\n}}'
        return llvm.parse_assembly(text)


class OptionalLibrary(EntryLibrary):
    """An optional kernel: its loops run over a few joints, axes or contacts. Vectors of several rounds of a loop make
    them slower, by up to a tenth, and take a tenth of a cold start; kernels that need vectors have lanes.py.
    """

    def _optimize(self) -> None:
        passes, builder = self._codegen._module_pass_manager(loop_vectorize=False)
        passes.run(self._final_module, builder)


class RolledLibrary(EntryLibrary):
    """An optional kernel whose loops have few rounds, unknown beforehand. To unroll them gains nothing, and doubles the
    code: 0.6 of the 1.4 s that the system of the couplings takes. Anywhere else a step would be slower by a tenth.
    """

    def _optimize(self) -> None:
        tuning = llvm.create_pipeline_tuning_options(speed_level=3)
        tuning.loop_vectorization, tuning.slp_vectorization, tuning.loop_unrolling = False, True, False
        builder = llvm.create_pass_builder(self._codegen._tm, tuning)
        builder.getModulePassManager().run(self._final_module, builder)


class SeldomLibrary(EntryLibrary):
    """An entry that few steps call: optimised in a third of the time, for half the speed."""

    def _optimize(self) -> None:
        passes, builder = self._codegen._module_pass_manager(opt=1, loop_vectorize=False, slp_vectorize=False)
        passes.run(self._final_module, builder)
