"""The fast pipeline from kernels to machine code: each entry once, with all its callees, and nothing else.

Numba optimises every function together with all that it calls, translates it to machine code, and does both again
for each of its callers. Here a kernel that kernels call is kept as it was written, and only entries are optimised and
translated: functions called from Python or by their address. Inside an entry everything but itself is private, so that
the optimiser may drop unused arguments and uncalled copies.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm
from numba.core import transforms, typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.ir_utils import build_definitions
from numba.core.rewrites import rewrite_registry
from numba.core.ssa import reconstruct_ssa

from solvers.compiler.arithmetic import KernelTyping
from solvers.compiler.lowering import KernelLowering
from solvers.compiler.notice import compiling

__all__ = ["EntryCompiler", "InnerCompiler"]

_ENVIRONMENT = "_ZN08NumbaEnv"  # Numba looks for such a variable of every function


def _shell(library: Any, module: Any, functions: tuple[str, ...] = ()) -> Any:
    """A module with the names of another: variables that Numba looks for, and these functions, without their code."""
    text = str(library._codegen._create_empty_module(library.name))
    for variable in module.global_variables:
        if variable.name.startswith(_ENVIRONMENT):
            text += f'\n@"{variable.name}" = common global i8* null'
    for name in functions:
        text += f'\ndefine void @"{name}"() {{\n  ret void\n}}'
    return llvm.parse_assembly(text)


class InnerLibrary(JITCodeLibrary):
    """Code of a kernel for its callers: made smaller, not optimised, never translated."""

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

    def _optimize_final_module(self) -> None:
        """Left to the entries."""

    def _finalize_final_module(self) -> None:
        """Keep the code for linking; the loaded and cached translation is a shell without functions."""
        code: Any = self._final_module  # type: ignore[has-type]
        code.verify()
        for function in code.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        self._final_module = _shell(self, code)
        self._final_module.name = self.name
        super()._finalize_final_module()
        self._shared_module = code


class EntryLibrary(JITCodeLibrary):
    """Code of an entry, with all that it calls.

    Its copies of kernels are private, not internal. LLVM drops arguments of either, but its JIT linker knows internal
    functions by name too, and takes one for the copy of the same kernel in any function that Numba itself compiles.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = "private"
        super()._optimize_final_module()

    def _get_module_for_linking(self) -> Any:
        """Data cached beside the machine code: nothing links an entry, and Numba needs its names only."""
        self._ensure_finalized()
        code: Any = self._final_module
        external = [f for f in code.functions if not f.is_declaration and f.linkage == llvm.Linkage.external]
        return _shell(self, code, tuple(f.name for f in external))


_IDLE = (  # features that kernels do not use: closures, array expressions, literals as types, exceptions; print types
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.RewriteDynamicRaises,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.NopythonRewrites,
    typed_passes.DumpParforDiagnostics,
    typed_passes.AnnotateTypes,
    typed_passes.IRLegalization,  # where variables end, of which _Lower takes no notice
)


def _tidy(func_ir: Any) -> None:
    """Order the blocks. After each of the four passes below, Numba also computes where every variable lives, which only
    generators, lifted loops and Python's objects need: a twentieth of a cold start.
    """
    func_ir.blocks = transforms.canonicalize_cfg(func_ir.blocks)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Processing(untyped_passes.IRProcessing):
    """Numba's pass, without lifetimes."""

    _name = "kernel_ir_processing"

    def run_pass(self, state: Any) -> bool:
        """Order the blocks."""
        _tidy(state.func_ir)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _Rewrites(untyped_passes.GenericRewrites):
    """Numba's pass, without lifetimes."""

    _name = "kernel_rewrites"

    def run_pass(self, state: Any) -> bool:
        """Apply each rewrite to each block until it matches no more."""
        blocks = state.func_ir.blocks
        for make in rewrite_registry.rewrites["before-inference"]:
            rewrite, left = make(state), list(blocks.items())
            while left:
                key, block = left.pop()
                if rewrite.match(state.func_ir, block, state.typemap, state.calltypes):
                    blocks[key] = rewrite.apply()
                    blocks[key].verify()
                    left.append((key, blocks[key]))
        _tidy(state.func_ir)
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _SingleAssignment(untyped_passes.ReconstructSSA):
    """Numba's pass, without lifetimes."""

    _name = "kernel_ssa"

    def run_pass(self, state: Any) -> bool:
        """Give every assignment a variable of its own."""
        state.func_ir = reconstruct_ssa(state.func_ir)
        self._patch_locals(state)
        state.func_ir._definitions = build_definitions(state.func_ir.blocks)
        _tidy(state.func_ir)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _StripPhis(typed_passes.PreLowerStripPhis):
    """Numba's pass, without lifetimes."""

    _name = "kernel_strip_phis"

    def run_pass(self, state: Any) -> bool:
        """Replace phi nodes by assignments in the blocks before."""
        state.func_ir = self._strip_phi_nodes(state.func_ir)
        state.func_ir._definitions = build_definitions(state.func_ir.blocks)
        _tidy(state.func_ir)
        return True


_REPLACED = {
    untyped_passes.IRProcessing: _Processing,
    untyped_passes.GenericRewrites: _Rewrites,
    untyped_passes.ReconstructSSA: _SingleAssignment,
    typed_passes.PreLowerStripPhis: _StripPhis,
    typed_passes.NativeLowering: KernelLowering,
}
_SELDOM = (50_000, 20, 100)  # thresholds of the garbage collector


@contextmanager
def _seldom_collected() -> Iterator[None]:
    """Collect garbage seldom: a compilation makes millions of objects of which most stay while it goes on, and going
    through them again and again was an eighth of a cold start.
    """
    before = gc.get_threshold()
    if not gc.isenabled() or not 0 < before[0] < _SELDOM[0]:
        yield
        return
    gc.set_threshold(*_SELDOM)
    try:
        yield
    finally:
        if gc.get_threshold() == _SELDOM:  # unless it was changed meanwhile
            gc.set_threshold(*before)


class _Compiler(Compiler):
    """Numba's compiler, into a library of our own, without the passes that are idle."""

    library: type[JITCodeLibrary] = JITCodeLibrary

    def define_pipelines(self) -> list[PassManager]:
        """Which passes, in which order."""
        (default,) = super().define_pipelines()
        chosen = PassManager(default.pipeline_name)
        chosen.passes = [(_REPLACED.get(kind, kind), said) for kind, said in default.passes if kind not in _IDLE]
        chosen.finalize()
        return [chosen]

    def compile_extra(self, func: Any) -> Any:
        """Compile one function."""
        self.state.typingctx = KernelTyping(self.state.typingctx)
        library = self.library(self.state.targetctx.codegen(), func.__qualname__)
        library.enable_object_caching()
        self.state.library = library
        with compiling(func), _seldom_collected():
            return super().compile_extra(func)


class InnerCompiler(_Compiler):
    """For kernels that kernels call."""

    library = InnerLibrary


class EntryCompiler(_Compiler):
    """For functions called from Python or by their address."""

    library = EntryLibrary
