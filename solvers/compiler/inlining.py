"""Functions whose text becomes part of a kernel (`kernels.inlined`): Numba's pass, without its two copies of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core import ir, untyped_passes
from numba.core.analysis import compute_cfg_from_blocks
from numba.core.compiler_machinery import register_pass
from numba.core.inline_closurecall import InlineWorker, callee_ir_validator
from numba.core.ir_utils import guard, simplify_CFG

__all__ = ["Inlining"]


class _OwnBlock(ir.Block):
    """A block that nobody else holds. The worker below copies a function deeply, once to change it and once to return
    it: a twentieth of a cold start. It was translated for this one call, and nobody asks for the second copy.
    """

    def __deepcopy__(self, memo: dict[int, Any]) -> _OwnBlock:
        return self


class _Inliner(InlineWorker):
    """Numba's, by the passes of kernels."""

    def __init__(self, state: Any, passes: Callable[[], Any]) -> None:
        flags, validator = state.flags, callee_ir_validator
        super().__init__(state.typingctx, state.targetctx, state.locals, state.pipeline, flags, validator)
        self._compiler_pipeline = lambda _: passes()

    def run_untyped_passes(self, func: Callable[..., Any], enable_ssa: bool = False) -> Any:
        """The function in Numba's representation, in blocks of its own."""
        func_ir = super().run_untyped_passes(func, enable_ssa)
        for block in func_ir.blocks.values():
            block.__class__ = _OwnBlock
        return func_ir


@register_pass(mutates_CFG=True, analysis_only=False)
class Inlining(untyped_passes.InlineInlinables):
    """Numba's pass, without copies and lifetimes."""

    _name = "kernel_inlining"

    def run_pass(self, state: Any) -> bool:
        """Replace each call of such a function by its text; calls in that text, too."""
        func_ir, worker = state.func_ir, _Inliner(state, state.pipeline.untyped_passes)
        left = list(func_ir.blocks.items())
        changed = False
        while left:
            _, block = left.pop()
            for k, statement in enumerate(block.body):
                call = statement.value if isinstance(statement, ir.Assign) else None
                if isinstance(call, ir.Expr) and call.op == "call":
                    if guard(self._do_work, state, left, block, k, call, worker):  # what follows is in a new block now
                        changed = True
                        break
        if changed:
            for dead in compute_cfg_from_blocks(func_ir.blocks).dead_nodes():
                del func_ir.blocks[dead]
            func_ir.blocks = simplify_CFG(func_ir.blocks)
        return True
