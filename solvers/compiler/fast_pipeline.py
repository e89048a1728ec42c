"""The fast pipeline from kernels to machine code: each entry once, with all its callees (libraries.py), by those passes
of Numba that have work to do on a kernel.
"""

from __future__ import annotations

from typing import Any

from numba.core import interpreter, transforms, typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder, StateDict
from numba.core.compiler_machinery import PassManager, _pass_registry, register_pass
from numba.core.errors import NumbaError
from numba.core.ir_utils import build_definitions
from numba.core.rewrites import rewrite_registry

from solvers.compiler.arithmetic import KernelTyping
from solvers.compiler.garbage import seldom_collected
from solvers.compiler.inference import KernelInference
from solvers.compiler.inlining import Inlining
from solvers.compiler.libraries import EntryLibrary, InnerLibrary, OptionalLibrary, RolledLibrary, SeldomLibrary
from solvers.compiler.lowering import KernelLowering
from solvers.compiler.progress import compiling
from solvers.compiler.single_assignment import reconstruct_single_assignment

__all__ = ["EntryCompiler", "InnerCompiler", "OptionalCompiler", "RolledCompiler", "SeldomCompiler", "drop_caches"]

_IDLE = (  # features that kernels do not use: closures, array expressions, literals as types, exceptions, and more
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.RewriteDynamicRaises,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.NopythonRewrites,
    typed_passes.InlineOverloads,
    typed_passes.DumpParforDiagnostics,
    typed_passes.AnnotateTypes,
    typed_passes.IRLegalization,  # where variables end, of which _Lower takes no notice
)


def _tidy(func_ir: Any) -> None:
    """Order the blocks. After each of the four passes below, Numba also computes where every variable lives, which only
    generators, lifted loops and Python's objects need: a twentieth of a cold start.
    """
    func_ir.blocks = transforms.canonicalize_cfg(func_ir.blocks)


def drop_caches(bytecode: Any) -> None:
    """Drop the empty instructions in which Python 3.11 keeps its caches: half of all, and Numba interprets each."""
    for instruction in reversed(list(bytecode.table.values())):
        following = bytecode.table.get(instruction.next)
        if following is not None and following.opname == "CACHE":
            instruction.next = following.next
            del bytecode.table[following.offset]


class _Interpreter(interpreter.Interpreter):
    """Numba's, for functions without `with`, dictionaries and exceptions to catch."""

    def post_process(self, peepholes: Any, func_ir: Any) -> Any:
        """Rewrite nothing but lists that Python makes of the arguments of a call."""
        wanted = (interpreter.peep_hole_list_to_tuple, interpreter.peep_hole_call_function_ex_to_call_function_kw)
        return super().post_process([peephole for peephole in peepholes if peephole in wanted], func_ir)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Translation(untyped_passes.TranslateByteCode):
    """Numba's pass, with the above."""

    _name = "kernel_translation"

    def run_pass(self, state: Any) -> bool:
        """Translate Python's byte code to Numba's representation."""
        drop_caches(state.bc)
        state.func_ir = _Interpreter(state.func_id).interpret(state.bc)
        return True


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
    """Numba's pass, without lifetimes, and with fewer blocks to rewrite."""

    _name = "kernel_ssa"

    def run_pass(self, state: Any) -> bool:
        """Give every assignment a variable of its own."""
        state.func_ir.blocks = reconstruct_single_assignment(state.func_ir.blocks)
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
    untyped_passes.TranslateByteCode: _Translation,
    untyped_passes.IRProcessing: _Processing,
    untyped_passes.GenericRewrites: _Rewrites,
    untyped_passes.InlineInlinables: Inlining,
    untyped_passes.ReconstructSSA: _SingleAssignment,
    typed_passes.PreLowerStripPhis: _StripPhis,
    typed_passes.NopythonTypeInference: KernelInference,
    typed_passes.NativeLowering: KernelLowering,
}


class _Passes(PassManager):
    """Passes that run without the events, the clocks and the texts for both that Numba makes for each."""

    def finalize(self) -> None:
        """Find what the passes need of each other, once."""
        if not self.finalized:
            super().finalize()

    def run(self, state: Any) -> None:
        """Run them."""
        for kind, said in self.passes:
            step = _pass_registry.get(kind).pass_inst
            step.analysis = self._analysis
            try:
                step.run_initialization(state)
                step.run_pass(state)
                step.run_finalizer(state)
            except NumbaError as error:
                raise self._patch_error(f"Failed in kernel mode (step: {said})", error) from error


class _Prepared:
    """A target context that is not refreshed, which Numba does before each function: `cache.prepare` did."""

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def refresh(self) -> None:
        """Do nothing."""


_PASSES: dict[str, PassManager] = {}  # the same for all kernels


def _chosen(name: str, default: PassManager) -> PassManager:
    """Numba's passes that are not idle."""
    chosen = _Passes(name)
    chosen.passes = [(_REPLACED.get(kind, kind), said) for kind, said in default.passes if kind not in _IDLE]
    chosen.finalize()
    return chosen


class _Compiler(Compiler):
    """Numba's compiler, into a library of our own, without the passes that are idle."""

    library: type[JITCodeLibrary] = JITCodeLibrary

    def __init__(self, typingctx: Any, targetctx: Any, *others: Any) -> None:
        super().__init__(KernelTyping(typingctx), _Prepared(targetctx), *others)

    def define_pipelines(self) -> list[PassManager]:
        """Which passes, in which order."""
        if "kernel" not in _PASSES:
            (default,) = super().define_pipelines()
            _PASSES["kernel"] = _chosen("kernel", default)
        return [_PASSES["kernel"]]

    def untyped_passes(self) -> PassManager:
        """The passes up to Numba's representation without types: of a function whose text becomes part of a kernel."""
        if "text" not in _PASSES:
            state = StateDict(func_ir=None, flags=self.state.flags)
            _PASSES["text"] = _chosen("text", DefaultPassBuilder.define_untyped_pipeline(state))
        return _PASSES["text"]

    def compile_extra(self, func: Any) -> Any:
        """Compile one function."""
        library = self.library(self.state.targetctx.codegen(), func.__qualname__)
        library.enable_object_caching()
        self.state.library = library
        with compiling(func), seldom_collected():
            return super().compile_extra(func)


class InnerCompiler(_Compiler):
    """For kernels that kernels call."""

    library = InnerLibrary


class EntryCompiler(_Compiler):
    """For functions called from Python."""

    library = EntryLibrary


class OptionalCompiler(_Compiler):
    """For functions called by their address."""

    library = OptionalLibrary


class RolledCompiler(_Compiler):
    """For those of them whose loops have few rounds."""

    library = RolledLibrary


class SeldomCompiler(_Compiler):
    """For those that few steps call."""

    library = SeldomLibrary
