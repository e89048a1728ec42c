"""Negative indices of kernels on Numba's own pipeline: refused where bounds are checked, as the fast pipeline does.

Numba counts a negative index from the end, so that a wrong one which stays inside the array goes unnoticed. With
NUMBA_BOUNDSCHECK=1 this pass turns a[i] into a[not_negative(i)]. Numbers in the source keep their meaning: a[-1].
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils, ir, ir_utils
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.extending import intrinsic

__all__ = ["RefuseNegativeIndices"]


@intrinsic
def not_negative(typing: Any, index: Any) -> Any:
    """The index itself; IndexError for a negative number."""

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if isinstance(sig.args[0], types.Integer) and sig.args[0].signed:
            below = builder.icmp_signed("<", args[0], args[0].type(0))
            with cgutils.if_unlikely(builder, below):
                context.call_conv.return_user_exc(builder, IndexError, ("index that is negative",))
        return args[0]

    return index(index), lower


@register_pass(mutates_CFG=False, analysis_only=False)
class RefuseNegativeIndices(FunctionPass):
    """Checks in front of every index that is no number in the source."""

    _name = "refuse_negative_indices"

    def __init__(self) -> None:
        FunctionPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Rewrite one function; whether it changed."""
        found = False
        for block in state.func_ir.blocks.values():
            body: list[Any] = []
            for statement in block.body:
                reads = isinstance(statement, ir.Assign) and getattr(statement.value, "op", None) == "getitem"
                access = statement if isinstance(statement, ir.SetItem) else statement.value if reads else None
                if access is not None:
                    index = _checked(state.func_ir, block.scope, access.index, body)
                    found, access.index = found or index is not access.index, index
                body.append(statement)
            block.body = body
        return found


def _checked(func_ir: Any, scope: Any, index: Any, body: list[Any]) -> Any:
    """The variable of an index, or a new one that is checked; each entry of a tuple for itself."""
    if ir_utils.guard(ir_utils.find_const, func_ir, index) is not None:
        return index
    made = ir_utils.guard(ir_utils.get_definition, func_ir, index)
    if getattr(made, "op", None) == "build_tuple":
        return _new(
            func_ir, scope, ir.Expr.build_tuple([_checked(func_ir, scope, i, body) for i in made.items], made.loc), body
        )
    check = _new(func_ir, scope, ir.Global("not_negative", not_negative, index.loc), body)
    return _new(func_ir, scope, ir.Expr.call(check, [index], (), index.loc), body)


def _new(func_ir: Any, scope: Any, value: Any, body: list[Any]) -> Any:
    """A new variable with a value."""
    name = ir.Var(scope, ir_utils.mk_unique_var("$index"), value.loc)
    func_ir._definitions[name.name].append(value)
    body.append(ir.Assign(value, name, value.loc))
    return name
